#include "diagnosis/hypothesis.hpp"

#include <gmock/gmock.h>

#include "tests/diagnosis/evidence.hpp"

namespace bms::diagnosis {
namespace {

/// Table 9's lines meet within a millivolt; a derivative does not see such a step, a difference does.
model::CellParameters<> without_steps(model::CellParameters<> cell) {
  for (std::size_t k = 1; k < cell.ocv.b0_v.size; ++k) {
    cell.ocv.b0_v[k] = cell.ocv.b0_v[k - 1] + (cell.ocv.b1_v[k - 1] - cell.ocv.b1_v[k]) * cell.ocv.soc[k];
  }
  return cell;
}

Evidence plant_evidence(std::uint64_t seed = 1) {
  Record r = test::recorded(test::drive(1, seed), 0.7, seed);
  r.temperature_c.assign(r.size(), 15.0);
  for (std::size_t k = 0; k < r.size(); ++k) r.temperature_c[k] += 10.0 * static_cast<double>(k) / static_cast<double>(r.size());
  return {without_steps(test::table9()), {}, {r}, NoiseModel{}};
}

/// Every parameter of every mechanism: what the dual numbers say and what a small change does.
TEST(Hypothesis, DerivativesAreThoseOfTheSimulation) {
  const Evidence evidence = plant_evidence();
  const double ah = evidence.cell().capacity_ah;
  const Eigen::VectorXd u = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(evidence.calibration().size()), 0.3);
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const model::MechanismInfo& info = model::catalogue[m];
    if (info.id == "contact_intermittent") continue;
    Hypothesis h = with(evidence.base(), m, ah);
    for (std::size_t p = 0; p < info.parameters; ++p) {
      const model::Parameter& parameter = info.parameter[p];
      if (parameter.role == model::Role::strength) h.settings.back().value[p] = 0.07 * parameter.upper(ah);
      if (parameter.role == model::Role::place) h.settings.back().value[p] = 0.3 * parameter.upper(ah);
      if (parameter.name == "limit_a") h.settings.back().value[p] = 10;
    }
    const std::vector<Sought> sought = h.sought();
    const Columns exact = evidence.derivatives(h, u, sought);
    for (std::size_t j = 0; j < sought.size(); ++j) {
      const model::Parameter& parameter = info.parameter[sought[j].parameter];
      const double step = 1e-7 * (parameter.upper(ah) - parameter.lower(ah));
      Hypothesis more = h, less = h;
      more.settings.back().value[sought[j].parameter] += step;
      less.settings.back().value[sought[j].parameter] -= step;
      const Eigen::VectorXd difference = (evidence.residual(less, u) - evidence.residual(more, u)) / (2 * step);
      const Eigen::VectorXd column = exact.col(static_cast<Eigen::Index>(j));
      EXPECT_LT((difference - column).norm(), 0.01 * column.norm() + 1e-6) << info.id << " " << parameter.name;
    }
  }
}

TEST(Hypothesis, DerivativesByTheBaseParametersToo) {
  const Evidence evidence = plant_evidence(2);
  const Hypothesis h = evidence.base();
  Eigen::VectorXd u = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(evidence.calibration().size()));
  const Columns exact = evidence.calibration_derivatives(h, u);
  for (Eigen::Index k = 0; k < u.size(); ++k) {
    Eigen::VectorXd more = u, less = u;
    more[k] += 1e-5;
    less[k] -= 1e-5;
    const Eigen::VectorXd difference = (evidence.residual(h, less) - evidence.residual(h, more)) / 2e-5;
    EXPECT_LT((difference - exact.col(k)).norm(), 0.02 * exact.col(k).norm() + 1e-3) << k;
  }
}

TEST(Hypothesis, AFitIsNeverWorseThanWhereItBegan) {
  const Evidence evidence = plant_evidence(3);
  const Fit base = evidence.fit(evidence.base());
  for (const char* id : {"ocv_hysteresis", "slow_polarisation", "fast_polarisation", "capacity_change", "resistance_growth", "ocv_shape"}) {
    const Fit fit = evidence.fit(with(base.hypothesis, model::mechanism_index(id), evidence.cell().capacity_ah), base.calibration);
    EXPECT_LE(fit.cost, base.cost + 1) << id;
  }
}

TEST(Hypothesis, FindsAStrengthThatWasPutIn) {
  const double more_ohm = 0.004;
  const Record r = test::recorded(test::drive(2, 4), 0.7, 4, [&](std::size_t, double current_a, double) { return more_ohm * current_a; });
  const Evidence evidence(test::table9(), {}, {r}, NoiseModel{});
  const Fit fit = evidence.fit(with(evidence.base(), model::mechanism_index("resistance_growth"), 6));
  const MechanismSetting& found = fit.hypothesis.settings.back();
  EXPECT_NEAR(found.value[0], more_ohm / 0.0133, 0.03);
  EXPECT_GT(found.deviation[0], 0.001);
  EXPECT_LT(found.deviation[0], 0.03);
  EXPECT_TRUE(fit.converged);
}

}  // namespace
}  // namespace bms::diagnosis
