// Numbers of the decision from the environment variable BMS_THRESHOLDS, before anything is diagnosed:
// "faint=0,in_one_place=1e9". An unknown name or an invalid value ends the program with 2.
#include <array>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "diagnosis/law_thresholds.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"

namespace {

using bms::diagnosis::law_thresholds;
using bms::diagnosis::numerics;
using bms::diagnosis::thresholds;

struct Number {
  std::string_view name;
  std::function<void(double)> set;
};

Number number(std::string_view name, double& value) {
  return {name, [&value](double given) { value = given; }};
}

std::array<Number, 37> numbers() {
  auto& d = thresholds.decision;
  auto& a = thresholds.adequacy;
  auto& p = thresholds.probability;
  auto& h = thresholds.healthy;
  return {{
      number("detected", d.detected),
      number("per_unknown", d.per_unknown),
      number("per_burst", d.per_burst),
      number("hopeless", d.hopeless),
      number("tie", d.tie),
      number("inseparable", d.inseparable),
      number("tie_inseparable", d.tie_inseparable),
      number("better_start", d.better_start),
      number("better_rival", d.better_rival),
      number("faint", d.faint),
      number("noticeable", d.noticeable),
      number("noticeable_gain", d.noticeable_gain),
      number("contact_wander", d.contact_wander),
      number("end_share", d.end_share),
      number("own_sigmas", d.own_sigmas),
      number("capacity_lost_alone", d.capacity_lost_alone),
      number("stages_closer", d.stages_closer),
      number("slides_apart_soc", d.slides_apart_soc),
      number("trades", d.trades),
      number("in_one_place", d.in_one_place),
      number("gross_v", d.gross_v),
      number("error_may_grow", d.error_may_grow),
      number("explained", a.explained),
      number("explained_by_bursts", a.explained_by_bursts),
      number("unexplained", a.unexplained),
      number("far_out", a.far_out),
      number("temper", p.temper),
      number("at_most", p.at_most),
      number("log_spread", h.log_spread),
      number("spread_counts", h.spread_counts),
      number("log_spread_beyond", h.log_spread_beyond),
      number("covered_at_least", h.covered_at_least),
      number("learned_within", h.learned_within),
      number("gross_times", h.gross_times),
      {"few_causes", [](double given) { law_thresholds.law.few_causes = static_cast<std::size_t>(given); }},
      {"elimination_rounds", [](double given) { numerics.search.elimination_rounds = static_cast<int>(given); }},
      {"elimination_resumed", [](double given) { numerics.search.elimination_resumed = static_cast<int>(given); }},
  }};
}

bool set(std::string_view assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos) return false;
  const std::string text(assignment.substr(equals + 1));
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0') return false;
  for (const Number& n : numbers()) {
    if (n.name != assignment.substr(0, equals)) continue;
    n.set(value);
    return true;
  }
  return false;
}

[[maybe_unused]] const bool read = [] {
  const char* given = std::getenv("BMS_THRESHOLDS");
  std::string_view rest = given == nullptr ? "" : given;
  while (!rest.empty()) {
    const std::string_view assignment = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(assignment.size() + 1, rest.size()));
    if (set(assignment)) continue;
    fmt::print(stderr, "BMS_THRESHOLDS: unknown name or invalid number: {}\n", assignment);
    std::exit(2);
  }
  return true;
}();

}  // namespace
