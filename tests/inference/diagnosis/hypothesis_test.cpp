#include "diagnosis/likelihood_model.hpp"

#include <map>

#include <ceres/jet.h>
#include <gmock/gmock.h>

#include "diagnosis/bursts.hpp"
#include "model/corrected_readings.hpp"
#include "numerics/in_parallel.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

/// Table 9's lines meet within a millivolt. A finite difference sees such a step, a derivative does not.
model::CellParameters<> without_steps(model::CellParameters<> cell) {
  for (std::size_t k = 1; k < cell.ocv.b0_v.size; ++k) {
    cell.ocv.b0_v[k] = cell.ocv.b0_v[k - 1] + (cell.ocv.b1_v[k - 1] - cell.ocv.b1_v[k]) * cell.ocv.soc[k];
  }
  return cell;
}

LikelihoodModel plant_likelihood(std::uint64_t seed = 1) {
  PreparedRecording r = test::recorded(test::drive(1, seed), 0.7, seed);
  r.temperature_c = std::vector<double>(r.size(), 15.0);
  for (std::size_t k = 0; k < r.size(); ++k)
    r.temperature_c.edit()[k] += 10.0 * static_cast<double>(k) / static_cast<double>(r.size());
  return {without_steps(test::table9()), {}, {r}, NoiseModel{}};
}

/// The mechanism well away from its neutral values.
Hypothesis acting(const LikelihoodModel& likelihood, std::size_t mechanism) {
  const double ah = likelihood.cell().capacity_ah;
  const model::MechanismInfo& info = model::catalogue[mechanism];
  Hypothesis h = with(likelihood.base(), mechanism, likelihood.cell());
  for (std::size_t p = 0; p < info.parameters; ++p) {
    const model::Parameter& parameter = info.parameter[p];
    if (parameter.role == model::Role::strength) h.settings.back().value[p] = 0.07 * parameter.upper(ah);
    if (parameter.role == model::Role::place) h.settings.back().value[p] = 0.3 * parameter.upper(ah);
    if (parameter.name == "limit_a") h.settings.back().value[p] = 10;
  }
  return h;
}

/// Every parameter of every mechanism: dual numbers against finite differences.
TEST(Hypothesis, DerivativesEqualFiniteDifferences) {
  const LikelihoodModel likelihood = plant_likelihood();
  const double ah = likelihood.cell().capacity_ah;
  const Eigen::VectorXd u = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(likelihood.calibration().size()), 0.3);
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const model::MechanismInfo& info = model::catalogue[m];
    if (info.id == "contact_intermittent") continue;
    const Hypothesis h = acting(likelihood, m);
    const std::vector<ParameterRef> sought = h.sought();
    const Columns exact = likelihood.derivatives(h, u, sought);
    for (std::size_t j = 0; j < sought.size(); ++j) {
      const model::Parameter& parameter = info.parameter[sought[j].parameter];
      const double step = 1e-7 * (parameter.upper(ah) - parameter.lower(ah));
      Hypothesis more = h, less = h;
      more.settings.back().value[sought[j].parameter] += step;
      less.settings.back().value[sought[j].parameter] -= step;
      const Eigen::VectorXd difference = (likelihood.residual(less, u) - likelihood.residual(more, u)) / (2 * step);
      const Eigen::VectorXd column = exact.col(static_cast<Eigen::Index>(j));
      EXPECT_LT((difference - column).norm(), 0.01 * column.norm() + 1e-6) << info.id << " " << parameter.name;
    }
  }
}

