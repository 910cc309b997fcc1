// The filter over cells with mechanisms.
#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/soc_estimator.hpp"
#include "model/extended.hpp"
#include "tests/cells.hpp"
#include "tests/model/usual_mechanisms.hpp"
#include "tests/starting_point.hpp"

namespace bms::estimator {
namespace {

using namespace model;

constexpr double capacity_ah = 6;

template <class S>
using HostLaws = ChosenLaws<S>;
template <class S>
using Cells = ExtendedCell<S, max_intervals, HostLaws<S>>;
constexpr std::size_t mechanism_state_count = HostLaws<double>::most_states;

template <class S>
Cells<S> table9_with(const std::vector<MechanismSetting>& mechanisms) {
  return {tests::prepared<S>(), chosen<S>(mechanisms, capacity_ah)};
}

/// All that a board runs.
/// Without energies that follow the SOC: what they change in polarisations, the filter's transition neglects.
/// measured: the hysteresis between the cell file's curves.
std::vector<MechanismSetting> everything(bool measured = false) {
  std::vector<std::string_view> ids;
  for (const MechanismInfo& info : catalogue) {
    if (info.on_board) ids.push_back(info.id);
  }
  std::vector<MechanismSetting> all = usual(ids);
  for (MechanismSetting& m : all) {
    for (std::size_t k = 0; k < catalogue[m.index].parameters; ++k) {
      if (catalogue[m.index].parameter[k].name.starts_with("more_at")) m.value[k] = 0;
      if (catalogue[m.index].parameter[k].name == "measured") m.value[k] = measured ? 1 : 0;
    }
  }
  return all;
}

TEST(ExtendedModel, TransitionAndSensitivityAreTheDerivativesAt1000RandomStates) {
  constexpr std::size_t voltages = HostLaws<double>::most_voltage_states, states = voltages + 2;
  ASSERT_EQ(voltages, 5U);
  using Jet = ceres::Jet<double, static_cast<int>(states)>;
  using Model = ExtendedRc<voltages, mechanism_state_count>::Of<double>;
  using JetModel = ExtendedRc<voltages, mechanism_state_count>::Of<Jet>;
  const auto cell = table9_with<double>(everything());
  const auto jets = table9_with<Jet>(everything());
  ASSERT_EQ(cell.laws.voltage_states(), voltages);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int run = 0; run < 1'000; ++run) {
    const double soc = -0.05 + 1.1 * uniform(random);
    Model::State x;
    for (double& v : x) v = 0.05 * (uniform(random) - 0.5);
    x.back() = 0.05 * uniform(random);  // warmth, 5 K at most
    const StepInput<double> input{30 * (uniform(random) - 0.5), std::pow(10, 3 * uniform(random) - 2),
                                  40 * uniform(random)};
    std::uint8_t interval = 0;
    const auto at = look_up(OperatingPoint{cell, input, Model::mechanism_states(x)}, soc, interval);
    const auto discretisation = Model::discretise(cell.laws, x, at, input);
    const auto f = Model::state_transition(x, at, discretisation, input);
    const auto h = Model::measurement_jacobian(cell.laws, at, input);

    typename JetModel::State y;
    for (std::size_t k = 0; k < y.size(); ++k) y[k] = k <= voltages ? Jet(x[k], static_cast<int>(k)) : Jet(x[k]);
    const StepInput<Jet> input_j{Jet(input.current_a), Jet(input.duration_s), Jet(input.temperature_c)};
    const Jet soc_j(soc, static_cast<int>(states - 1));
    const auto at_j = look_up(OperatingPoint{jets, input_j, JetModel::mechanism_states(y)}, soc_j, interval);
    const auto discretisation_j = JetModel::discretise(jets.laws, y, at_j, input_j);
    const auto moved = JetModel::advance(y, at_j, discretisation_j, input_j);
    const Jet v = JetModel::voltage(jets.laws, y, at_j, input_j);
    EXPECT_NEAR(v.a, Model::voltage(cell.laws, x, at, input), 1e-12);
    for (std::size_t j = 0; j < states; ++j) {
      for (std::size_t i = 0; i + 1 < states; ++i)
        ASSERT_NEAR(f[i][j], moved[i].v[static_cast<int>(j)], 1e-12 * (1 + std::abs(f[i][j])))
            << i << j << " soc " << soc;
      ASSERT_EQ(f[states - 1][j], j + 1 == states ? 1 : 0);
      ASSERT_NEAR(h[j], v.v[static_cast<int>(j)], 1e-10 * (1 + std::abs(h[j])))
          << j << " soc " << soc << " current " << input.current_a;
    }
  }
}

/// Where the hysteresis lies between measured curves, a state of 1 mV is `gap` mV of voltage.
TEST(ExtendedModel, TheSensitivityToAMeasuredHysteresisIsTheDerivative) {
  constexpr std::size_t voltages = HostLaws<double>::most_voltage_states, states = voltages + 2;
  using Jet = ceres::Jet<double, static_cast<int>(states)>;
  using Model = ExtendedRc<voltages, mechanism_state_count>::Of<double>;
  using JetModel = ExtendedRc<voltages, mechanism_state_count>::Of<Jet>;
  const auto cell = table9_with<double>(everything(true));
  const auto jets = table9_with<Jet>(everything(true));
  for (int k = 0; k < 100; ++k) {
    const StepInput<double> input{-3, 1, -20.0 + 0.5 * k};
    const StepInput<Jet> input_j{Jet(input.current_a), Jet(input.duration_s), Jet(input.temperature_c)};
    typename JetModel::State y;
    for (std::size_t j = 0; j < y.size(); ++j) y[j] = j <= voltages ? Jet(0.01, static_cast<int>(j)) : Jet(0.01);
    Model::State x{};
    x.fill(0.01);
    std::uint8_t interval = 0;
    const double soc = 0.01 * k;
    const auto at = look_up(OperatingPoint{cell, input, Model::mechanism_states(x)}, soc, interval);
    const auto at_j = look_up(OperatingPoint{jets, input_j, JetModel::mechanism_states(y)},
                              Jet(soc, static_cast<int>(states - 1)), interval);
    const auto h = Model::measurement_jacobian(cell.laws, at, input);
    const Jet v = JetModel::voltage(jets.laws, y, at_j, input_j);
    for (std::size_t j = 0; j < states; ++j)
      ASSERT_NEAR(h[j], v.v[static_cast<int>(j)], 1e-10 * (1 + std::abs(h[j]))) << j << " soc " << soc;
  }
}

struct Work {
  std::vector<measurement::Sample> samples;
  std::vector<double> soc;
};
/// A shift of pulses as a cell with these mechanisms answers it, read with noise of 1 mV.
Work work(const std::vector<MechanismSetting>& mechanisms, std::size_t count, double soc, unsigned seed = 5) {
  const auto cell = tests::prepared<double>();
  OpenLoopSimulation<double> simulation(cell, capacity_ah, chosen<double>(mechanisms, capacity_ah), soc);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 0.001);
  Work w;
  for (std::size_t k = 0; k < count; ++k) {
    constexpr double phases_a[] = {-5, 1.5, -0.2};
    const double current_a = k < 60 ? 0 : phases_a[(k / 40) % 3];
    const double temperature_c = 15 + 1e-3 * static_cast<double>(k);
    const double v =
        simulation.step(static_cast<double>(k), k == 0 ? 0 : 1, current_a, temperature_c, [](auto&, const auto&) {}) +
        noise(random);
    w.samples.push_back({k * 1'000'000, static_cast<std::int32_t>(std::lround(current_a * 1e6)),
                         static_cast<std::int32_t>(std::lround(v * 1e6)),
                         static_cast<std::int16_t>(std::lround(temperature_c * 100))});
    w.soc.push_back(simulation.soc());
  }
  return w;
}

