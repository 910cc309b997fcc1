// The estimator on real recordings in trouble: started wrong, cut in the middle of the plateau, with sensors that are off.
#pragma once

#include <filesystem>
#include <string>

namespace bms {

/// Markdown: a row a trial, over recordings of data/a123_26650 with the cell file of that name; the last line over all of them.
std::string soc_trials(const std::filesystem::path& data);

}  // namespace bms
