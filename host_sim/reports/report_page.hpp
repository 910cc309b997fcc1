// Reports: one HTML file each, with data, plots and script inside. It opens without a network.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "files/page_content.hpp"
#include "replay/replay.hpp"

namespace bms::reports {

std::string replay_report(const replay::ReplayResult& result);
/// A page of tables and charts, one below the other.
std::string page_of(const files::PageContent& content);
/// The same, the charts first.
std::string page_with_charts_first(const files::PageContent& content);

/// What a page may connect to while it is open.
enum class Connections { none, own_server };

/// The frame of every page (page/page.html) around a body and its script. title: any text. data: JSON, which the script
/// has as `report`; in_script() of it. The Content-Security-Policy of the page allows only its own scripts, by their
/// SHA-256, and no other source of anything.
std::string page(std::string_view body, std::string_view script, std::string_view title, const std::string& data,
                 Connections connections = Connections::none);

/// The Content-Security-Policy of a page that page() has made, for the header of a server.
std::string policy_in(std::string_view page);

/// The text as content of an element or of an attribute: no character of it is markup.
std::string in_markup(std::string_view text);

/// JSON that is safe inside a script element.
std::string in_script(std::string json);

/// Indices of the rows to draw: all, or about `most`. Of each stretch, the first and the last row and the extremes of
/// voltage and current are drawn, so that no peak is lost.
std::vector<std::size_t> shown_rows(const measurement::Recording& recording, std::size_t most = 40'000);

/// The result for a person: the state of charge at the end, with its uncertainty.
std::string statement(const replay::ReplayResult& result);

}  // namespace bms::reports
