#include "hal/insulation.hpp"

namespace bms::hal {

Insulation insulation() { return {}; }

}  // namespace bms::hal
