// Reports: one HTML file each with its data, its plots and their script inside. Opens without a network.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "files/page_content.hpp"
#include "host_sim/replay.hpp"

namespace bms::reports {

std::string replay_report(const host_sim::ReplayResult& result);
/// Tables and charts one below the other.
std::string page_of(const files::PageContent& content);

/// The frame of every page (report/page.html) around a body and its script. data: JSON that the script finds as
/// `report`.
std::string page(std::string_view body, std::string_view script, std::string_view title, const std::string& data);

/// JSON as it may stand inside a script.
std::string in_script(std::string json);

/// Rows to show: all, or of each stretch its first and last and where voltage and current are lowest and highest, so
/// that no peak is lost. More than `most` are thinned: a screen has a few thousand columns.
std::vector<std::size_t> shown_rows(const measurement::Recording& recording, std::size_t most = 40'000);

/// One sentence for a person: where the state of charge ended, and how far it can be trusted.
std::string statement(const host_sim::ReplayResult& result);

}  // namespace bms::reports
