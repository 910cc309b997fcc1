// The report of a replay: one HTML file with its data, its plots and their script inside. Opens without a network.
#pragma once

#include <string>

#include "host_sim/replay.hpp"

namespace bms {

std::string replay_report(const ReplayResult& result);

/// One sentence for a person: where the state of charge ended, and how far it can be trusted.
std::string statement(const ReplayResult& result);

}  // namespace bms
