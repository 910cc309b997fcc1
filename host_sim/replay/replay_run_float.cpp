#include "replay/replay_run.hpp"

namespace bms::replay {

template Track run<float>(const files::CellFile& file, const measurement::SampleList& samples, const Start& start,
                          Timing timing);

}  // namespace bms::replay