/// What belongs to a recording, and what an identification knows as a sum alone.
TEST(Hypothesis, DerivativesByBranchPositionAndShareEqualFiniteDifferences) {
  model::CellParameters<> cell = without_steps(test::table9());
  for (std::size_t k = 0; k < cell.rc.soc.size; ++k) {
    cell.rc.r0_std_ohm.push_back(2 * cell.rc.r0_ohm[k]);
    cell.rc.r1_std_ohm.push_back(2 * cell.rc.r1_ohm[k]);
  }
  model::MechanismSetting own = model::default_setting(model::mechanism_index("ocv_hysteresis"), cell);
  own.value = {0.02, 40, 0.2, -0.4, 0};
  const LikelihoodModel likelihood(cell, {own}, {test::recorded(test::drive(0.5, 8), 0.7, 8)}, NoiseModel{});
  Eigen::VectorXd u = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(likelihood.calibration().size()), 0.2);
  const Hypothesis base = likelihood.base();
  const Columns exact = likelihood.calibration_derivatives(base, u);
  ASSERT_EQ(likelihood.calibration().branch_unknowns().size(), 1U);
  for (Eigen::Index j = 0; j < u.size(); ++j) {
    Eigen::VectorXd more = u, less = u;
    more[j] += 1e-5;
    less[j] -= 1e-5;
    const Eigen::VectorXd difference = (likelihood.residual(base, less) - likelihood.residual(base, more)) / 2e-5;
    EXPECT_LT((difference - exact.col(j)).norm(), 0.01 * exact.col(j).norm() + 1e-4) << j;
  }
  const auto branch = static_cast<Eigen::Index>(likelihood.calibration().branch_unknowns().front());
  EXPECT_GT(exact.col(branch).norm(), 1);
}

/// The branch of the cell file's hysteresis at the start of a recording, and how it moves.
TEST(Hypothesis, AFullCellBeginsOnItsChargeBranchAndLeavesItWithTheCharge) {
  const model::CellParameters<> cell = test::table9();
  constexpr double half_gap_v = 0.02, decay = 40, moved = 0.01;
  model::MechanismSetting own = model::default_setting(model::mechanism_index("ocv_hysteresis"), cell);
  own.value = {half_gap_v, decay, 0, 0, 1};
  std::vector<double> current_a(101, -moved * 3'600 * cell.capacity_ah / 100);
  current_a.front() = 0;
  std::vector<PreparedRecording> records = {test::recorded(current_a, 0.95, 9), test::recorded(current_a, 0.6, 9),
                                            test::recorded(current_a, 0.95, 9)};
  const LikelihoodModel with(cell, {own}, records, NoiseModel{}), without(cell, {}, records, NoiseModel{});
  const auto branch_v = [&](std::size_t record, std::size_t row) {
    return with.voltage(with.base(), with.unchanged(), record)[row] -
           without.voltage(without.base(), without.unchanged(), record)[row];
  };
  for (const std::size_t full : {0U, 2U}) {
    EXPECT_NEAR(branch_v(full, 0), half_gap_v, 1e-9);
    EXPECT_NEAR(branch_v(full, 100), half_gap_v * (1 - decay * moved), 1e-4);
  }
  EXPECT_NEAR(branch_v(1, 0), 0, 1e-9);
  EXPECT_NEAR(branch_v(1, 100), -half_gap_v * decay * moved, 1e-4);
}

/// Covariance of two starts over the square of their standard deviation.
double start_correlation(const Calibration& calibration, std::size_t a, std::size_t b, double sigma) {
  std::map<std::size_t, double> of_a;
  double sum = 0;
  calibration.each_start(a, [&](std::size_t unknown, double size) { of_a[unknown] = size; });
  calibration.each_start(b, [&](std::size_t unknown, double size) { sum += size * of_a[unknown]; });
  return sum / (sigma * sigma);
}

/// A voltmeter is usually within 20 mV: of an OCV that is good to 40 mV three quarters of the variance are in common.
TEST(Hypothesis, StartsThatAreReadFromOneVoltageAreWrongTogether) {
  model::CellParameters<> cell = without_steps(test::table9());
  constexpr double sigma = 0.02, in_common = 0.75;
  cell.tolerance.ocv_v = 0.04;
  std::vector<PreparedRecording> records;
  for (const double soc : {0.97, 0.97, 0.95, 0.6, 0.97}) {
    records.push_back(test::recorded(test::drive(0.1, 8), soc, 8));
    records.back().initial_soc = soc;
    records.back().initial_soc_sigma = sigma;
    records.back().initial_soc_given = records.size() == 5;
  }
  const LikelihoodModel likelihood(cell, {}, records, NoiseModel{});
  const Calibration& calibration = likelihood.calibration();
  for (std::size_t r = 0; r < records.size(); ++r) EXPECT_NEAR(start_correlation(calibration, r, r, sigma), 1, 1e-9);
  EXPECT_NEAR(start_correlation(calibration, 0, 1, sigma), in_common, 1e-9);
  EXPECT_NEAR(start_correlation(calibration, 0, 2, sigma), 0.6 * in_common, 1e-9) << "0.4 knots of the OCV apart";
  EXPECT_NEAR(start_correlation(calibration, 0, 3, sigma), 0, 1e-9) << "elsewhere the OCV has another error";
  EXPECT_NEAR(start_correlation(calibration, 0, 4, sigma), 0, 1e-9) << "stated by a user";

  const Hypothesis base = likelihood.base();
  const Eigen::VectorXd u = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(calibration.size()), 0.2);
  const Columns exact = likelihood.calibration_derivatives(base, u);
  for (auto j = static_cast<Eigen::Index>(calibration.shared()); j < u.size(); ++j) {
    Eigen::VectorXd more = u, less = u;
    more[j] += 1e-5;
    less[j] -= 1e-5;
    const Eigen::VectorXd difference = (likelihood.residual(base, less) - likelihood.residual(base, more)) / 2e-5;
    EXPECT_LT((difference - exact.col(j)).norm(), 0.01 * exact.col(j).norm() + 1e-4) << j;
  }
}

