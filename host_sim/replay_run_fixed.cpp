#include "host_sim/replay_run.hpp"

namespace bms {

template Track run<model::FixedPoint>(const CellFile& file, const std::vector<Sample>& samples, const std::optional<StartingPoint>& start);

}  // namespace bms
