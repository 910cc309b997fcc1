// The diagnosis of the paper on figures of a cell whose physics is known, and the published figures next to each other.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "files/cell_file.hpp"
#include "study/diagnose_paper.hpp"
#include "study/paper_consistency.hpp"
#include "study/paper_fit.hpp"

namespace bms::study {
namespace {

/// "Published" figures of a cell that no candidate is exactly: other resistances, other noise, and figures that scatter
/// by 15 %, as those of the paper scatter around every candidate.
std::vector<Figure> figures_of_another(double half_gap_v, double slow_ohm, double scatter = 0.15) {
  PaperCandidate c;
  c.bench.r0_factor = 1.03;
  c.bench.r1_factor = 0.95;
  c.bench.left_out = {.half_gap_v = half_gap_v, .decay = 40, .slow_ohm = slow_ohm, .slow_s = 150};
  c.bench.start_branch = -1;
  c.bench.ocv_step_s = 5;
  c.bench.ocv_c_rate = 0.7;
  c.pulses = {.pulse_s = 16, .pulse_c_rate = 0.8, .high_c_rate = 0.5, .swing = 1.4, .duration_s = 1'000};
  c.ocv_half_window = 0.36;
  c.seed = 100;
  PaperRuns runs;
  std::vector<Figure> figures = figures_of(files::read_cell("table9").parameters, c, runs);
  std::mt19937_64 random(1);
  for (Figure& f : figures) {
    double normal = -6;  // of twelve uniform values, the same on every machine
    for (int k = 0; k < 12; ++k) normal += static_cast<double>(random() >> 11) * 0x1p-53;
    const double factor = std::exp(scatter * normal);
    f.value = f.is_fit ? 100 - factor * (100 - f.value) : factor * f.value;
  }
  return figures;
}

PaperDiagnosis diagnosed(std::vector<Figure> published, std::vector<Effects> candidates) {
  PaperDiagnosisOptions options;
  options.published = std::move(published);
  options.candidates = std::move(candidates);
  options.iterations = 4;
  options.hold_out = false;
  return diagnose_paper(files::read_cell("table9").parameters, options);
}

constexpr Effects none, hysteresis{true, false, false, false}, slow{false, true, false, false};

double value_of(const PaperDiagnosis& d, const std::string& id) {
  for (const PaperPhysics& p : d.physics) {
    if (p.id == id) return p.value;
  }
  return 0;
}

TEST(PaperDiagnosis, FindsAPlantedSlowPolarisation) {
  const PaperDiagnosis d = diagnosed(figures_of_another(0, 0.010), {slow, none});
  const CandidateFit& best = d.candidates.front();
  EXPECT_TRUE(best.effects.slow_polarisation) << best.effects.name();
  EXPECT_EQ(d.effects.front().present, true) << d.statement;
  EXPECT_GT(best.table7.rank_correlation, d.plain.table7.rank_correlation);
  EXPECT_NEAR(value_of(d, "slow_resistance_ohm"), 0.010, 0.004);
  EXPECT_NEAR(std::log(value_of(d, "slow_time_constant_s") / 150), 0, std::log(2));
}

TEST(PaperDiagnosis, FindsAPlantedHysteresis) {
  const PaperDiagnosis d = diagnosed(figures_of_another(0.012, 0), {hysteresis, none});
  EXPECT_TRUE(d.candidates.front().effects.hysteresis);
  EXPECT_EQ(d.effects.front().present, true) << d.statement;
  EXPECT_NEAR(value_of(d, "half_gap_v"), 0.012, 0.004);
}

TEST(PaperDiagnosis, FindsNothingWhereNothingIsPlanted) {
  const PaperDiagnosis d = diagnosed(figures_of_another(0, 0), {hysteresis, none});
  EXPECT_FALSE(d.candidates.front().effects.hysteresis) << value_of(d, "half_gap_v");
  EXPECT_NE(d.effects.front().present, true);
  for (const TableMisfit& m : d.misfits) EXPECT_FALSE(m.contradicts()) << m.table << " " << m.used;
}

TEST(PaperDiagnosis, NamesTheTableThatNoCellReconciles) {
  std::vector<Figure> published = figures_of_another(0, 0);
  for (Figure& f : published) {
    if (f.group == FigureGroup::appendix_a) f.value *= f.name == "r1_ohm" ? 1.0 / 8 : 8;
  }
  const PaperDiagnosis d = diagnosed(std::move(published), {none});
  for (const TableMisfit& m : d.misfits)
    EXPECT_EQ(m.contradicts(), m.table == "Appendix A") << m.table << " " << m.used;
  EXPECT_NE(d.statement.find("contradicts Appendix A"), std::string::npos) << d.statement;
}

TEST(TableMisfits, SayWhichTableOnlyItselfDetermines) {
  const std::vector<Figure> published = published_figures();
  std::vector<std::vector<Figure>> left_out(1, published);
  for (Figure& f : left_out.front()) {
    if (f.group == FigureGroup::table7) f.value = 100 - 2 * (100 - f.value);
  }
  const std::vector<TableMisfit> misfits = table_misfits(published, left_out, published);
  EXPECT_FALSE(misfits.front().contradicts());
  EXPECT_FALSE(misfits.front().predicted());
  EXPECT_TRUE(misfits.back().predicted());
  EXPECT_EQ(reconciliation_text(misfits),
            "No table contradicts this cell as a whole. The other tables do not predict Table 7.");
}

// Figures without scatter: other resistances look like a small hysteresis.
TEST(PaperDiagnosis, NamesNoHysteresisThatOtherResistancesImitate) {
  const PaperDiagnosis d = diagnosed(figures_of_another(0, 0, 0), {hysteresis, none});
  ASSERT_EQ(d.effects.size(), 1U);
  EXPECT_EQ(d.effects.front().effect, "hysteresis");
  EXPECT_NE(d.effects.front().present, true) << d.statement;
}

// Candidates that differ in one unknown share what it does not change, and nothing else.
TEST(PaperFit, SharedRunsGiveTheSameFigures) {
  const PaperFit fit(files::read_cell("table9").parameters, {true, true, false, false}, published_figures());
  PaperRuns shared;
  const Eigen::VectorXd start = fit.start();
  const std::vector<Figure> first = fit.simulate(start, shared);
  for (Eigen::Index k = 0; k < start.size(); ++k) {
    Eigen::VectorXd moved = start;
    moved[k] -= 0.05;
    const std::vector<Figure> with = fit.simulate(moved, shared), alone = fit.simulate(moved);
    std::size_t changed = 0;
    for (std::size_t f = 0; f < alone.size(); ++f) {
      EXPECT_EQ(with[f].value, alone[f].value) << fit.unknowns()[static_cast<std::size_t>(k)].id << ": " << f;
      changed += alone[f].value != first[f].value ? 1U : 0U;
    }
    EXPECT_GT(changed, 0U) << fit.unknowns()[static_cast<std::size_t>(k)].id;
  }
}

TEST(PaperConsistency, FollowsFromThePublishedFigures) {
  const auto sd = published_voltage_sd_v();
  EXPECT_NEAR(sd[0], 0.002743 / 0.0691, 1e-6);
  EXPECT_NEAR(sd[6], 0.0888, 1e-4);
  std::size_t diagonal = 0;
  for (const Inconsistency& i : inconsistencies()) {
    EXPECT_FALSE(i.observed.empty() || i.meaning.empty()) << i.figures;
    diagonal += i.figures.starts_with("Table 7, column") ? 1U : 0U;
  }
  EXPECT_EQ(diagonal, 2U);  // 90.30 < 91.63 and 83.52 < 86.71
}

}  // namespace
}  // namespace bms::study
