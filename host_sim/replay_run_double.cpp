#include "host_sim/replay_run.hpp"

namespace bms::host_sim {

template Track run<double>(const files::CellFile& file, const measurement::SampleList& samples,
                           const std::optional<measurement::StartingPoint>& start, Timing timing);

}  // namespace bms::host_sim
