// What the page of a depot and the terminal say of a cell: findings, limits, recordings that could not be read.
#pragma once

#include <string>
#include <vector>

#include "fleet/analysis.hpp"

namespace bms::reports {

struct CauseText {
  std::string name, meaning, action;
};
/// cause: id of a mechanism, "unknown" or "data_fault".
CauseText cause_text(const std::string& cause);

/// Without dates: the number of the recording.
std::string date_of(const fleet::History& history, double day);

/// "Truck T3, cell 2".
std::string place_of(const std::string& truck, const std::string& cell_index);

/// One line for an issue: where, what, in how many recordings and since when.
std::string statement(const fleet::History& history, const fleet::Issue& issue);

/// Sentences: in how many recordings, how large, and how often a healthy cell looks like this. What is not confirmed
/// has two errors that a reader must not mix up: that of its size, and the chance of a false alarm.
std::string why(const fleet::History& history, const fleet::Issue& issue);

std::string crossing_text(const fleet::History& history, const fleet::Crossing& crossing);

/// A sentence for each cell whose resistance or capacity is named in an issue or has a forecast: when the limit is
/// reached, or why that cannot be said.
std::vector<std::string> limit_sentences(const fleet::History& history, const fleet::Analysis& analysis,
                                         const fleet::AnalysisOptions& options);

/// The reason of a recording's error, without the path that the reader has before him.
std::string reason_of(const fleet::Entry& entry);

/// What bms fleet report prints: each place with a finding, each limit, each recording that could not be read.
std::string summary(const fleet::History& history, const fleet::Analysis& analysis,
                    const fleet::AnalysisOptions& options);

}  // namespace bms::reports
