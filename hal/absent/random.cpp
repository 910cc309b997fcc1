// No random number generator.
#include "hal/random.hpp"

namespace bms::hal {

std::uint32_t random_word() { return 0; }

}  // namespace bms::hal
