// Each baseline on some cases of the development split, and the tables.
#include "benchmark/baselines.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <set>
#include <string>

#include <gmock/gmock.h>

#include "benchmark/score.hpp"
#include "benchmark/tables.hpp"
#include "files/committed_figures.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "files/toml_table.hpp"

namespace bms::benchmark {
namespace {

using diagnosis::Verdict;
using testing::HasSubstr;
using truth::CaseKind;

constexpr auto split = truth::Split::development;

/// Six nulls, made once; only the first 8,000 rows of each, for speed.
const std::vector<truth::Case>& nulls() {
  static const std::vector<truth::Case> made = [] {
    std::vector<truth::Case> chosen;
    for (std::size_t k = 0; chosen.size() < 6 && k < truth::case_count(split); ++k) {
      truth::Case c = truth::make_case(split, 1, k);
      if (c.answer.kind != CaseKind::null) continue;
      for (auto* column : {&c.recording.time_s, &c.recording.current_a, &c.recording.voltage_v,
                           &c.recording.temperature_c, &c.recording.soc})
        column->resize(std::min<std::size_t>(column->size(), 8'000));
      chosen.push_back(std::move(c));
    }
    return chosen;
  }();
  return made;
}

/// A plain large resistance growth.
const truth::Case& grown() {
  static const truth::Case made = truth::make_case(split, 1, 39);
  EXPECT_EQ(made.answer.ids, std::vector<std::string>{"resistance_growth"});
  EXPECT_GT(made.answer.strength, 4);
  return made;
}

TEST(Baselines, AWhiteLikelihoodFindsCausesInHealthyCells) {
  std::size_t named = 0;
  for (const truth::Case& c : nulls()) {
    const Outcome o = aicc_forward(c);
    named += o.found.empty() ? 0 : 1;
    EXPECT_EQ(o.answer.kind, CaseKind::null);
    EXPECT_LE(o.found.size(), 5U);
    EXPECT_EQ(o.found.size(), o.sets.size());
  }
  EXPECT_GE(named, 4U);
}

TEST(Baselines, TheFrozenModelDetectsALargeEffectAndNamesNoCause) {
  const Outcome o = frozen_model(grown());
  EXPECT_EQ(o.verdict, Verdict::unknown);
  EXPECT_TRUE(o.found.empty());
  EXPECT_EQ(o.holdout_before_v, o.holdout_after_v);
  EXPECT_GT(o.holdout_floor_v, 0);
  std::size_t alarms = 0;
  for (const truth::Case& c : nulls()) alarms += frozen_model(c).verdict != Verdict::no_mismatch ? 1 : 0;
  EXPECT_LE(alarms, 2U);
}

TEST(Baselines, AFreeRefitMovesALargeResistanceGrowthIntoItsTablesAndPredictsTheHoldout) {
  const Outcome within_tolerance = base_refit(grown()), o = free_refit(grown());
  EXPECT_TRUE(o.found.empty());
  EXPECT_LT(o.holdout_after_v, 0.6 * o.holdout_before_v);
  EXPECT_GT(within_tolerance.holdout_after_v, o.holdout_after_v) << "the tolerance limits the fit";
}

TEST(Baselines, TheNearestSignatureOfAPlainLargeResistanceIsAResistance) {
  const Outcome o = nearest_signature(grown());
  ASSERT_EQ(o.verdict, Verdict::cause);
  EXPECT_EQ(o.found, std::vector<std::string>{"resistance_growth"});
  EXPECT_LT(o.holdout_after_v, 0.6 * o.holdout_before_v);
  for (const truth::Case& c : nulls()) {
    EXPECT_EQ(nearest_signature(c).verdict == Verdict::no_mismatch, frozen_model(c).verdict == Verdict::no_mismatch)
        << "both use the same threshold";
  }
}

TEST(Tables, AWilsonIntervalAgreesWithPublishedTables) {
  const Interval none = wilson({0, 36});  // 0 of 36: 0 to 9.6 % (tables of binomial intervals)
  EXPECT_EQ(none.low, 0);
  EXPECT_NEAR(none.high, 0.0964, 5e-4);
  const Interval half = wilson({50, 100});
  EXPECT_NEAR(half.low, 0.4038, 5e-4);
  EXPECT_NEAR(half.high, 0.5962, 5e-4);
  EXPECT_EQ(wilson({0, 0}).high, 1);
}

Outcome outcome(CaseKind kind, const std::vector<std::string>& ids, double strength, Verdict verdict,
                const std::vector<std::string>& found) {
  Outcome o;
  o.answer.kind = kind;
  o.answer.ids = ids;
  o.answer.strength = strength;
  o.verdict = verdict;
  o.found = found;
  for (const std::string& id : found) o.sets.push_back({id});
  o.probability = 1;
  return o;
}

TEST(Tables, EveryMethodHasAColumnAndEveryConfusionARow) {
  const std::vector<Outcome> ours = {
      outcome(CaseKind::null, {}, 0, Verdict::no_mismatch, {}),
      outcome(CaseKind::single, {"leakage"}, 3, Verdict::cause, {"current_offset"}),
      outcome(CaseKind::single, {"resistance_growth"}, 5, Verdict::cause, {"contact_step"}),
      outcome(CaseKind::outside, {"memory_bump"}, 3, Verdict::unknown, {})};
  std::vector<Outcome> theirs = ours;
  theirs[0].verdict = Verdict::unknown;
  const std::string text = report("development", 7, {{"ours", ours}, {"theirs", theirs}});
  EXPECT_THAT(text, HasSubstr("development split, seed 7, 4 cases"));
  EXPECT_THAT(text, HasSubstr("| false alarms on healthy recordings | 0 of 1: 0 % (0-79) | 1 of 1: 100 % (21-100) |"));
  EXPECT_THAT(text, HasSubstr("| right class first | 1 of 2: 50 %"));
  EXPECT_THAT(text, HasSubstr("| 2 to 4 | 1 of 1")) << "detection by strength";
  EXPECT_THAT(text, HasSubstr("| resistance_growth | 1 | 0 | contact_step 1 |"));
  EXPECT_THAT(text, HasSubstr("| current_offset | 1 | 1 |  |")) << "leakage is of its class";
  EXPECT_THAT(text, HasSubstr("| (outside the catalogue) | 1 | 1 |  |"));
}

TEST(Tables, EveryTargetOfConcealedCasesIsAFigureThatIsMeasured) {
  Score all;
  for (Share Score::*const share : {&Score::false_alarms, &Score::detected, &Score::first, &Score::first_class,
                                    &Score::in_set, &Score::pair_both, &Score::pair_one_none_wrong,
                                    &Score::outside_unknown, &Score::holdout, &Score::separated, &Score::distinguished})
    all.*share = {1, 1};
  all.named = 1;
  std::set<std::string> names;
  for (const Figure& f : figures_of(all)) names.insert(f.name);
  const std::string path = BMS_SOURCE_DIR "/evidence/benchmark/targets.toml";
  files::TomlTable targets = files::TomlTable::parse(files::read_file(path), path, "targets");
  std::size_t checked = 0;
  for (files::TomlTable& t : targets.tables("target")) {
    const std::string name = t.text("name");
    if (name.starts_with("real: ") || name.starts_with("law ") || name.find("learned term") != std::string::npos)
      continue;  // semi_real, natural and outside measure them
    EXPECT_TRUE(names.contains(name)) << name;
    ++checked;
  }
  EXPECT_EQ(checked, 14U);
}

TEST(Tables, AmbiguousDiagnosesCountByHowTheirExperimentsEnd) {
  Round open{
      .profile = "shunt_check", .verdict = diagnosis::Verdict::ambiguous, .sets = {{"leakage", "current_offset"}}},
      found{.profile = "full_cycle", .verdict = diagnosis::Verdict::cause, .sets = {{"leakage"}}};
  std::vector<Outcome> outcomes(5);  // right by the second; wrong at once; stuck; right at once; not ambiguous
  outcomes[0].next = {.rounds = {open, found}, .decided = true, .right = true};
  outcomes[1].next = {.rounds = {found}, .decided_at_once = true, .decided = true};
  outcomes[2].next = {.rounds = {open}, .nothing_more = true};
  outcomes[3].next = {
      .rounds = {found}, .decided_at_once = true, .right_at_once = true, .decided = true, .right = true};
  const Score s = score(outcomes);
  EXPECT_EQ(s.decided_at_once.hits, 2U);
  EXPECT_EQ(s.right_at_once.hits, 1U);
  EXPECT_EQ(s.decided.hits, 3U);
  EXPECT_EQ(s.decided.of, 4U);
  EXPECT_EQ(s.right.hits, 2U);
  EXPECT_EQ(s.right.of, 3U);
  EXPECT_EQ(s.nothing_more.hits, 1U);
  EXPECT_NEAR(s.mean_experiments, 5.0 / 4, 1e-12);
  EXPECT_STREQ(end_of(*outcomes[0].next), "right");
  EXPECT_STREQ(end_of(*outcomes[1].next), "WRONG");
  EXPECT_STREQ(end_of(*outcomes[2].next), "nothing more can be learned");
  EXPECT_STREQ(end_of({}), "no experiment");
}

TEST(Tables, AReadmeKeepsTheTextAroundTheTables) {
  const files::TemporaryFolder folder;
  const std::filesystem::path readme = folder.path() / "README.md";
  const std::string before = "# x\n<!-- figures: development -->\n",
                    after = "<!-- end of figures -->\n<!-- figures: final -->\nNot run yet.\n<!-- end of figures -->\n";
  files::write_file(readme, before + "old\n" + after);
  const std::string text =
      report("development", 1, {{"ours", {outcome(CaseKind::null, {}, 0, Verdict::no_mismatch, {})}}});
  for (int times = 0; times < 2; ++times) {
    files::replace_figures(readme, "development", text);
    EXPECT_EQ(files::read_file(readme), before + text + after);
  }
  EXPECT_THROW(files::replace_figures(readme, "validation", text), std::runtime_error);
}

}  // namespace
}  // namespace bms::benchmark