TEST(Hypothesis, StartsOfAnOcvThatIsBetterThanAVoltmeterAreIndependent) {
  model::CellParameters<> cell = test::table9();
  cell.tolerance.ocv_v = 0.002;
  std::vector<PreparedRecording> records(2, test::recorded(test::drive(0.1, 8), 0.97, 8));
  for (PreparedRecording& r : records) r.initial_soc_given = false;
  const LikelihoodModel likelihood(cell, {}, records, NoiseModel{});
  EXPECT_EQ(start_correlation(likelihood.calibration(), 0, 1, 1), 0);
}

/// By every base parameter, as a dual number through the whole recording: slow but simple. One record, one mechanism.
Columns plain_calibration_derivatives(const LikelihoodModel& likelihood, const Hypothesis& h,
                                      const Eigen::VectorXd& at) {
  constexpr Eigen::Index lanes = 16;
  using S = ceres::Jet<double, lanes>;
  const model::CellParameters<>& cell = likelihood.cell();
  const PreparedRecording& r = likelihood.records().front();
  const Calibration& calibration = likelihood.calibration();
  const auto tables = model::prepare<double, model::max_intervals>(cell);
  const model::MechanismInfo& info = model::catalogue[h.settings.back().index];
  const auto setting = [&](const char* id, std::size_t p) { return info.id == id ? h.settings.back().value[p] : 0; };
  Columns columns(static_cast<Eigen::Index>(r.size()), at.size());
  for (Eigen::Index first = 0; first < at.size(); first += lanes) {
    const Eigen::Index here = std::min(lanes, at.size() - first);
    std::vector<S> u;
    for (const double x : at) u.emplace_back(x);
    for (Eigen::Index lane = 0; lane < here; ++lane) u[static_cast<std::size_t>(first + lane)].v[lane] = 1;
    model::ChosenLaws<S> laws = model::chosen<S>(h.settings, cell.capacity_ah);
    model::choose<S>(laws, model::mechanism_index("capacity_change"),
                     model::MechanismValues<S>{calibration.capacity_loss(u) + setting("capacity_change", 0)},
                     cell.capacity_ah);
    model::choose<S>(laws, model::mechanism_index("current_gain"),
                     model::MechanismValues<S>{calibration.gain_error(u) + setting("current_gain", 0)},
                     cell.capacity_ah);
    const model::CorrectedReadings<S> readings(r.time_s, r.current_a, r.temperature_c, S(setting("channel_skew", 0)),
                                               S(setting("temperature_sensor", 1)));
    model::OpenLoopSimulation<S> course(
        tables, cell.capacity_ah, laws,
        calibration.initial_soc_shift(0, u) + (r.initial_soc + setting("initial_soc", 0)));
    for (std::size_t k = 0; k < r.size(); ++k) {
      const S read_a = readings.current(k) - calibration.offset_a(0, r.time_s[k], u);
      const S v = course.step(r.time_s[k], k > 0 ? r.time_s[k] - r.time_s[k - 1] : 0, read_a, readings.temperature(k),
                              [&](auto& table, const S& soc) { calibration.adjust(table, soc, u); });
      columns.row(static_cast<Eigen::Index>(k)).segment(first, here) = v.v.head(here).transpose();
    }
  }
  likelihood.whiten(columns);
  return columns;
}

