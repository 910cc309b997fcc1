#include "replay/judgement.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>

namespace bms::replay {

namespace {

constexpr double soc_margin = 1e-3;          ///< to the ends of the estimator's range, where nothing is known
constexpr double most_at_the_end = 0.1;      ///< share of the estimates that may be at the end of the range
constexpr double most_rejected = 0.1;        ///< share of the voltages that the filter may reject
constexpr double fewest_voltages = 0.5;      ///< share of the samples whose voltage can be used
constexpr double unknown_soc_sigma = 0.289;  ///< of a state of charge anywhere between 0 and 1: 1 / sqrt(12)

constexpr std::uint32_t voltage_unusable =
    estimator::voltage_missing | estimator::voltage_implausible | estimator::voltage_stuck;

/// Warnings of a recording that explain an impossible estimate, the most likely first.
constexpr std::array<std::string_view, 5> causes = {"time_in_ms", "current_in_ma", "voltage_in_mv", "current_inverted",
                                                    "charge_exceeds_capacity"};
/// Those that make every estimate doubtful.
constexpr std::array<std::string_view, 4> severe = {"time_in_ms", "current_in_ma", "voltage_in_mv", "current_inverted"};

bool at_the_end(const EstimateRow& e) {
  return e.soc < model::min_soc + soc_margin || e.soc > model::max_soc - soc_margin;
}

std::string likely_cause(const ReplayResult& result) {
  for (const std::string_view id : causes) {
    for (const measurement::Warning& w : result.recording.warnings) {
      if (w.id == id) return w.text;
    }
  }
  return result.prior ? "the initial state of charge or the cell file does not fit the recording"
                      : "the cell file does not fit the recording";
}

void check_numbers(const Estimates& rows) {
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const EstimateRow e = rows[k];
    if (!std::isfinite(e.soc) || !std::isfinite(e.soc_sigma))
      throw std::runtime_error(fmt::format("the estimate is not a number from sample {} on", k + 1));
  }
}

std::size_t count(const Estimates& rows, std::uint32_t flags) {
  std::size_t found = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) found += (rows.flags(k) & flags) != 0;
  return found;
}

/// The filter does not follow a charge that the cell cannot hold: it estimates the state of charge again. Two witnesses
/// are enough: the voltages contradict the count, and the count moves more than the capacity.
bool contradicts_the_count(const ReplayResult& result) {
  const std::vector<measurement::Warning>& warnings = result.recording.warnings;
  return count(result.track.rows, estimator::soc_contradicted | estimator::voltage_rejected) > 0 &&
         std::any_of(warnings.begin(), warnings.end(),
                     [](const measurement::Warning& w) { return w.id == "charge_exceeds_capacity"; });
}

std::vector<std::string> doubts_of(const ReplayResult& result) {
  std::vector<std::string> doubts;
  for (const measurement::Warning& w : result.recording.warnings) {
    if (std::find(severe.begin(), severe.end(), w.id) != severe.end()) doubts.push_back(w.text);
  }
  const Estimates& rows = result.track.rows;
  const std::size_t used = rows.size() - count(rows, voltage_unusable);
  const std::size_t rejected = count(rows, estimator::voltage_rejected);
  if (static_cast<double>(used) < fewest_voltages * static_cast<double>(rows.size()))
    doubts.push_back(fmt::format("only {} of {} voltages can be used", used, rows.size()));
  if (static_cast<double>(rejected) > most_rejected * static_cast<double>(used))
    doubts.push_back(fmt::format("{} of {} voltages contradict the cell file", rejected, used));
  if (rows.back().soc_sigma > unknown_soc_sigma) doubts.emplace_back("the state of charge is not known at all");
  return doubts;
}

}  // namespace

Judgement judge(const ReplayResult& result) {
  const Estimates& rows = result.track.rows;
  check_numbers(rows);
  Judgement judgement;
  const auto outside = static_cast<double>(std::ranges::count_if(rows, at_the_end));
  if (at_the_end(rows.back()) || outside > most_at_the_end * static_cast<double>(rows.size())) {
    judgement.impossible =
        fmt::format("the state of charge leaves {:g} to {:g} % ({:.1f} % at the end); likely cause: {}",
                    100 * model::min_soc, 100 * model::max_soc, 100 * rows.back().soc, likely_cause(result));
  } else if (contradicts_the_count(result)) {
    judgement.impossible =
        fmt::format("the voltages contradict the counted charge; likely cause: {}", likely_cause(result));
  }
  judgement.doubts = doubts_of(result);
  return judgement;
}

}  // namespace bms::replay
