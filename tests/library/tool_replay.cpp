#include "tests/library/tool_replay.hpp"

#include "files/recording.hpp"
#include "replay/replay.hpp"

namespace bms {

std::vector<ReplayedSample> tool_replay(const std::string& cell, std::optional<std::int32_t> initial_soc_ppb) {
  const auto samples =
      measurement::samples(files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv"));
  std::optional<measurement::StartingPoint> start;
  if (initial_soc_ppb) start = measurement::StartingPoint{*initial_soc_ppb, 200'000'000};
  const replay::Track track =
      replay::run_on_host(files::read_cell(cell), samples, start, replay::ScalarKind::float32, replay::Timing::none);
  std::vector<ReplayedSample> rows;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const measurement::Sample& s = samples[k];
    rows.push_back({s.time_us, s.current_ua, s.voltage_uv, s.temperature_cdegc, track.rows.words()[k]});
  }
  return rows;
}

std::uint32_t hash_of(const std::string& cell) { return files::read_cell(cell).hash; }

}  // namespace bms
