#include "host_sim/replay_run.hpp"

namespace bms {

template Track run<double>(const CellFile& file, const std::vector<Sample>& samples, const std::optional<StartingPoint>& start);

}  // namespace bms
