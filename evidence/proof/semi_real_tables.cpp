#include "proof/semi_real_tables.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "measurement/statistics.hpp"
#include "numerics/calibration_error.hpp"

namespace bms::proof {

namespace {

/// Multiples of the stated detection limit from which a fault must be found, and up to which nothing may be named
/// wrongly: 2 and 0.5, of limits that are rounded.
constexpr double plainly_above = 1.99, plainly_below = 0.51;

using Result = SemiRealResult;
using Which = std::function<bool(const Result&)>;

/// "3 of 12".
std::string share(const std::vector<Result>& results, const Which& counts, const Which& yes) {
  std::size_t of = 0, n = 0;
  for (const Result& r : results) {
    if (!counts(r)) continue;
    ++of;
    n += yes(r) ? 1 : 0;
  }
  return fmt::format("{} of {}", n, of);
}

/// "0.5", "2".
std::string times_text(double over_limit) { return fmt::format("{:.2g}", over_limit); }

std::string hours_of(const std::vector<Result>& results, bool held_out) {
  double hours = 0;
  for (const Result& r : results) hours += r.fault.empty() && r.held_out == held_out ? r.hours : 0;
  return fmt::format("{:.1f} h", hours);
}

nlohmann::ordered_json or_null(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json();
}

/// "94.1 %, 2.1 times": readings within the band, mean of the nulls; the band's half width over the error, median.
std::string bands_of(const std::vector<Result>& results, const Which& counts) {
  double sum = 0;
  std::vector<double> widths;
  for (const Result& r : results) {
    if (!counts(r) || !r.band_within) continue;
    sum += *r.band_within;
    widths.push_back(*r.band_over_error);
  }
  if (widths.empty()) return "-";
  return fmt::format("{:.1f} %, {:.2g} times", 100 * sum / static_cast<double>(widths.size()),
                     measurement::median(widths));
}

/// Of the first causes that are named, of nulls as well: how many are the fault that was put in, and whether their
/// probabilities say so.
nlohmann::ordered_json json_of_probabilities(const std::vector<Result>& results, const Which& counts) {
  numerics::CalibrationError error;
  double sum = 0;
  std::size_t right = 0;
  for (const Result& r : results) {
    if (!counts(r) || !r.probability) continue;
    error.add(*r.probability, r.is_the_fault);
    sum += *r.probability;
    right += r.is_the_fault ? 1 : 0;
  }
  return {{"named", error.count()},
          {"right", right},
          {"mean_probability", error.count() > 0 ? sum / static_cast<double>(error.count()) : 0},
          {"calibration_error", error.error()}};
}

std::string probabilities_of(const std::vector<Result>& results, const Which& counts) {
  const nlohmann::ordered_json j = json_of_probabilities(results, counts);
  if (j["named"] == 0) return "-";
  return fmt::format("{} of {}; {:.2f}; {:.2f}", j["right"].get<int>(), j["named"].get<int>(),
                     j["mean_probability"].get<double>(), j["calibration_error"].get<double>());
}

/// The same figures for each cell. Faults are those of twice their detection limit and above.
std::string by_cell(const std::vector<Result>& results) {
  std::string text =
      "\n| cell | hours | nulls named | faults detected | named first | another name first | size within two sigma | "
      "band |\n|---|---|---|---|---|---|---|---|\n";
  std::vector<std::string> cells;
  for (const Result& r : results) {
    if (std::find(cells.begin(), cells.end(), r.cell) == cells.end()) cells.push_back(r.cell);
  }
  for (const std::string& cell : cells) {
    const Which null = [&](const Result&r) { return r.cell == cell && r.fault.empty(); },
                fault =
                    [&](const Result&r) {
                      return r.cell == cell && !r.fault.empty() && r.over_limit.value_or(0) >= plainly_above;
                    },
                sized = [&](const Result&r) { return r.cell == cell && r.sigmas.has_value(); };
    double hours = 0;
    for (const Result& r : results) hours += null(r) ? r.hours : 0;
    const auto of = std::find_if(results.begin(), results.end(), null);
    const bool held_out = of != results.end() && of->held_out;
    text += fmt::format("| {}{} | {:.1f} | {} | {} | {} | {} | {} | {} |\n", cell, held_out ? "" : " (development)",
                        hours, share(results, null, [](const Result& r) { return r.named; }),
                        share(results, fault, [](const Result& r) { return r.detected; }),
                        share(results, fault, [](const Result& r) { return r.first_right; }),
                        share(results, fault, [](const Result& r) { return r.named && !r.first_right; }),
                        share(results, sized, [](const Result& r) { return std::abs(*r.sigmas) <= 2; }),
                        bands_of(results, null));
  }
  return text;
}

std::size_t count(const std::vector<Result>& results, const Which& which) {
  return static_cast<std::size_t>(std::count_if(results.begin(), results.end(), which));
}

nlohmann::ordered_json json_of_nulls(const std::vector<Result>& results) {
  const auto verdict = [&](std::string_view what) {
    return count(results, [&](const Result& r) { return r.fault.empty() && r.verdict == what; });
  };
  double hours = 0;
  for (const Result& r : results) hours += r.fault.empty() ? r.hours : 0;
  return {{"cases", count(results, [](const Result& r) { return r.fault.empty(); })},
          {"false", count(results, [](const Result& r) { return r.fault.empty() && r.named; })},
          {"hours", hours},
          {"unknown", verdict("UNKNOWN")},
          {"not_testable", verdict("NOT_TESTABLE")},
          {"data_fault", verdict("DATA_FAULT")}};
}

/// Counts of the faults of these sizes.
nlohmann::ordered_json json_of_sizes(const std::vector<Result>& results, bool within_bounds, double low, double high) {
  const auto faults = [&](const Which& yes) {
    return count(results, [&](const Result& r) {
      return !r.fault.empty() && r.over_limit && r.within_bounds == within_bounds && *r.over_limit >= low &&
             *r.over_limit < high && yes(r);
    });
  };
  return {{"cases", faults([](const Result&) { return true; })},
          {"detected", faults([](const Result& r) { return r.detected; })},
          {"first_right", faults([](const Result& r) { return r.first_right; })},
          {"another_first", faults([](const Result& r) { return r.named && !r.first_right; })},
          {"size_compared", faults([](const Result& r) { return r.sigmas.has_value(); })},
          {"size_within_2_sigma", faults([](const Result& r) { return r.sigmas && std::abs(*r.sigmas) <= 2; })}};
}

nlohmann::ordered_json json_of_faults(const std::vector<Result>& results) {
  const double no_end = std::numeric_limits<double>::infinity();
  nlohmann::ordered_json json = json_of_sizes(results, true, plainly_above, no_end);
  json["half_limit"] = json_of_sizes(results, true, 0, plainly_below);
  json["beyond_bounds"] = json_of_sizes(results, false, plainly_above, no_end);
  json["without_limit"] = {{"cases", count(results, [](const Result& r) { return !r.fault.empty() && !r.over_limit; })},
                           {"another_first", count(results, [](const Result& r) {
                              return !r.fault.empty() && !r.over_limit && r.named && !r.first_right;
                            })}};
  return json;
}

}  // namespace

std::string by_size(const std::vector<Result>& results) {
  std::map<double, std::string> sizes;
  for (const Result& r : results) {
    if (!r.fault.empty() && r.over_limit)
      sizes.emplace(std::stod(times_text(*r.over_limit)), times_text(*r.over_limit));
  }
  if (sizes.empty()) return "";
  std::string text =
      "\n| size, in stated limits | bounds of a real instrument | faults | detected | first name right | another name "
      "first | DATA_FAULT | NOT_TESTABLE |\n|---|---|---|---|---|---|---|---|\n";
  for (const auto& size : sizes) {
    const std::string& name = size.second;
    for (const bool within : {true, false}) {
      const Which here = [&](const Result& r) {
        return !r.fault.empty() && r.over_limit && times_text(*r.over_limit) == name && r.within_bounds == within;
      };
      const auto count = [&](const Which& yes) {
        return std::count_if(results.begin(), results.end(), [&](const Result& r) { return here(r) && yes(r); });
      };
      if (count([](const Result&) { return true; }) == 0) continue;
      text += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} |\n", name, within ? "within" : "beyond",
                          count([](const Result&) { return true; }), count([](const Result& r) { return r.detected; }),
                          count([](const Result& r) { return r.first_right; }),
                          count([](const Result& r) { return r.named && !r.first_right; }),
                          count([](const Result& r) { return r.verdict == "DATA_FAULT"; }),
                          count([](const Result& r) { return r.verdict == "NOT_TESTABLE"; }));
    }
  }
  return text;
}