template <class S, std::size_t Voltages, class AnyCell>
auto run(const AnyCell& cell, const std::vector<measurement::Sample>& samples,
         const measurement::StartingPoint& start) {
  using Estimator = SocEstimator<S, ExtendedRc<Voltages, mechanism_state_count>::template Of>;
  Estimator estimator(start);
  std::vector<typename Estimator::Result> estimates;
  for (const measurement::Sample& s : samples) estimates.push_back(estimator.step(cell, s));
  return estimates;
}

const std::vector<std::string_view> some = {"ocv_hysteresis", "slow_polarisation", "temperature_resistance",
                                            "current_offset"};

/// Nobody knows the branch at the start: 8 mV of it are a few percent there. What a filter does not know, it counts as
/// uncertain, so that a right model gains a part only; the plain filter is as far off as it says.
TEST(ExtendedEstimator, FollowsACellBetterThanThePlainModel) {
  constexpr std::size_t count = 10'000;
  double with_squares = 0, plain_squares = 0;
  constexpr unsigned seeds = 4;
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    const Work w = work(usual(some), count, 0.9, seed);
    const measurement::StartingPoint start = starting_at(0.9, 0.05);
    const auto with = run<double, 3>(table9_with<double>(usual(some)), w.samples, start);
    SocEstimator<double> estimator(start);
    const auto plain_cell = tests::prepared<double>();
    std::size_t inside = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double error = with[k].soc - w.soc[k];
      with_squares += error * error;
      plain_squares += std::pow(estimator.step(plain_cell, w.samples[k]).soc - w.soc[k], 2);
      if (std::abs(error) < 2 * with[k].soc_sigma) ++inside;
    }
    EXPECT_GT(inside, 9'500U) << seed;
  }
  EXPECT_LT(std::sqrt(with_squares / (count * seeds)), 0.025);
  EXPECT_GT(std::sqrt(plain_squares / with_squares), 1.5);
}

