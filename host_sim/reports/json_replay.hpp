// Results of the commands that need no identification as JSON objects. Their names are relied on from outside.
#pragma once

#include <string>

#include "experiments/profile_figures.hpp"
#include "files/logs/frame_list.hpp"
#include "replay/cuts.hpp"
#include "replay/replay.hpp"

namespace bms::reports {

std::string json_of(const replay::ReplayResult& result, const std::string& trace_sha256);
std::string json_of(const replay::CutResult& result);
/// Of bms import; out: the file that was written, or empty.
std::string json_of(const measurement::Recording& recording, const std::string& out);
/// Of bms import --list.
std::string json_of(const files::FrameList& list, const std::string& log);
std::string json_of(const std::string& experiment, const std::string& out, const experiments::ProfileFigures& figures);

}  // namespace bms::reports
