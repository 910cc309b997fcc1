#include "host_sim/replay_run.hpp"

namespace bms::host_sim::replay_detail {

template Track run_with_mechanisms<arithmetic::FixedPoint>(const FixedExtendedCell& cell, bool errors,
                                                           const measurement::SampleList& samples,
                                                           const std::optional<measurement::StartingPoint>& start,
                                                           Timing timing);

}  // namespace bms::host_sim::replay_detail