TEST(ExtendedEstimator, FindsTheBranchOfAHysteresisThatItStartedWrongOn) {
  std::vector<MechanismSetting> truth = {usual("ocv_hysteresis")}, given = truth;
  truth[0].value = {0.02, 40, 0, 1};
  given[0].value = {0.02, 40, 0, -1};
  const Work w = work(truth, 6'000, 0.93);  // where the curve is steep, soc is known and the rest is hysteresis
  const auto e = run<float, 1>(table9_with<float>(given), w.samples, starting_at(0.93, 0.005));
  EXPECT_NEAR(e.front().extra[0], -0.02, 1e-6);
  EXPECT_NEAR(e[50].extra[0], 0.02, 0.012);
  EXPECT_NEAR(e.back().soc, w.soc.back(), 0.02);
}

/// With errors as states.
template <class S, std::size_t Voltages>
Cells<S> table9_with_errors(const std::vector<MechanismSetting>& mechanisms) {
  CellParameters<> parameters = tests::table9;
  parameters.noise.current_offset_a = 0.06;  // a hundredth of 1C
  parameters.noise.current_offset_correlation_s = 36'000;
  return {tests::prepared<S>(parameters), chosen<S>(mechanisms, capacity_ah)};
}
template <class S, std::size_t Voltages>
auto run_with_errors(const std::vector<MechanismSetting>& mechanisms, const std::vector<measurement::Sample>& samples,
                     const measurement::StartingPoint& start) {
  using Estimator = SocEstimator<S, ExtendedRc<Voltages, mechanism_state_count, true>::template Of>;
  const auto cell = table9_with_errors<S, Voltages>(mechanisms);
  Estimator estimator(start);
  std::vector<typename Estimator::Result> estimates;
  for (const measurement::Sample& s : samples) estimates.push_back(estimator.step(cell, s));
  return estimates;
}

/// The host has places for more voltages than most cells need. One of those that are left is the place of a
/// temperature.
template <class S>
void expect_the_same_bits_with_places_left() {
  const std::vector<MechanismSetting> mechanisms =
      usual({"ocv_hysteresis", "slow_polarisation", "temperature_resistance", "self_heating"});
  const Cells<S> cell = table9_with_errors<S, 3>(mechanisms);
  ASSERT_EQ(cell.laws.voltage_states(), 3U);
  ASSERT_EQ(cell.laws.states(), 4U);
  const Work w = work(mechanisms, 3'000, 0.93);
  for (const double sigma : {0.005, 0.2}) {  // known, and ambiguous
    const auto exact = run_with_errors<S, 3>(mechanisms, w.samples, starting_at(0.9, sigma));
    const auto wide = run_with_errors<S, 5>(mechanisms, w.samples, starting_at(0.9, sigma));
    for (std::size_t k = 0; k < exact.size(); ++k) ASSERT_EQ(words(exact[k]), words(wide[k])) << k;
  }
}
TEST(ExtendedEstimator, PlacesWithoutAStateChangeNoBit) {
  expect_the_same_bits_with_places_left<float>();
  expect_the_same_bits_with_places_left<FixedPoint>();
}

TEST(ExtendedModel, ErrorsAsStatesChangeNothingElse) {
  constexpr std::size_t voltages = 3;
  using Plain = ExtendedRc<voltages, mechanism_state_count>::Of<double>;
  using Model = ExtendedRc<voltages, mechanism_state_count, true>::Of<double>;
  ASSERT_EQ(Model::states, Plain::states + 2);
  const auto cell =
      table9_with_errors<double, voltages>(usual({"ocv_hysteresis", "slow_polarisation", "temperature_resistance"}));
  Plain::State x;
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = 0.001 * static_cast<double>(k + 1);
  Model::State y{x[0], 0.004, 0.002};
  for (std::size_t k = 0; k < mechanism_state_count; ++k) y[Model::first_mechanism_state + k] = x[1 + k];
  const StepInput<double> input{-3, 2, 10};
  std::uint8_t interval = 0;
  const auto at = look_up(OperatingPoint{cell, input, Model::mechanism_states(y)}, 0.6, interval);
  const auto error_decay = Model::error_decay(cell.noise, input.duration_s);
  const auto of_plain = Plain::discretise(cell.laws, x, at, input);
  const auto of_model = Model::discretise(cell.laws, y, at, input, error_decay);
  const auto f = Plain::state_transition(x, at, of_plain, input);
  const auto g = Model::state_transition(y, at, of_model, input);
  const auto from_plain = [](std::size_t i) { return i == 0 ? 0 : i + 1; };
  for (std::size_t i = 0; i < Plain::states; ++i) {
    for (std::size_t j = 0; j < Plain::states; ++j) EXPECT_EQ(f[i][j], g[from_plain(i)][from_plain(j)]) << i << j;
  }
  EXPECT_DOUBLE_EQ(g[1][1], 1 - 2 / (8 * cell.noise.model_correlation_s));
  EXPECT_DOUBLE_EQ(g[Model::last][Model::last], 1 - 2 / 36'000.0);
  EXPECT_DOUBLE_EQ(g[Model::soc][Model::last], -2 / 3'600.0);
  EXPECT_DOUBLE_EQ(Model::voltage(cell.laws, y, at, input), Plain::voltage(cell.laws, x, at, input) + 0.004);
  EXPECT_DOUBLE_EQ(Model::without_offset(1.0, y, cell.noise), 1 - 0.002 * 6);
  const auto h = Model::measurement_jacobian(cell.laws, at, input);
  const auto p = Plain::measurement_jacobian(cell.laws, at, input);
  EXPECT_EQ(h[1], h[0]);
  EXPECT_EQ(h[Model::soc], p[Plain::soc]);
  EXPECT_EQ(h[Model::last], 0);
}

/// In the cold the resistance near empty is many times that at half charge, and so is what an earlier load left.
TEST(ExtendedEstimator, AStartInAColdShiftSpansWhatTheLoadLeftAtEachSoc) {
  std::vector<MechanismSetting> steep{usual("temperature_resistance")};
  MechanismSetting& m = steep.front();
  for (std::size_t k = 0; k < catalogue[m.index].parameters; ++k) {
    const std::string_view name = catalogue[m.index].parameter[k].name;
    if (name == "r1_activation_j_per_mol") m.value[k] = 35'000;
    if (name == "more_at_10") m.value[k] = 1.2;
    if (name == "more_at_25") m.value[k] = 0.8;
  }
  const auto laws = chosen<double>(steep, capacity_ah);
  const auto exact = tests::prepared<double>();
  OpenLoopSimulation<double> simulation(exact, capacity_ah, laws, 0.3);
  double v = 0;
  int k = 0;
  for (; simulation.soc() > 0.16; ++k) v = simulation.step(k, k == 0 ? 0 : 1, -1.0, -15, [](auto&, const auto&) {});
  for (int rest = 0; rest < 5; ++rest, ++k) v = simulation.step(k, 1, 0, -15, [](auto&, const auto&) {});
  ExtendedCell<float, max_intervals, HostLaws<float>> cell{tests::prepared<float>(), chosen<float>(steep, capacity_ah)};
  SocEstimator<float, ExtendedRc<0, mechanism_state_count>::Of> estimator;
  const auto e = estimator.step(cell, {1, 0, static_cast<std::int32_t>(std::lround(v * 1e6)), -1'500});
  EXPECT_LE(std::abs(e.soc - simulation.soc()), 2 * e.soc_sigma) << e.soc << " +- " << e.soc_sigma;
  EXPECT_LT(e.soc_sigma, 0.25);
}

TEST(ExtendedEstimator, FindsTheOffsetOfACurrentSensorAtTheKnees) {
  double error = 0, error_without = 0;
  for (const auto& [offset_a, seed] : {std::pair{-0.08, 1U}, {0.08, 1U}, {-0.08, 2U}, {0.08, 2U}}) {
    Work w = work({}, 13'000, 0.95, seed);  // to 20 % of charge
    for (measurement::Sample& s : w.samples) s.current_ua += static_cast<std::int32_t>(1e6 * offset_a);
    const measurement::StartingPoint start = starting_at(0.95, 0.01);
    const auto e = run_with_errors<float, 0>({}, w.samples, start);
    SocEstimator<float> plain(start);
    const auto plain_cell = tests::prepared<float>();
    for (std::size_t k = 0; k < w.samples.size(); ++k) {
      error += std::abs(e[k].soc - w.soc[k]);
      error_without += std::abs(plain.step(plain_cell, w.samples[k]).soc - w.soc[k]);
    }
    const double found_a = 6 * e.back().extra[1], sigma_a = 6 * e.back().extra[2];
    EXPECT_LT(sigma_a, 0.032);
    EXPECT_NEAR(found_a, offset_a, 2 * sigma_a);
    EXPECT_LE(std::abs(e.back().soc - w.soc.back()), 2 * e.back().soc_sigma);
  }
  EXPECT_LT(error, error_without) << "over the whole drive";
}

/// An hour at rest, then the work of the others.
Work work_after_a_rest(double sensor_a, double truly_a) {
  Work w;
  const auto cell = tests::prepared<double>();
  OpenLoopSimulation<double> simulation(cell, capacity_ah, {}, 0.6);
  for (std::uint64_t k = 0; k < 7'200; ++k) {
    const double current_a = k < 3'600 ? truly_a : -1;
    const double v = simulation.step(static_cast<double>(k), k == 0 ? 0 : 1, current_a, 25, [](auto&, const auto&) {});
    w.samples.push_back({k * 1'000'000, static_cast<std::int32_t>(std::lround((current_a + sensor_a) * 1e6)),
                         static_cast<std::int32_t>(std::lround(v * 1e6)), 2'500});
    w.soc.push_back(simulation.soc());
  }
  return w;
}

template <class S>
auto run_with_rest(double at_rest_a, const std::vector<measurement::Sample>& samples,
                   const measurement::StartingPoint& start, double gain = 0,
                   const std::vector<MechanismSetting>& of_file = {}) {
  using Estimator = SocEstimator<S, ExtendedRc<0, mechanism_state_count, true>::template Of>;
  auto parameters = tests::table9;
  parameters.noise.current_offset_a = 0.06;
  parameters.noise.current_offset_correlation_s = 36'000;
  parameters.noise.current_at_rest_a = at_rest_a;
  parameters.noise.current_gain = gain;
  parameters.noise.errors_are_states = true;
  const Cells<S> cell{tests::prepared<S>(parameters), chosen<S>(of_file, capacity_ah)};
  Estimator estimator(start);
  std::vector<typename Estimator::Result> estimates;
  for (const measurement::Sample& s : samples) estimates.push_back(estimator.step(cell, s));
  return estimates;
}

TEST(ExtendedEstimator, LearnsNoOffsetAtRestThatTheCellFileKnows) {
  std::vector<MechanismSetting> of_file{usual("current_offset")};
  of_file.front().value = {0.05};
  const Work w = work_after_a_rest(0.05, 0);
  const auto e = run_with_rest<float>(0.012, w.samples, starting_at(0.6, 0.005), 0, of_file);
  EXPECT_NEAR(6 * e[3'599].extra[1], 0, 0.005);
  EXPECT_NEAR(e.back().soc, w.soc.back(), 0.002);
}

TEST(ExtendedEstimator, ReadsTheOffsetOfASensorWhileTheCircuitIsOpen) {
  for (const double sensor_a : {-0.07, 0.07}) {
    const Work w = work_after_a_rest(sensor_a, 0);
    const measurement::StartingPoint start = starting_at(0.6, 0.005);
    const auto e = run_with_rest<float>(0.012, w.samples, start);
    EXPECT_NEAR(6 * e[59].extra[1], 0, 0.005) << "a minute first";
    EXPECT_NEAR(6 * e[3'599].extra[1], sensor_a, 0.012);
    EXPECT_LT(6 * e[3'599].extra[2], 0.012);
    EXPECT_NEAR(e.back().soc, w.soc.back(), 0.004);
    EXPECT_LE(std::abs(e.back().soc - w.soc.back()), 2 * e.back().soc_sigma);
    const auto fixed = run_with_rest<FixedPoint>(0.012, w.samples, start);
    EXPECT_NEAR(as_double(fixed.back().soc), static_cast<double>(e.back().soc), 2e-4);
    EXPECT_NEAR(as_double(fixed[3'599].extra[1]), static_cast<double>(e[3'599].extra[1]), 1e-4);
  }
}

TEST(ExtendedEstimator, TakesASmallCurrentAsItIsWhereTheCurrentAtRestIsUnknown) {
  const Work w = work_after_a_rest(0, -0.07);  // a display that is left on
  const auto e = run_with_rest<float>(0, w.samples, starting_at(0.6, 0.005));
  EXPECT_NEAR(6 * e[3'599].extra[1], 0, 0.01);
  EXPECT_NEAR(e[3'599].soc, w.soc[3'599], 0.002);
}

TEST(ExtendedEstimator, AGainMakesSigmaGrowWithTheChargeThatWasCounted) {
  // on the plateau no voltage helps; 6 A for 36 minutes are 60 % of 6 Ah
  const measurement::StartingPoint start = starting_at(0.9, 0.001);
  std::vector<measurement::Sample> out, out_and_back;
  for (std::uint64_t k = 0; k < 2'160; ++k) {
    out.push_back({k * 1'000'000, k == 0 ? 0 : -6'000'000, measurement::no_reading, 2'500});
    const std::int32_t current_ua = k < 1'080 ? -6'000'000 : 6'000'000;
    out_and_back.push_back({k * 1'000'000, k == 0 ? 0 : current_ua, measurement::no_reading, 2'500});
  }
  const auto without = run_with_rest<float>(0, out, start), with = run_with_rest<float>(0, out, start, 0.02);
  const auto sigma = [](const auto& e) { return static_cast<double>(e.back().soc_sigma); };
  EXPECT_NEAR(std::sqrt(sigma(with) * sigma(with) - sigma(without) * sigma(without)), 0.02 * 0.6, 0.0005);
  const auto returned = run_with_rest<float>(0, out_and_back, start, 0.02);
  EXPECT_NEAR(std::sqrt(sigma(returned) * sigma(returned) - sigma(without) * sigma(without)), 0.02 * 0.3, 0.0005)
      << "the variance of the middle stays";
}

TEST(ExtendedEstimator, EveryScalarGivesTheSameErrorStates) {
  const Work w = work(usual(some), 1'500, 0.77);
  const measurement::StartingPoint start = starting_at(0.77, 0.005);
  const auto float64 = run_with_errors<double, 3>(usual(some), w.samples, start);
  const auto float32 = run_with_errors<float, 3>(usual(some), w.samples, start);
  const auto fixed = run_with_errors<FixedPoint, 3>(usual(some), w.samples, start);
  for (std::size_t k = 0; k < w.samples.size(); ++k) {
    ASSERT_NEAR(float32[k].soc, float64[k].soc, 1e-4) << k;
    ASSERT_NEAR(as_double(fixed[k].soc), float64[k].soc, 2e-4) << k;
    ASSERT_NEAR(as_double(fixed[k].soc_sigma), float64[k].soc_sigma, 2e-4) << k;
    for (std::size_t i = 0; i < 3; ++i)
      ASSERT_NEAR(as_double(fixed[k].extra[i]), float64[k].extra[i], 1e-4) << k << " " << i;
  }
}

TEST(ExtendedEstimator, EveryScalarGivesTheSameEstimates) {
  const Work w = work(usual(some), 1'500, 0.77);
  const measurement::StartingPoint start = starting_at(0.77, 0.005);
  const auto float64 = run<double, 3>(table9_with<double>(usual(some)), w.samples, start);
  const auto float32 = run<float, 3>(table9_with<float>(usual(some)), w.samples, start);
  const auto fixed = run<FixedPoint, 3>(table9_with<FixedPoint>(usual(some)), w.samples, start);
  for (std::size_t k = 0; k < w.samples.size(); ++k) {
    ASSERT_NEAR(float32[k].soc, float64[k].soc, 5e-5) << k;
    ASSERT_NEAR(as_double(fixed[k].soc), float64[k].soc, 1e-4) << k;
    ASSERT_NEAR(as_double(fixed[k].soc_sigma), float64[k].soc_sigma, 1e-4) << k;
    for (std::size_t i = 0; i < 3; ++i) ASSERT_NEAR(float32[k].extra[i], as_double(fixed[k].extra[i]), 2e-5) << k;
  }
}

TEST(ExtendedEstimator, ACellWhoseMechanismsAreNeutralGivesThePlainCellsBits) {
  const Work w = work({}, 2'000, 0.77);
  auto neutral = default_setting(mechanism_index("resistance_growth"), tests::table9);
  const auto e = run<float, 0>(table9_with<float>({neutral}), w.samples, starting_at(0.77, 0.02));
  SocEstimator<float> plain(starting_at(0.77, 0.02));
  const auto cell = tests::prepared<float>();
  for (std::size_t k = 0; k < w.samples.size(); ++k)
    ASSERT_EQ(words(static_cast<const Estimate<float>&>(e[k])), words(plain.step(cell, w.samples[k]))) << k;
}

TEST(ExtendedEstimator, NothingThatComesInMakesTheStateNotANumber) {
  const auto cell = table9_with<float>(everything());
  std::mt19937_64 random(11);
  for (int round = 0; round < 30; ++round) {
    SocEstimator<float, ExtendedRc<4, mechanism_state_count>::Of> estimator;
    SocEstimator<float, ExtendedRc<4, mechanism_state_count, true>::Of> of_errors;
    std::uint64_t time_us = 0;
    for (int k = 0; k < 2'000; ++k) {
      time_us += random() % 5 == 0 ? random() >> (random() % 64) : random() % 2'000'000;
      const auto anything = [&](std::int32_t normal) {
        if (random() % 3 == 0) return static_cast<std::int32_t>(random());
        return random() % 7 == 0 ? measurement::no_reading : normal;
      };
      const auto e = estimator.step(
          cell, {time_us, anything(-3'000'000), anything(3'280'000), static_cast<std::int16_t>(random())});
      ASSERT_TRUE(std::isfinite(e.soc) && std::isfinite(e.soc_sigma) && std::isfinite(e.v_rc_v) &&
                  std::isfinite(e.voltage_predicted_v))
          << round << " " << k;
      for (const float x : e.extra) ASSERT_TRUE(std::isfinite(x)) << round << " " << k;
      ASSERT_GT(e.soc_sigma, 0);
      const auto more = of_errors.step(
          cell, {time_us, anything(-3'000'000), anything(3'280'000), static_cast<std::int16_t>(random())});
      ASSERT_TRUE(std::isfinite(more.soc) && std::isfinite(more.soc_sigma)) << round << " " << k;
      for (const float x : more.extra) ASSERT_TRUE(std::isfinite(x)) << round << " " << k;
    }
  }
}

TEST(ExtendedEstimator, CountsThroughASensorThatIsOff) {
  auto off = usual({"current_offset", "current_gain", "capacity_change"});
  const auto cell = table9_with<float>(off);
  SocEstimator<float, ExtendedRc<0, mechanism_state_count>::Of> estimator(starting_at(0.5, 0.005));
  estimator.step(cell, {0, 0, measurement::no_reading, 2'500});
  Estimate<float> e;
  for (std::uint64_t k = 1; k <= 3'600; ++k)
    e = estimator.step(cell, {k * 1'000'000, -1'200'000, measurement::no_reading, 2'500});
  const double true_a = (-1.2 - off[0].value[0]) / (1 + off[1].value[0]);
  EXPECT_NEAR(e.soc, 0.5 + true_a / (6 * (1 - 0.1)), 1e-6);
}

}  // namespace
}  // namespace bms::estimator
