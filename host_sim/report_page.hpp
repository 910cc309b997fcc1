// Reports: one HTML file each with its data, its plots and their script inside. Opens without a network.
#pragma once

#include <string>

#include "host_sim/page_content.hpp"
#include "host_sim/replay.hpp"

namespace bms {

std::string replay_report(const ReplayResult& result);
/// Tables and charts one below the other.
std::string page_of(const PageContent& content);

/// One sentence for a person: where the state of charge ended, and how far it can be trusted.
std::string statement(const ReplayResult& result);

}  // namespace bms
