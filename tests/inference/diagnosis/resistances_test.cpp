// Resistances at the temperature of the recordings: against Arrhenius by hand, and against the plant, whose factors
// over the temperature are tables.
#include "diagnosis/resistances.hpp"

#include <cmath>

#include <gmock/gmock.h>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/texts.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

constexpr double cold_c = -5;
/// Exponent per J/mol at -5 degrees C, by hand: (1 / 268.15 - 1 / 298.15) / 8.314462618.
constexpr double per_energy = 4.5131e-5;
constexpr std::size_t fast = model::mechanism_index_of<model::FastPolarisation>,
                      arrhenius = model::mechanism_index_of<model::TemperatureResistance>;

PreparedRecording in_the_cold(PreparedRecording r) {
  r.temperature_c = std::vector<double>(r.size(), cold_c);
  return r;
}

const ResistanceAt& named(const std::vector<ResistanceAt>& list, const std::string& name) {
  for (const ResistanceAt& r : list) {
    if (r.name == name) return r;
  }
  throw std::runtime_error("no " + name);
}

/// A fit of both, with a correlation between the resistance of the first and the energy of R1.
HypothesisFit fit_of(const LikelihoodModel& likelihood, double correlation) {
  HypothesisFit fit;
  fit.hypothesis = with(likelihood.base(), {fast, {0.002, 1.5}, {}});
  MechanismSetting follows = model::default_setting(arrhenius, likelihood.cell());
  follows.value[0] = 45'000;
  follows.value[1] = 40'000;
  follows.value[3] = 0.3;
  fit.hypothesis = with(fit.hypothesis, follows);
  fit.calibration = likelihood.unchanged();
  fit.residual = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(likelihood.samples()));
  fit.noise = likelihood.noise();
  const std::vector<ParameterRef> sought = fit.hypothesis.sought();
  const auto n = static_cast<Eigen::Index>(sought.size());
  fit.covariance = Eigen::MatrixXd::Zero(n, n);
  const double ohm = 0.0006, energy = 6'000;
  for (Eigen::Index j = 0; j < n; ++j) {
    const ParameterRef& of = sought[static_cast<std::size_t>(j)];
    if (of == ParameterRef{0, 0}) fit.covariance(j, j) = ohm * ohm;
    if (of == ParameterRef{1, 1}) fit.covariance(j, j) = energy * energy;
    for (Eigen::Index k = 0; k < n; ++k) {
      if (of == ParameterRef{0, 0} && sought[static_cast<std::size_t>(k)] == ParameterRef{1, 1})
        fit.covariance(j, k) = fit.covariance(k, j) = correlation * ohm * energy;
    }
  }
  return fit;
}

Diagnosis stated(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  Diagnosis d;
  for (const MechanismSetting& s : fit.hypothesis.settings) d.findings.emplace_back().setting = s;
  add_resistances(likelihood, fit, d);
  return d;
}

