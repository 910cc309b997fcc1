#include "replay/replay_run.hpp"

namespace bms::replay::replay_detail {

template Track run_with_mechanisms<arithmetic::FixedPoint>(const FixedExtendedCell& cell, bool errors,
                                                           const measurement::SampleList& samples, const Start& start,
                                                           Timing timing);

}  // namespace bms::replay::replay_detail
