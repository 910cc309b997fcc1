#include "benchmark/law_score.hpp"

#include <cmath>
#include <map>

#include <fmt/format.h>

#include "benchmark/cause_ids.hpp"
#include "measurement/statistics.hpp"

namespace bms::benchmark {

namespace {

constexpr double half = 0.5;

double above_v(double error_v, double floor_v) {
  return std::sqrt(std::max(0.0, error_v * error_v - floor_v * floor_v));
}

std::string text(const Share& s) {
  if (s.of == 0) return "-";
  const Interval i = wilson(s);
  return fmt::format("{} of {}: {:.0f} % ({:.0f}-{:.0f})", s.hits, s.of, 100 * s.value(), 100 * i.low, 100 * i.high);
}

std::string short_text(const Share& s) { return s.of == 0 ? "-" : fmt::format("{} of {}", s.hits, s.of); }

std::string millivolts(std::vector<double> values_v) {
  return values_v.empty() ? "-" : fmt::format("{:.1f}", 1e3 * measurement::upper_median(std::move(values_v)));
}

std::string row_of(const std::string& effect, const LawScore& s, std::string (*share)(const Share&)) {
  return fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", effect, s.cases, s.nothing, s.cause,
                     s.no_law, share(s.law), share(s.of_named), millivolts(s.frozen_v), millivolts(s.after_v),
                     share(s.cut), share(s.cut_with_term));
}

}  // namespace

bool shows_in_holdout(const Outcome& o) { return o.answer.holdout_effect_rms_v >= o.holdout_floor_v; }

bool cuts_holdout(const Outcome& o) {
  return above_v(o.holdout_after_v, o.holdout_floor_v) <= half * above_v(o.holdout_before_v, o.holdout_floor_v);
}

bool names_right_law(const Outcome& o) { return !o.law.empty() && contains(o.answer.laws, o.law); }

LawScore law_score(const std::vector<Outcome>& outcomes) {
  LawScore s;
  for (const Outcome& o : outcomes) {
    ++s.cases;
    if (no_alarm(o)) ++s.nothing;
    if (diagnosis::names(o.verdict)) ++s.cause;
    if (o.verdict == diagnosis::Verdict::unknown && o.law.empty()) ++s.no_law;
    s.law.count(names_right_law(o));
    if (!o.law.empty()) s.of_named.count(names_right_law(o));
    if (!shows_in_holdout(o)) continue;
    s.cut.count(cuts_holdout(o));
    s.plain_cut.count(o.holdout_after_v <= half * o.holdout_before_v);
    if (o.has_term) s.cut_with_term.count(cuts_holdout(o));
    s.frozen_v.push_back(o.holdout_before_v);
    s.after_v.push_back(o.holdout_after_v);
  }
  return s;
}

std::string law_table(const std::vector<Outcome>& outcomes) {
  std::map<std::string, std::vector<Outcome>> by_effect;
  for (const Outcome& o : outcomes) by_effect[o.answer.ids.front()].push_back(o);
  std::string table =
      "| effect | cases | nothing found | a cause named | UNKNOWN without a law | right law | of the laws named | "
      "hold-out [mV], file alone | with the answer | error above the floor halved | of those with a term |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const auto& [effect, some] : by_effect) table += row_of(effect, law_score(some), short_text);
  const LawScore all = law_score(outcomes);
  return table + row_of("all", all, text) +
         fmt::format("\nThe whole hold-out error halved, floor included: {}.\n", text(all.plain_cut));
}

}  // namespace bms::benchmark
