// The estimator on real recordings with faults: a wrong start, a start in the middle of the plateau, sensor errors.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"
#include "replay/replay.hpp"

namespace bms {

/// One trial: the changed recording, and the initial state of charge that the estimator receives.
struct SocTrial {
  std::string name, trouble;
  const files::CellFile& cell;
  measurement::Recording recording;
  replay::SocPrior prior;
};

/// Calls f for each trial with the recordings of data/a123_26650 and data/a123_esctoolbox, and the extended cell file
/// of that name.
void each_soc_trial(const std::filesystem::path& data, const std::function<void(const SocTrial&)>& f);

/// Markdown: one row for each trial; the last one over all trials.
std::string soc_trials(const std::filesystem::path& data);

}  // namespace bms