TEST(Resistances, AreArrheniusTimesTheSizeAtTheReference) {
  const LikelihoodModel likelihood(test::table9(), {}, {in_the_cold(test::recorded(test::drive(0.3, 1), 0.7, 1))}, {});
  const double factor = std::exp(40'000 * per_energy);
  for (const double correlation : {0.0, -0.99}) {
    const Diagnosis d = stated(likelihood, fit_of(likelihood, correlation));
    ASSERT_TRUE(d.resistances.has_value());
    EXPECT_NEAR(d.resistances->temperature_c, cold_c, 1e-9);
    EXPECT_EQ(d.resistances->reference_c, 25);
    EXPECT_EQ(d.resistances->step_s, 1);
    const ResistanceAt own = named(d.findings[0].resistances, "resistance_ohm");
    EXPECT_NEAR(own.here.ohm, 0.002 * factor, 1e-6);
    const double by_ohm = factor * 0.0006, by_energy = 0.002 * factor * per_energy * 6'000;
    EXPECT_NEAR(own.here.std_ohm,
                std::sqrt(by_ohm * by_ohm + by_energy * by_energy + 2 * correlation * by_ohm * by_energy), 2e-6);
    ASSERT_TRUE(own.reference.has_value());
    EXPECT_NEAR(own.reference->ohm, 0.002, 1e-9);
    EXPECT_NEAR(own.reference->std_ohm, 0.0006, 1e-9);
    const ResistanceAt r0 = named(d.resistances->cell, "r0_ohm");
    const double r0_factor = 0.7 + 0.3 * std::exp(45'000 * per_energy);
    EXPECT_NEAR(r0.here.ohm / r0.reference->ohm, r0_factor, 1e-3);
    const ResistanceAt added = named(d.findings[1].resistances, "added_r0_ohm");
    EXPECT_NEAR(added.here.ohm, r0.here.ohm - r0.reference->ohm, 1e-9);
    EXPECT_NEAR(added.reference->ohm, 0, 1e-12);
    // of a step of a second: R0, and of the fast polarisation 1 - exp(-1 / 1.5)
    EXPECT_GT(named(d.resistances->cell, "step_ohm").here.ohm, r0.here.ohm + 0.48 * own.here.ohm);
  }
}

TEST(Resistances, WithoutATemperatureNothingIsStated) {
  const LikelihoodModel likelihood(test::table9(), {}, {test::recorded(test::drive(0.3, 1), 0.7, 1)}, {});
  const Diagnosis d = stated(likelihood, fit_of(likelihood, 0));
  EXPECT_FALSE(d.resistances.has_value());
  EXPECT_TRUE(d.findings[0].resistances.empty());
}

TEST(Resistances, WithoutALawOfTheTemperatureNothingIsStatedAtTheReference) {
  const LikelihoodModel likelihood(test::table9(), {}, {in_the_cold(test::recorded(test::drive(0.3, 1), 0.7, 1))}, {});
  HypothesisFit fit = fit_of(likelihood, 0);
  fit.hypothesis = without(fit.hypothesis, arrhenius);
  fit.covariance = 1e-8 * Eigen::MatrixXd::Identity(2, 2);
  const Diagnosis d = stated(likelihood, fit);
  ASSERT_TRUE(d.resistances.has_value());
  EXPECT_FALSE(named(d.findings[0].resistances, "resistance_ohm").reference.has_value());
  EXPECT_NEAR(named(d.findings[0].resistances, "resistance_ohm").here.ohm, 0.002, 1e-9);
}

/// The plant's cell in a chamber of that temperature, held there by a strong fan.
PreparedRecording of_plant(double temperature_c, std::uint64_t seed, double& r0_ohm) {
  plant::Random random(seed);
  plant::CellParameters p;
  p.over_temperature = plant::lfp_in_the_cold();
  p.thermal.to_ambient_w_per_k = 50;
  plant::Cell cell(p, {.soc = 0.7, .v_rc_v = 0, .temperature_c = temperature_c});
  PreparedRecording r;
  r.initial_soc = 0.7;
  double weights = 0, before_a = 0;
  r0_ohm = 0;
  const std::vector<double> current_a = test::drive(2, seed);
  for (std::size_t k = 0; k < current_a.size(); ++k) {
    cell.run(current_a[k], temperature_c, 1);
    r.time_s.edit().push_back(static_cast<double>(k));
    r.current_a.edit().push_back(current_a[k] + 0.01 * random.normal());
    r.voltage_v.edit().push_back(cell.voltage_v() + 0.001 * random.normal());
    r.temperature_c.edit().push_back(temperature_c);
    const double weight = (current_a[k] - before_a) * (current_a[k] - before_a);
    r0_ohm += weight * p.circuit.r0_ohm.at(cell.soc()) * p.over_temperature->r0.at(temperature_c);
    weights += weight;
    before_a = current_a[k];
  }
  r0_ohm /= weights;
  return r;
}

TEST(Resistances, R0InTheColdIsThePlants) {
  double true_ohm = 0;
  const Diagnosis d = diagnose(test::table9(), {}, {of_plant(0, 31, true_ohm)});
  ASSERT_TRUE(d.resistances.has_value()) << name_of(d.verdict) << d.statement;
  const ResistanceAt r0 = named(d.resistances->cell, "r0_ohm");
  EXPECT_NEAR(r0.here.ohm, true_ohm, 3 * r0.here.std_ohm);
  EXPECT_LT(r0.here.std_ohm, 0.05 * true_ohm);
  ASSERT_TRUE(r0.reference.has_value());
  EXPECT_GT(r0.here.ohm, 1.5 * r0.reference->ohm) << "twice as large as at 25 degrees C";
  EXPECT_FALSE(at_temperature_text(d, d.resistances->cell).empty());
}

}  // namespace
}  // namespace bms::diagnosis