std::string table_of(const std::vector<Result>& results) {
  std::string text = "\n| figure | development cells | held-out cells |\n|---|---|---|\n";
  const auto row = [&](const char* name, const Which& counts, const Which& yes) {
    text += fmt::format("| {} |", name);
    for (const bool held_out : {false, true})
      text += " " +
              share(
                  results, [&](const Result& r) { return r.held_out == held_out && counts(r); }, yes) +
              " |";
    text += "\n";
  };
  const Which healthy = [](const Result&r) { return r.fault.empty(); }, named = [](const Result&r) { return r.named; },
              right = [](const Result&r) { return r.first_right; },
              wrong = [](const Result&r) { return r.named && !r.first_right; };
  const auto verdict = [](std::string_view what) -> Which {
    return [what](const Result& r) { return r.verdict == what; };
  };
  const auto limits = [](double low, double high) -> Which {
    return [=](const Result& r) {
      return !r.fault.empty() && r.over_limit && *r.over_limit >= low && *r.over_limit < high;
    };
  };
  const double no_end = std::numeric_limits<double>::infinity();
  text += fmt::format("| healthy, left out | {} | {} |\n", hours_of(results, false), hours_of(results, true));
  row("a cause is named", healthy, named);
  row("UNKNOWN", healthy, verdict("UNKNOWN"));
  row("not enough healthy data, or not testable", healthy, verdict("NOT_TESTABLE"));
  row("data fault", healthy, verdict("DATA_FAULT"));
  row("fault of twice its detection limit and above: first name right", limits(plainly_above, no_end), right);
  row("the same: detected", limits(plainly_above, no_end), [](const Result& r) { return r.detected; });
  row("the same: another name first", limits(plainly_above, no_end), wrong);
  row("of half to twice the limit: first name right", limits(0.5, plainly_above), right);
  row("of half the limit and below: another name first", limits(0, plainly_below), wrong);
  row(
      "without a limit: another name first", [](const Result& r) { return !r.fault.empty() && !r.over_limit; }, wrong);
  row(
      "size within two of its standard deviations", [](const Result& r) { return r.sigmas.has_value(); },
      [](const Result& r) { return std::abs(*r.sigmas) <= 2; });
  text += "| first cause is the fault put in; mean of its probability; expected calibration error |";
  for (const bool held_out : {false, true})
    text += " " + probabilities_of(results, [&](const Result& r) { return r.held_out == held_out; }) + " |";
  text += "\n| readings within the 95 % band; its half width over the error |";
  for (const bool held_out : {false, true})
    text += " " + bands_of(results, [&](const Result& r) { return r.held_out == held_out; }) + " |";
  text += "\n" + by_cell(results) + by_size(results);
  double slowest_s = 0;
  for (const Result& r : results) slowest_s = std::max(slowest_s, r.wall_s);
  return text + fmt::format("\nSlowest diagnosis: {:.0f} s.\n", slowest_s);
}