/// Carried from row to row, or one by one through the whole recording: the same except for rounding, with any
/// mechanism.
TEST(Hypothesis, CarriedBaseParameterDerivativesEqualThoseOneByOne) {
  const LikelihoodModel likelihood = plant_likelihood();
  const Eigen::VectorXd u =
      Eigen::VectorXd::LinSpaced(static_cast<Eigen::Index>(likelihood.calibration().size()), -0.5, 0.7);
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const Hypothesis h = acting(likelihood, m);
    const Columns plain = plain_calibration_derivatives(likelihood, h, u),
                  carried = likelihood.calibration_derivatives(h, u);
    for (Eigen::Index k = 0; k < u.size(); ++k) {
      EXPECT_LT((carried.col(k) - plain.col(k)).norm(), 1e-9 * plain.col(k).norm() + 1e-12)
          << model::catalogue[m].id << " " << k;
    }
  }
}

TEST(Hypothesis, BaseParameterDerivativesEqualFiniteDifferences) {
  // two recordings, and checks of both channels
  const LikelihoodModel one = plant_likelihood(2);
  std::vector<PreparedRecording> records(2, one.records().front());
  records[1].initial_soc = 0.65;
  for (PreparedRecording& r : records)
    r.checks = {{Check::Channel::current, 900, 3, 3.01, 3, 0.002},
                {Check::Channel::voltage, 1'800, 2, 3.3, 3.301, 0.001}};
  const LikelihoodModel likelihood(one.cell(), {}, records, NoiseModel{});
  const Hypothesis h = likelihood.base();
  Eigen::VectorXd u = likelihood.unchanged();
  const Columns exact = likelihood.calibration_derivatives(h, u);
  for (Eigen::Index k = 0; k < u.size(); ++k) {
    Eigen::VectorXd more = u, less = u;
    more[k] += 1e-5;
    less[k] -= 1e-5;
    const Eigen::VectorXd difference = (likelihood.residual(h, less) - likelihood.residual(h, more)) / 2e-5;
    EXPECT_LT((difference - exact.col(k)).norm(), 0.02 * exact.col(k).norm() + 1e-3) << k;
  }
}

/// The cell file's own point, and one with a mechanism.
std::vector<LikelihoodModel::Point> two_points(const LikelihoodModel& likelihood) {
  return {{likelihood.base(), likelihood.unchanged()},
          {acting(likelihood, model::mechanism_index("resistance_growth")), likelihood.unchanged().array() + 0.2}};
}

TEST(Hypothesis, ASharedLinearisationIsDroppedWhenTheNoiseChanges) {
  NoiseModel larger;
  larger.white_v *= 3;
  larger.slow_v *= 2;
  for (const bool base_first : {false, true}) {
    LikelihoodModel likelihood = plant_likelihood();
    std::vector<LikelihoodModel::Point> points = two_points(likelihood);
    if (!base_first) std::swap(points[0], points[1]);
    likelihood.linearise(points[0].hypothesis, points[0].unknowns);
    likelihood.linearised_at(points[1].hypothesis, points[1].unknowns);
    likelihood.set_noise(larger);
    EXPECT_FALSE(likelihood.has_linearisation());
    const LikelihoodModel fresh(likelihood.cell(), {}, likelihood.records(), larger);
    for (const std::size_t latest_first : {1U, 0U}) {  // a question for another point would replace it
      const auto& [h, u] = points[latest_first];
      EXPECT_TRUE(likelihood.linearised_at(h, u)->columns == fresh.calibration_derivatives(h, u));
    }
  }
}

TEST(Hypothesis, SeveralThreadsShareLinearisations) {
  const LikelihoodModel likelihood = plant_likelihood();
  const std::vector<LikelihoodModel::Point> points = two_points(likelihood);
  std::vector<Columns> expected;
  for (const auto& [h, u] : points) expected.push_back(likelihood.calibration_derivatives(h, u));
  std::vector<char> same(100, 0);
  numerics::in_parallel(same.size(), [&](std::size_t k) {
    const std::size_t at = k % 3 == 0 ? 0 : 1;
    const auto& [h, u] = points[at];
    if (k % 10 == 0) likelihood.linearise(h, u);
    same[k] = likelihood.linearised_at(h, u)->columns == expected[at] ? 1 : 0;
  });
  EXPECT_THAT(same, testing::Each(1));
}

TEST(Hypothesis, AFitIsNeverWorseThanWhereItBegan) {
  const LikelihoodModel likelihood = plant_likelihood(3);
  const HypothesisFit base = likelihood.fit(likelihood.base());
  for (const char* id : {"ocv_hysteresis", "slow_polarisation", "fast_polarisation", "capacity_change",
                         "resistance_growth", "ocv_shape"}) {
    const HypothesisFit fit =
        likelihood.fit(with(base.hypothesis, model::mechanism_index(id), likelihood.cell()), base.calibration);
    EXPECT_LE(fit.cost, base.cost + 1) << id;
  }
}

TEST(Hypothesis, FindsAKnownStrength) {
  const double more_ohm = 0.004;
  const PreparedRecording r = test::recorded(
      test::drive(2, 4), 0.7, 4, [&](std::size_t, double current_a, double) { return more_ohm * current_a; });
  const LikelihoodModel likelihood(test::table9(), {}, {r}, NoiseModel{});
  const HypothesisFit fit =
      likelihood.fit(with(likelihood.base(), model::mechanism_index("resistance_growth"), likelihood.cell()));
  const MechanismSetting& found = fit.hypothesis.settings.back();
  EXPECT_NEAR(found.value[0], more_ohm / 0.0133, 0.03);
  EXPECT_GT(found.deviation[0], 0.001);
  EXPECT_LT(found.deviation[0], 0.03);
  EXPECT_TRUE(fit.converged);
}

/// Bursts may be searched in the residual of a simulation that has diverged.
TEST(Bursts, SearchEndsForAnyResidual) {
  const LikelihoodModel likelihood = plant_likelihood(5);
  std::vector<double> residual_v(likelihood.readings(), 0.001);
  for (std::size_t k = 1'000; k < 1'020; ++k) residual_v[k] = k % 2 == 0 ? 1e298 : -1e298;
  double ohm = 0;
  EXPECT_TRUE(find_bursts(likelihood.records().front(), residual_v, likelihood.whitener(0), ohm).empty());
}

}  // namespace
}  // namespace bms::diagnosis
