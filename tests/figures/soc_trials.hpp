// The estimator on real recordings in trouble: started wrong, cut in the middle of the plateau, with sensors that are
// off.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "files/cell_file.hpp"
#include "host_sim/replay.hpp"
#include "measurement/recording.hpp"

namespace bms {

/// One of them: what came of the recording, and what the estimator is told.
struct SocTrial {
  std::string name, trouble;
  const files::CellFile& cell;
  measurement::Recording recording;
  host_sim::SocPrior prior;
};

/// Recordings of data/a123_26650 and data/a123_esctoolbox, with the extended cell file of that name.
void each_soc_trial(const std::filesystem::path& data, const std::function<void(const SocTrial&)>& f);

/// Markdown: a row a trial; the last line over all of them.
std::string soc_trials(const std::filesystem::path& data);

}  // namespace bms
