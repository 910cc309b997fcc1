// Statements of the paper: no judge says yes without numbers; on the paper's own numbers they say what can be read
// there.
#include "study/statements.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "study/paper_tables.hpp"

namespace bms::study {
namespace {

/// The numbers that the paper prints.
Observations of_paper() {
  Observations o;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    for (std::size_t k = 0; k < models; ++k) o.table4[m][k] = paper_table(4).at(m, k);
  }
  for (std::size_t k = 0; k < models; ++k) {
    ModelObservation m;
    m.estimation_fit = paper_table(5).at(k, 0);
    m.validation_fit = paper_table(5).at(k, 1);
    m.r0_ohm = paper_table(6).at(k, 0);
    m.r1_ohm = paper_table(6).at(k, 1);
    m.c1_f = paper_table(6).at(k, 2);
    o.model[k] = m;
  }
  CrossObservation c;
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    for (std::size_t k = 0; k < paper_experiments; ++k) c.fit[row][k] = paper_table(7).at(row, k);
    for (std::size_t k = 0; k < 3; ++k) {
      c.deviation[row][k] = paper_table(8).at(row, k);
      c.value[row][k] = paper_table(6).at(grey_box_model, k);
    }
    c.output_sd_v[row] = paper_table(8).at(row, 3);
  }
  o.cross = c;
  o.initial_soc = {0.8477, 0.80, 0.2917, 0.40};
  return o;
}

TEST(Statements, AreAtLeastNineteenAndEachHasAJudge) {
  EXPECT_GE(statements().size(), 19U);
  std::set<std::string> ids;
  for (const Statement& s : statements()) {
    EXPECT_TRUE(ids.insert(s.id).second) << s.id;
    EXPECT_NO_THROW(judge(s.id, {})) << s.id;
    EXPECT_FALSE(s.where.empty() || s.text.empty() || s.rule.empty()) << s.id;
  }
  EXPECT_THROW(judge("no_such_statement", {}), std::out_of_range);
}

TEST(Statements, AreNotJudgedWhereNothingRan) {
  Observations nothing;
  nothing.not_run = "nothing ran";
  nothing.no_model.fill("the sampling is uneven");
  for (const Statement& s : statements()) {
    const Verdict verdict = judge(s.id, nothing);
    EXPECT_FALSE(verdict.holds.has_value()) << s.id;
    EXPECT_FALSE(verdict.why.empty()) << s.id;
  }
}

// The grey box alone is not the best of four.
TEST(Statements, ASingleModelIsNotTheBest) {
  Observations only = of_paper();
  for (std::size_t k = 0; k < linear_models; ++k) {
    only.model[k].reset();
    only.no_model[k] = "the sampling is uneven";
    for (auto& row : only.table4) row[k].reset();
  }
  for (const char* id : {"grey_box_best_validation", "sd_fails_linear", "linear_larger_error", "nls_best_tf"}) {
    const Verdict verdict = judge(id, only);
    EXPECT_FALSE(verdict.holds.has_value()) << id;
    EXPECT_THAT(verdict.why, ::testing::HasSubstr("the sampling is uneven")) << id;
  }
}

TEST(Statements, OnThePapersOwnNumbers) {
  const Observations o = of_paper();
  for (const char* id : {"grey_box_best_validation",
                         "hw_best_estimation",
                         "oe_above_tf",
                         "tf_inaccurate",
                         "hw_loses_on_validation",
                         "grey_box_close_to_hw",
                         "nls_best_tf",
                         "nls_best_oe",
                         "lm_best_hw",
                         "nls_best_grey_box",
                         "sd_fails_linear",
                         "grey_box_any_optimiser",
                         "parameters_in_bounds",
                         "diagonal_best",
                         "three_designs_best",
                         "ocv_test_worst",
                         "burst_best",
                         "burst_86",
                         "ocv_smallest_deviation",
                         "ocv_largest_variance",
                         "soc_found_from_ocv_test",
                         "soc_not_found_from_bursts"}) {
    const Verdict verdict = judge(id, o);
    EXPECT_TRUE(verdict.holds.value_or(false)) << id << ": " << verdict.why;
  }
  // R1 differs by a factor of five; R0 and R1 have relative deviations as large as C1
  for (const char* id : {"linear_parameters_close", "c1_largest_deviation"}) EXPECT_EQ(judge(id, o).holds, false) << id;
}

// With other models in their place, the same rule decides; without them it does not.
TEST(Statements, WithoutDelayReplacesTheModels) {
  Observations o = of_paper();
  EXPECT_FALSE(judge("hw_best_estimation_without_delay", o).holds.has_value());
  o.model[2]->estimation_fit = 80;
  o.without_delay = {*o.model[1], *o.model[2], ""};
  EXPECT_EQ(judge("hw_best_estimation_without_delay", o).holds, false);
  o.without_delay.hammerstein_wiener->estimation_fit = 99;
  EXPECT_EQ(judge("hw_best_estimation_without_delay", o).holds, true);
  EXPECT_EQ(judge("hw_best_estimation", o).holds, false);
}

// Brown, Cai and DasGupta, Statistical Science 16 (2001) 101: Wilson's interval.
TEST(Statements, SharesHaveWilsonsInterval) {
  const Share all = share_of(20, 20), none = share_of(0, 20), half = share_of(10, 20), nothing = share_of(0, 0);
  EXPECT_NEAR(all.low, 0.8389, 1e-4);
  EXPECT_NEAR(all.high, 1, 1e-12);
  EXPECT_NEAR(none.high, 0.1611, 1e-4);
  EXPECT_NEAR(half.low, 0.2993, 1e-4);
  EXPECT_NEAR(half.high, 0.7007, 1e-4);
  EXPECT_EQ(nothing.low, 0);
  EXPECT_EQ(nothing.high, 1);
}

}  // namespace
}  // namespace bms::study
