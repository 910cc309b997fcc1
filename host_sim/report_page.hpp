// Reports: one HTML file each with its data, its plots and their script inside. Opens without a network.
#pragma once

#include <string>

#include "host_sim/replay.hpp"
#include "host_sim/study.hpp"

namespace bms {

std::string replay_report(const ReplayResult& result);
std::string study_report(const StudyResult& result);

/// One sentence for a person: where the state of charge ended, and how far it can be trusted.
std::string statement(const ReplayResult& result);

}  // namespace bms
