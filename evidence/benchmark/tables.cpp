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

/// A line of the table: a share, a number, or a text of several. Names are those of targets.toml where it has one.
struct Row {
  const char* figure;
  Share Score::*share = nullptr;
  double Score::*value = nullptr;
  bool (*is_known)(const Score&) = nullptr;  ///< of a value: there were cases
  std::string (*several)(const Score&) = nullptr;
};

bool has_sets(const Score& s) { return s.first.hits > 0 || s.mean_set_size > 0; }
bool has_detected(const Score& s) { return s.detected.hits > 0; }
bool has_named(const Score& s) { return s.named > 0; }
bool has_experiments(const Score& s) { return s.decided.of > 0; }

std::string at_once(const Score& s) {
  return has_experiments(s) ? text(s.decided_at_once) + "; " + text(s.right_at_once) : "-";
}
std::string in_the_end(const Score& s) { return has_experiments(s) ? text(s.decided) + "; " + text(s.right) : "-"; }
std::string experiments(const Score& s) {
  return has_experiments(s) ? fmt::format("{:.1f}; {}", s.mean_experiments, text(s.nothing_more)) : "-";
}

constexpr std::array rows = {
    Row{"false alarms on healthy recordings", &Score::false_alarms},
    Row{"detected at twice the detection limit and above", &Score::detected},
    Row{"detected at any strength", &Score::detected_all},
    Row{"right first", &Score::first},
    Row{"right class first", &Score::first_class},
    Row{"truth in the reported set", &Score::in_set},
    Row{"mean size of a set", nullptr, &Score::mean_set_size, has_sets},
    Row{"pairs: both", &Score::pair_both},
    Row{"pairs: at least one and none wrong", &Score::pair_one_none_wrong},
    Row{"outside the catalogue: UNKNOWN", &Score::outside_unknown},
    Row{"data faults", &Score::data_fault},
    Row{"hold-out at 1.3 times the floor, or 90 % of the error above it removed", &Score::holdout},
    Row{"separated by one experiment", &Score::separated},
    Row{"ambiguous ones decided after one experiment; of these right", nullptr, nullptr, nullptr, at_once},
    Row{"after all that were asked for; of these right", nullptr, nullptr, nullptr, in_the_end},
    Row{"experiments a case; nothing more can be learned", nullptr, nullptr, nullptr, experiments},
    Row{"separable causes not confused", &Score::distinguished},
    Row{"inseparable causes: confused", &Score::confused},
    Row{"location in time: intersection over union, median", nullptr, &Score::median_overlap, has_detected},
    Row{"expected calibration error of the probabilities", nullptr, &Score::calibration_error, has_named},
};

std::string cell_of(const Row& row, const Score& s) {
  if (row.share != nullptr) return text(s.*row.share);
  if (row.value != nullptr) return row.is_known(s) ? fmt::format("{:.2f}", s.*row.value) : "-";
  return row.several(s);
}

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
  std::string table = heading(columns, "figure");
  const auto line = [&](const char* figure, const auto& cell) {
    table += fmt::format("| {} |", figure);
    for (const Score& s : scores) table += " " + cell(s) + " |";
    table += "\n";
  };
  for (const Row& row : rows) line(row.figure, [&](const Score& s) { return cell_of(row, s); });
  line("seconds a case", [](const Score& s) { return fmt::format("{:.1f}", s.mean_wall_s); });
  return table;
}

std::vector<Figure> figures_of(const Score& s) {
  std::vector<Figure> figures;
  for (const Row& row : rows) {
    if (row.share != nullptr && (s.*row.share).of > 0) figures.push_back({row.figure, s.*row.share, {}});
    if (row.value != nullptr && row.is_known(s)) figures.push_back({row.figure, {}, s.*row.value});
  }
  return figures;
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
