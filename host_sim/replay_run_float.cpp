#include "host_sim/replay_run.hpp"

namespace bms {

template Track run<float>(const CellFile& file, const std::vector<Sample>& samples, const std::optional<StartingPoint>& start);

}  // namespace bms