std::string json_of(const std::vector<Result>& results, const NotRun& not_run) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Result& r : results) {
    list.push_back({{"set", r.set},
                    {"cell", r.cell},
                    {"kind", r.fault.empty() ? "null" : "fault"},
                    {"fault", r.fault},
                    {"size", r.size},
                    {"held_out", r.held_out},
                    {"verdict", r.verdict},
                    {"found", r.found},
                    {"withheld", r.withheld},
                    {"over_limit", or_null(r.over_limit)},
                    {"within_bounds", r.within_bounds},
                    {"named", r.named},
                    {"detected", r.detected},
                    {"first_right", r.first_right},
                    {"probability", or_null(r.probability)},
                    {"is_the_fault", r.is_the_fault},
                    {"sigmas", or_null(r.sigmas)},
                    {"band_within", or_null(r.band_within)},
                    {"band_over_error", or_null(r.band_over_error)},
                    {"error_v", r.error_v},
                    {"remaining_v", r.remaining_v},
                    {"healthy_error_v", r.healthy_error_v},
                    {"healthy_blocks", r.healthy_blocks},
                    {"covered", r.covered},
                    {"hours", r.hours},
                    {"wall_s", r.wall_s}});
  }
  const nlohmann::ordered_json json = {
      {"nulls", json_of_nulls(results)},
      {"faults", json_of_faults(results)},
      {"probabilities", json_of_probabilities(results, [](const Result&) { return true; })},
      {"skipped", not_run.skipped},
      {"without_cell_file", not_run.without_cell_file},
      {"results", list}};
  return json.dump(1) + "\n";
}

std::string line_of(const SemiRealResult& r) {
  return fmt::format(
      "{:40} {:20} {:<7.3g} {:6}{} {:12} {:6.1f} -> {:6.1f} mV {:6.1f} s  {}{}{}\n", r.set,
      r.fault.empty() ? "(healthy)" : r.fault, r.size, r.over_limit ? times_text(*r.over_limit) + " L" : "-",
      r.within_bounds ? "" : " beyond bounds", r.verdict, 1e3 * r.error_v, 1e3 * r.remaining_v, r.wall_s, r.found,
      r.withheld.empty() ? "" : " | withheld: " + r.withheld,
      r.band_within
          ? fmt::format(" | band {:.1f} %, {:.2g} times the error", 100 * *r.band_within, r.band_over_error.value_or(0))
          : "");
}

}  // namespace bms::proof
