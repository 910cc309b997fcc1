#include "benchmark/tables.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>

#include <fmt/format.h>

#include "benchmark/score.hpp"

namespace bms::benchmark {

namespace {

constexpr const char *nothing = "(nothing)", *outside = "(outside the catalogue)";

std::string text(const Share& s) {
  if (s.of == 0) return "-";
  const Interval i = wilson(s);
  return fmt::format("{} of {}: {:.0f} % ({:.0f}-{:.0f})", s.hits, s.of, 100 * s.value(), 100 * i.low, 100 * i.high);
}

struct Row {
  const char *figure, *required;
  std::string (*cell)(const Score&);
};

// The requirements were set before the benchmark was run; they do not follow from its results.
constexpr std::array rows = {
    Row{"false alarms on nulls", "<= 2 %", [](const Score& s) { return text(s.false_alarms); }},
    Row{"detected at twice the detection limit and above", ">= 95 %", [](const Score& s) { return text(s.detected); }},
    Row{"detected at any strength", "", [](const Score& s) { return text(s.detected_all); }},
    Row{"of these detected: right first", "", [](const Score& s) { return text(s.first); }},
    Row{"right class first", ">= 90 %", [](const Score& s) { return text(s.first_class); }},
    Row{"truth in the reported set", ">= 95 %", [](const Score& s) { return text(s.in_set); }},
    Row{"mean size of a set", "<= 1.6",
        [](const Score& s) {
          return s.first.hits > 0 || s.mean_set_size > 0 ? fmt::format("{:.2f}", s.mean_set_size) : "-";
        }},
    Row{"pairs: both", ">= 70 %", [](const Score& s) { return text(s.pair_both); }},
    Row{"pairs: at least one and none wrong", ">= 90 %", [](const Score& s) { return text(s.pair_one_none_wrong); }},
    Row{"outside the catalogue, at twice the limit and above: UNKNOWN", ">= 70 %",
        [](const Score& s) { return text(s.outside_unknown); }},
    Row{"data faults", "", [](const Score& s) { return text(s.data_fault); }},
    Row{"hold-out at 1.3 times the floor, or 90 % of the error above it removed", ">= 80 %",
        [](const Score& s) { return text(s.holdout); }},
    Row{"ambiguous ones separated by the experiment asked for", ">= 80 %",
        [](const Score& s) { return s.separated.of > 0 ? text(s.separated) : "-"; }},
    Row{"ambiguous ones decided after one experiment; of these right", "",
        [](const Score& s) { return s.decided.of > 0 ? text(s.decided_at_once) + "; " + text(s.right_at_once) : "-"; }},
    Row{"after all that were asked for; of these right", "",
        [](const Score& s) { return s.decided.of > 0 ? text(s.decided) + "; " + text(s.right) : "-"; }},
    Row{"experiments a case; nothing more can be learned", "",
        [](const Score& s) {
          return s.decided.of > 0 ? fmt::format("{:.1f}; {}", s.mean_experiments, text(s.nothing_more)) : "-";
        }},
    Row{"causes that the recording can distinguish from the true one: not confused", ">= 95 %",
        [](const Score& s) { return s.distinguished.of > 0 ? text(s.distinguished) : "-"; }},
    Row{"causes that it cannot: confused", "",
        [](const Score& s) { return s.confused.of > 0 ? text(s.confused) : "-"; }},
    Row{"located in time: intersection over union, median", ">= 0.6",
        [](const Score& s) { return s.detected.hits > 0 ? fmt::format("{:.2f}", s.median_overlap) : "-"; }},
    Row{"expected calibration error of the probabilities", "<= 0.07",
        [](const Score& s) { return s.named > 0 ? fmt::format("{:.2f}", s.calibration_error) : "-"; }},
    Row{"seconds a case", "", [](const Score& s) { return fmt::format("{:.1f}", s.mean_wall_s); }},
};

/// The class of the true effect; an effect outside the catalogue has no class.
std::string truth_of(const truth::Answer& answer) {
  switch (answer.kind) {
    case truth::CaseKind::null:
      return nothing;
    case truth::CaseKind::outside:
      return outside;
    default:
      return class_of(answer.ids.front());
  }
}

std::string named_first(const Outcome& o) {
  if (no_alarm(o)) return nothing;
  if (o.found.empty() || o.verdict == diagnosis::Verdict::unknown) return diagnosis::name_of(o.verdict);
  return class_of(o.found.front());
}

std::string heading(const std::vector<Column>& columns, const std::string& first) {
  std::string line = "| " + first + " |", rule = "|---|";
  for (const Column& c : columns) {
    line += " " + c.method + " |";
    rule += "---|";
  }
  return line + "\n" + rule + "\n";
}

}  // namespace

std::string figures_table(const std::vector<Column>& columns) {
  std::vector<Score> scores;
  for (const Column& c : columns) scores.push_back(score(c.outcomes));
  std::string table = heading(columns, "figure | required");
  table.insert(table.find('\n') + 1, "|---");
  for (const Row& row : rows) {
    table += fmt::format("| {} | {} |", row.figure, row.required);
    for (const Score& s : scores) table += " " + row.cell(s) + " |";
    table += "\n";
  }
  return table;
}

std::string confusion_table(const std::vector<Outcome>& outcomes) {
  std::map<std::string, std::map<std::string, std::size_t>> counts_of;
  for (const Outcome& o : outcomes) {
    const bool strong = o.answer.kind == truth::CaseKind::single && o.answer.strength >= 2;
    if (strong || o.answer.kind == truth::CaseKind::null || o.answer.kind == truth::CaseKind::outside)
      ++counts_of[truth_of(o.answer)][named_first(o)];
  }
  std::string table = "| truth | cases | right | else |\n|---|---|---|---|\n";
  for (const auto& [truth, counts] : counts_of) {
    std::size_t all = 0, right = 0;
    std::vector<std::pair<std::size_t, std::string>> others;
    for (const auto& [name, count] : counts) {
      all += count;
      const bool same = name == truth || (truth == outside && name == diagnosis::name_of(diagnosis::Verdict::unknown));
      if (same)
        right = count;
      else
        others.emplace_back(count, name);
    }
    std::stable_sort(others.begin(), others.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    std::string list;
    for (const auto& [count, name] : others) list += fmt::format("{}{} {}", list.empty() ? "" : ", ", name, count);
    table += fmt::format("| {} | {} | {} | {} |\n", truth, all, right, list);
  }
  return table;
}

std::string detection_table(const std::vector<Column>& columns) {
  struct Bin {
    const char* text;
    double from, to;
  };
  std::string table = heading(columns, "strength");
  // some effects are clearly visible at every amplitude worth reporting
  for (const Bin& bin : {Bin{"below 0.5", 0, 0.5}, Bin{"0.5 to 1", 0.5, 1}, Bin{"1 to 2", 1, 2}, Bin{"2 to 4", 2, 4},
                         Bin{"4 to 8", 4, 8}, Bin{"above 8", 8, 1e300}}) {
    std::string line = fmt::format("| {} |", bin.text);
    std::size_t cases = 0;
    for (const Column& c : columns) {
      Share detected;
      for (const Outcome& o : c.outcomes) {
        if (o.answer.kind == truth::CaseKind::single && o.answer.strength >= bin.from && o.answer.strength < bin.to)
          detected.count(!no_alarm(o));
      }
      cases = std::max(cases, detected.of);
      line += " " + text(detected) + " |";
    }
    if (cases > 0) table += line + "\n";
  }
  return table;
}

std::string report(const std::string& split, std::uint64_t seed, const std::vector<Column>& columns) {
  const std::size_t cases = columns.front().outcomes.size();
  return fmt::format("{} split, seed {}, {} cases. In brackets: Wilson's 95 % interval.\n\n{}\n", split, seed, cases,
                     figures_table(columns)) +
         "Single effects that were detected, by strength in detection limits:\n\n" + detection_table(columns) +
         fmt::format("\nWhat {} named first, by class; single effects at twice the detection limit and above:\n\n",
                     columns.front().method) +
         confusion_table(columns.front().outcomes);
}

}  // namespace bms::benchmark
