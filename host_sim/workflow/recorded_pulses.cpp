#include "workflow/recorded_pulses.hpp"

#include <limits>

namespace bms::workflow {

namespace {

/// Where the state of charge of recording k is known; a recording with soc_ref does not need it.
measurement::KnownSoc known_soc(const IdentifyOptions& options, const IdentifyResult& result, std::size_t k,
                                double first_s) {
  const auto& initial = result.identification.initial;
  // recordings of several temperatures are fitted in groups, and only the first group has its states here
  if (initial.size() == options.recordings.size()) {
    if (k == 0) return {result.data.front().time_s.front(), initial[k].soc};
    // a start that is estimated belongs to where the window begins, which is known of the first recording only
    const bool whole = options.window.high >= SocWindow{}.high && options.window.low <= SocWindow{}.low;
    if (whole) return {first_s, initial[k].soc};
  }
  return {first_s, options.initial_soc.value.value_or(std::numeric_limits<double>::quiet_NaN())};
}

}  // namespace

std::vector<RecordedPulses> recorded_pulses(const IdentifyOptions& options, const IdentifyResult& result) {
  const double capacity_ah =
      result.data.empty() ? result.identification.cell.capacity_ah : result.data.front().capacity_ah;
  std::vector<RecordedPulses> found;
  for (std::size_t k = 0; k < options.recordings.size(); ++k) {
    const measurement::Recording r =
        files::read_recording(options.recordings[k], files::VoltageColumn::required, options.reading);
    found.push_back({options.recordings[k],
                     measurement::pulses_of(r, capacity_ah, known_soc(options, result, k, r.time_s.front()))});
  }
  return found;
}

}  // namespace bms::workflow
