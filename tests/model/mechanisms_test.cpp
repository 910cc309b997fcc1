#include "model/extended.hpp"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "arithmetic/dual_number.hpp"
#include "arithmetic/vector_width.hpp"
#include "model/extended_rc.hpp"
#include "tests/cells.hpp"
#include "tests/model/usual_mechanisms.hpp"

namespace bms::model {
namespace {

constexpr double capacity_ah = 6;

template <class S>
double number(const S& x) {
  if constexpr (Dual<S>)
    return x.a;
  else
    return as_double(x);
}

/// An hour of work: current, temperature, soc after the row.
struct Row {
  double time_s, duration_s, current_a, temperature_c;
};
std::vector<Row> input_of(std::size_t rows) {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<Row> all;
  double time_s = 0, current_a = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    const double step_s = k % 50 == 0 ? 0.1 : 1;
    const double duration_s = k == 0 ? 0 : step_s;
    time_s += duration_s;
    if (k % 20 == 0) current_a = k % 100 == 0 ? 0 : std::round(1e3 * (14 * uniform(random) - 8)) * 1e-3;
    all.push_back({time_s, duration_s, current_a, 20 + 10 * std::sin(1e-3 * time_s)});
  }
  return all;
}

class EveryMechanism : public ::testing::TestWithParam<std::size_t> {
 protected:
  const MechanismInfo& info() const { return catalogue[GetParam()]; }
};
INSTANTIATE_TEST_SUITE_P(Catalogue, EveryMechanism, ::testing::Range(std::size_t{0}, mechanism_count),
                         [](const auto& p) { return std::string(catalogue[p.param].id); });

/// `usual` values but strengths at their neutral ones.
MechanismValues<> without_strength(std::size_t index) {
  MechanismValues<> values = usual(catalogue[index].id).value;
  for (std::size_t k = 0; k < catalogue[index].parameters; ++k) {
    if (catalogue[index].parameter[k].role == Role::strength) values[k] = catalogue[index].parameter[k].neutral;
  }
  return values;
}

template <class S>
void expect_no_effect(std::size_t index) {
  ChosenLaws<S> laws;
  choose<S>(laws, index, without_strength(index), capacity_ah);
  const auto cell = tests::prepared<S>();
  auto x = laws.initial();
  for (const Row& row : input_of(200)) {
    const Current<S> a = Current<S>(row.current_a);
    const Temperature<S> c = Temperature<S>(row.temperature_c);
    const Soc<S> soc = Soc<S>(0.05 + 0.9 * row.time_s / 200);
    laws.at(row.time_s);
    ASSERT_EQ(number(laws.true_current(a)), number(a));
    ASSERT_EQ(number(laws.true_temperature(c)), number(c));
    const StepInput<S> input{a, TimeStep<S>(row.duration_s), c};
    ASSERT_EQ(number(laws.counted(input)), number(a));
    ASSERT_EQ(number(laws.ocv_soc(soc, x)), number(soc));
    ASSERT_EQ(number(laws.ocv_soc_slope(soc, x)), 1);
    const TablePoint<S> before = look_up(cell, soc);
    TablePoint<S> at = before;
    laws.tables(at, soc, input, x);
    for (const auto& [now, was] : {std::pair{number(at.ocv_v), number(before.ocv_v)},
                                   {number(at.ocv_delta_v), number(before.ocv_delta_v)},
                                   {number(at.r0_ohm), number(before.r0_ohm)},
                                   {number(at.r0_delta_ohm), number(before.r0_delta_ohm)},
                                   {number(at.r1_ohm), number(before.r1_ohm)},
                                   {number(at.r1_delta_ohm), number(before.r1_delta_ohm)},
                                   {number(at.c1_f), number(before.c1_f)},
                                   {number(at.c1_delta_f), number(before.c1_delta_f)}}) {
      ASSERT_EQ(now, was);
    }
    ASSERT_EQ(number(laws.advance(x, at, input, row.duration_s > 0)), 0);
    ASSERT_EQ(number(laws.reading(at.ocv_v)), number(at.ocv_v));
  }
}

template <class S>
void expect_exact_zero_to_stay() {
  std::vector<MechanismSetting> offset{usual("current_offset")};
  offset.front().value = {0.25};
  const auto laws = chosen<S>(offset, capacity_ah);
  EXPECT_EQ(number(laws.true_current(Current<S>(0))), 0) << "no instrument with an offset reads it";
  EXPECT_EQ(number(laws.true_current(Current<S>(0.25))), 0);
  EXPECT_EQ(number(laws.true_current(Current<S>(-0.5))), -0.75);
}

TEST(CurrentOffset, LeavesAReadingOfExactlyZero) {
  expect_exact_zero_to_stay<double>();
  expect_exact_zero_to_stay<float>();
  expect_exact_zero_to_stay<FixedPoint>();
}

TEST_P(EveryMechanism, ChangesNothingInAnyScalarWhileItsStrengthIsNeutral) {
  expect_no_effect<double>(GetParam());
  expect_no_effect<float>(GetParam());
  expect_no_effect<FixedPoint>(GetParam());
  expect_no_effect<ceres::Jet<double, 2>>(GetParam());
}

/// The filter's model over a drive, its soc given; and what ends as charge [A s].
template <class S>
struct Walk {
  std::vector<double> voltage_v;
  double charge_as = 0;
};
template <class S>
Walk<S> walk(const std::vector<MechanismSetting>& mechanisms, const std::vector<Row>& rows) {
  using Laws = ChosenLaws<S>;
  using Model = typename ExtendedRc<Laws::most_voltage_states, Laws::most_states>::template Of<S>;
  const ExtendedCell<S, max_intervals, Laws> cell{tests::prepared<S>(), chosen<S>(mechanisms, capacity_ah)};
  const Laws& laws = cell.laws;
  typename Model::State x{};
  const auto initial = laws.initial();
  for (std::size_t k = 0; k < initial.size(); ++k) x[1 + k] = initial[k];
  std::uint8_t interval = 0;
  double soc = 0.815;
  Walk<S> result;
  for (const Row& row : rows) {
    if (!(row.duration_s > 0)) continue;
    const StepInput<S> input{laws.true_current(Current<S>(row.current_a)), TimeStep<S>(row.duration_s),
                             laws.true_temperature(Temperature<S>(row.temperature_c))};
    result.charge_as += number(laws.counted(input)) * row.duration_s;
    soc += row.current_a * row.duration_s / 3'600 / capacity_ah;
    const auto at = look_up(OperatingPoint{cell, input, Model::mechanism_states(x)}, Soc<S>(soc), interval);
    x = Model::advance(x, at, Model::discretise(laws, x, at, input), input);
    result.voltage_v.push_back(number(Model::voltage(laws, x, at, input)));
  }
  return result;
}

TEST_P(EveryMechanism, ComputesTheSameVoltageInFloatAndFixedPointAsInDouble) {
  const auto rows = input_of(3'600);
  const std::vector<MechanismSetting> with = {usual(info().id)};
  const auto exact = walk<double>(with, rows), plain = walk<double>({}, rows);
  const auto single = walk<float>(with, rows);
  // 24 bits of 3.4 V are 0.2 uV; a state of an hour sums up as much as again at every step, most of which decays
  // fixed point: 4 nV, but currents, factors and rates in steps of 1e-6, 6e-8 and 4e-9
  constexpr double float_v = 3e-6, fixed_v = 1e-5;
  for (std::size_t k = 0; k < exact.voltage_v.size(); ++k)
    ASSERT_NEAR(single.voltage_v[k], exact.voltage_v[k], float_v) << k;
  EXPECT_NEAR(single.charge_as, exact.charge_as, 1e-6 * 6 * 3'600);
  if (info().needs_fpu) return;
  const auto fixed = walk<FixedPoint>(with, rows);
  for (std::size_t k = 0; k < exact.voltage_v.size(); ++k)
    ASSERT_NEAR(fixed.voltage_v[k], exact.voltage_v[k], fixed_v) << k;
  EXPECT_NEAR(fixed.charge_as, exact.charge_as, 1e-6 * 6 * 3'600);
  if (!info().on_board || info().id == TemperatureSensor::id) return;  // a temperature alone does nothing
  double most_v = 0;
  for (std::size_t k = 0; k < exact.voltage_v.size(); ++k)
    most_v = std::max(most_v, std::abs(exact.voltage_v[k] - plain.voltage_v[k]));
  EXPECT_GT(most_v + std::abs(exact.charge_as - plain.charge_as), 1e-4) << "it acts";
}

/// Open loop; parameters as they come.
template <class S>
std::vector<S> course(std::size_t index, const MechanismValues<S>& values, const std::vector<Row>& rows) {
  static const auto cell = tests::prepared<double>();
  ChosenLaws<S> laws;
  choose<S>(laws, index, values, capacity_ah);
  S start(0.815);
  if (index == mechanism_index("initial_soc")) start += values[0];
  OpenLoopSimulation<S> c(cell, capacity_ah, laws, start);
  std::vector<S> v;
  for (const Row& row : rows)
    v.push_back(c.step(row.time_s, row.duration_s, S(row.current_a), S(row.temperature_c), [](auto&, const auto&) {}));
  return v;
}

/// course() with each parameter an unknown.
template <class S>
std::vector<S> course_with_derivatives(std::size_t index, const MechanismValues<>& at, const std::vector<Row>& rows) {
  MechanismValues<S> values;
  for (std::size_t p = 0; p < at.size(); ++p) {
    values[p] = S(at[p]);
    if constexpr (requires { values[p].v.set(p, 1); })
      values[p].v.set(p, 1);
    else
      values[p].v[static_cast<int>(p)] = 1;
  }
  return course<S>(index, values, rows);
}

TEST_P(EveryMechanism, ADualNumberHasTheBitsOfAJetInVectorsOfAnyWidth) {
  using Jet = ceres::Jet<double, max_mechanism_parameters>;
  using Number = DualNumber<whole_registers(max_mechanism_parameters)>;
  const auto rows = input_of(600);
  const MechanismValues<> at = usual(info().id).value;
  const auto jets = course_with_derivatives<Jet>(GetParam(), at, rows);
  const auto expect_same = [&](const std::vector<Number>& numbers, const char* where) {
    const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x); };
    std::size_t others = 0;
    for (std::size_t k = 0; k < jets.size(); ++k) {
      others += bits(jets[k].a) != bits(numbers[k].a);
      for (std::size_t p = 0; p < at.size(); ++p)
        others += bits(jets[k].v[static_cast<int>(p)]) != bits(numbers[k].v[p]);
    }
    EXPECT_EQ(others, 0U) << where;
  };
  std::vector<Number> numbers;
  const auto simulate = [&] { numbers = course_with_derivatives<Number>(GetParam(), at, rows); };
  for_any_processor(simulate);
  expect_same(numbers, "for any processor");
  if (!has_avx2()) return;
  numbers.clear();
  with_avx2(simulate);
  expect_same(numbers, "with AVX2");
}

TEST_P(EveryMechanism, DerivativesOfTheVoltageByItsParametersAreDifferenceQuotients) {
  using Jet = ceres::Jet<double, max_mechanism_parameters>;
  const auto rows = input_of(1'200);
  const std::size_t index = GetParam();
  const MechanismValues<> base = usual(info().id).value;
  MechanismValues<Jet> jets;
  for (std::size_t p = 0; p < info().parameters; ++p) jets[p] = Jet(base[p], static_cast<int>(p));
  const auto v = course<Jet>(index, jets, rows);
  const auto plain = course<double>(index, base, rows);
  for (std::size_t p = 0; p < info().parameters; ++p) {
    if (info().parameter[p].role == Role::given) continue;
    const double step = 1e-5 * std::max(std::abs(base[p]), 1e-3);
    MechanismValues<> more = base, less = base;
    more[p] += step;
    less[p] -= step;
    const auto above = course<double>(index, more, rows), below = course<double>(index, less, rows);
    double scale = 1e-9;
    for (const Jet& j : v) scale = std::max(scale, std::abs(j.v[static_cast<int>(p)]));
    std::size_t off = 0;
    for (std::size_t k = 0; k < v.size(); ++k) {
      ASSERT_NEAR(v[k].a, plain[k], 1e-12);
      const double difference = (above[k] - below[k]) / (2 * step);
      if (std::abs(v[k].v[static_cast<int>(p)] - difference) > 2e-5 * scale + 1e-11 / step) ++off;
    }
    EXPECT_LE(off, v.size() / 100) << info().parameter[p].name
                                   << ": only where the quotient reaches over a kink of the tables";
  }
}

TEST(Catalogue, EveryMechanismHasBoundsThatHoldItsNeutralValueAndAtLeastOneStrength) {
  ASSERT_EQ(usual_mechanisms().size(), mechanism_count);
  for (std::size_t k = 0; k < mechanism_count; ++k) {
    const MechanismInfo& info = catalogue[k];
    EXPECT_EQ(mechanism_index(info.id), k) << "each id once";
    bool strength = false;
    for (std::size_t p = 0; p < info.parameters; ++p) {
      strength = strength || info.parameter[p].role == Role::strength;
      EXPECT_LT(info.parameter[p].low, info.parameter[p].high) << info.id;
    }
    EXPECT_TRUE(strength) << info.id;
    EXPECT_EQ(first_fault(usual(info.id), capacity_ah), info.parameters) << info.id;
  }
}

TEST(Laws, KnownAtCompileTimeGiveTheSameDigitsAsChosenAtRunTime) {
  const auto chosen_laws = chosen<float>(
      usual({"ocv_hysteresis", "slow_polarisation", "temperature_resistance", "current_offset"}), capacity_ah);
  const auto law = []<class M>(M) {
    std::array<double, M::parameters.size()> p{};
    for (std::size_t k = 0; k < p.size(); ++k) p[k] = usual(M::id).value[k];
    return typename M::template Law<float>(p, capacity_ah);
  };
  const Laws<float, CurrentOffset, SlowPolarisation, OcvHysteresis, TemperatureResistance> laws(
      law(CurrentOffset{}), law(SlowPolarisation{}), law(OcvHysteresis{}), law(TemperatureResistance{}));
  EXPECT_EQ(laws.most_states, 3U);
  EXPECT_EQ(laws.voltage_states(), chosen_laws.voltage_states());
  const auto cell = tests::prepared<float>();
  auto x = laws.initial();
  auto y = chosen_laws.initial();
  for (const Row& row : input_of(1'000)) {
    const StepInput<float> input{laws.true_current(static_cast<float>(row.current_a)),
                                 static_cast<float>(row.duration_s), static_cast<float>(row.temperature_c)};
    ASSERT_EQ(input.current_a, chosen_laws.true_current(static_cast<float>(row.current_a)));
    TablePoint<float> at = look_up(cell, 0.63F), there = at;
    laws.tables(at, 0.63F, input, x);
    chosen_laws.tables(there, 0.63F, input, y);
    ASSERT_EQ(at.r1_ohm, there.r1_ohm);
    ASSERT_EQ(laws.advance(x, at, input, true), chosen_laws.advance(y, there, input, true));
  }
}

/// The change of both branches by this formula, from slow runs of a cell at several temperatures.
TEST(BranchTemperature, MovesTheBranchesApartByArrhenius) {
  const double half_gap_v = 0.022;
  const std::array<double, 13> p{1, 0.4, 0.2, 0.3, 0.018, 0.004, 0.001, -0.003, 80'000, 50'000, 30'000, 32'000, 25};
  const BranchTemperature::Law<double> growth(p, capacity_ah);
  const OcvHysteresis::Law<double> hysteresis(std::array<double, 5>{half_gap_v, 40, 0, 0, 1}, capacity_ah);
  struct Node {
    double soc, gap, shift_v, energy;
  };
  for (const Node& n : {Node{0.05, 1, 0.018, 80'000}, Node{0.175, 0.7, 0.011, 65'000}, Node{0.5, 0.2, 0.001, 30'000},
                        Node{0.95, 0.3, -0.003, 32'000}}) {
    for (const double c : {45.0, 25.0, 5.0, -15.0}) {
      const double factor = std::exp(std::min(4.5, n.energy / 8.314462618 * (1 / (c + 273.15) - 1 / 298.15))) - 1;
      for (const double h : {-1.0, 0.3, 1.0}) {
        TablePoint<double> at{};
        at.ocv_v = 3.3;
        growth.tables(at, n.soc, {-1, 1, c});
        hysteresis.apply_state(at, half_gap_v * h, {-1, 1, c});
        // the state itself is added with the other voltage states
        EXPECT_NEAR(at.ocv_v - 3.3, h * half_gap_v * n.gap * factor - n.shift_v * factor, 1e-9)
            << n.soc << ' ' << c << ' ' << h;
      }
    }
  }
}

TEST(OcvHysteresis, SaturatesAtTheBranchesAndForgetsNothingAtRest) {
  const OcvHysteresis::Law<double> law(std::array<double, 5>{0.01, 40, 0, 0, 0}, capacity_ah);
  const TablePoint<double> at{};
  double x = 0;
  for (int k = 0; k < 3'600; ++k) x = relaxed<double>(x, law.relaxation(0, at, {6, 1}, &x));
  EXPECT_NEAR(x, 0.01, 1e-12);
  for (int k = 0; k < 180; ++k) x = relaxed<double>(x, law.relaxation(0, at, {-3, 1}, &x));  // 1/40 of the capacity
  const double moved = x;
  EXPECT_NEAR(x, -0.01 + 0.02 * std::exp(-1), 1e-12);
  for (int k = 0; k < 1'000; ++k) x = relaxed<double>(x, law.relaxation(0, at, {0, 3'600}, &x));
  EXPECT_EQ(x, moved);
}

TEST(OcvHysteresis, BetweenMeasuredBranchesMovesWithTheChargeAndStops) {
  const OcvHysteresis::Law<double> law(std::array<double, 5>{0.01, 40, 0, 0, 1}, capacity_ah);
  TablePoint<double> at{};
  double x = -0.01;
  for (int k = 0; k < 45; ++k)
    x = relaxed<double>(x, law.relaxation(0, at, {6, 1}, &x));  // 1/80 of the capacity: half of the way to the middle
  EXPECT_NEAR(x, -0.005, 1e-12);
  for (int k = 0; k < 45; ++k) x = relaxed<double>(x, law.relaxation(0, at, {-6, 1}, &x));
  EXPECT_NEAR(x, -0.01, 1e-12) << "what is given back is given back";
  for (int k = 0; k < 100; ++k) x = relaxed<double>(x, law.relaxation(0, at, {-6, 1}, &x));
  EXPECT_NEAR(x, -0.01, 1e-12);
  x = relaxed<double>(x, law.relaxation(0, at, {6, 3'600}, &x));
  EXPECT_EQ(x, 0.01);
  at.ocv_v = 3.3;
  at.gap = 1.5;
  law.apply_state(at, x, {});
  EXPECT_NEAR(at.ocv_v + x, 3.3 + 1.5 * 0.01, 1e-12) << "the state is added besides";
}

/// Charge branch and discharge branch are the curves that the file was made of.
TEST(OcvHysteresis, FollowsTheShapeOfTheFilesGap) {
  CellParameters<> p = tests::table9;
  p.ocv.half_gap_v = {};
  for (std::size_t k = 0; k < p.ocv.soc.size; ++k)
    p.ocv.half_gap_v.push_back(0.01 + 0.01 * std::abs(p.ocv.soc[k] - 0.5));
  const double middle_v = plateau_half_gap_v(p.ocv);
  EXPECT_NEAR(middle_v, 0.012, 0.001);
  const auto cell = prepare<double, max_intervals>(p);
  auto setting = default_setting(mechanism_index("ocv_hysteresis"), tests::table9);
  setting.value = {middle_v, 40, 0, -1, 1};
  const auto laws = chosen<double>(std::vector{setting}, capacity_ah);
  const auto x = laws.initial();
  for (std::size_t k = 1; k + 1 < p.ocv.soc.size; ++k) {
    TablePoint<double> at = look_up(cell, p.ocv.soc[k]);
    const double middle = at.ocv_v;
    laws.tables(at, p.ocv.soc[k], StepInput<double>{-1, 1, 25}, x);
    EXPECT_NEAR(middle - (at.ocv_v + x[0]), p.ocv.half_gap_v[k], 1e-9) << p.ocv.soc[k];
  }
}

TEST(Arrhenius, IsTheExponentialLaw) {
  const auto off = []<class S>(S, double energy, double reference_c, double c) {
    const double exact =
        std::exp(energy / mechanism_detail::gas_constant_j_per_mol_k * (1 / (c + 273.15) - 1 / (reference_c + 273.15)));
    const auto factor = mechanism_detail::arrhenius<S>(Factor<S>(mechanism_detail::energy_over_rt(energy, reference_c)),
                                                       Temperature<S>(reference_c), Temperature<S>(c));
    return std::abs(number(factor) / exact - 1);
  };
  for (const double energy : {-20'000.0, 0.0, 15'000.0, 60'000.0}) {
    for (double c = -20; c <= 60; c += 3.7) {
      EXPECT_LT(off(double{}, energy, 25, c), 1e-13) << energy << " " << c;
      EXPECT_LT(off(float{}, energy, 25, c), 1e-5) << energy << " " << c;
      EXPECT_LT(off(FixedPoint{}, energy, 25, c), 2e-6) << energy << " " << c;
    }
  }
  EXPECT_EQ(mechanism_detail::arrhenius<double>(20, 25, -273), 1) << "no temperature";
}

TEST(OcvShape, KeepsTheEndsAndSlidesByWhatItSaysInBetween) {
  const OcvShape::Law<double> law(std::array<double, 2>{0.05, -0.03}, capacity_ah);
  EXPECT_EQ(law.ocv_soc(0), 0);
  EXPECT_EQ(law.ocv_soc(1), 1);
  EXPECT_EQ(law.ocv_soc(-0.1), -0.1);
  EXPECT_EQ(law.ocv_soc(1.1), 1.1);
  EXPECT_NEAR(law.ocv_soc(0.2), 0.25, 1e-12);
  EXPECT_NEAR(law.ocv_soc(0.8), 0.77, 1e-12);
  for (double soc = 0.01; soc < 1; soc += 0.017)
    EXPECT_NEAR(law.ocv_soc_slope(soc), (law.ocv_soc(soc + 1e-6) - law.ocv_soc(soc - 1e-6)) / 2e-6, 1e-8) << soc;
}

TEST(SelfHeating, ReachesTheTemperatureOfItsThermalResistance) {
  const SelfHeating::Law<double> law(std::array<double, 4>{10, 900, 25'000, 25}, capacity_ah);
  TablePoint<double> at{};
  at.r0_ohm = 0.03;
  at.r1_ohm = 0.02;
  double w = 0;
  for (int k = 0; k < 20'000; ++k) w = relaxed<double>(w, law.relaxation(0, at, {-6, 1}));
  EXPECT_NEAR(100 * w, 10 * 36 * 0.05, 1e-6);
  law.apply_state(at, w, {});
  EXPECT_NEAR(at.r0_ohm / 0.03, std::exp(25'000 / 8.314462618 * (1 / (298.15 + 18) - 1 / 298.15)), 1e-9);
}

TEST(SlowPolarisation, IsAheadOfTheChargeThatIsCounted) {
  // the OCV is that of a cell ahead in soc by what the polarisation says; R0 and v_rc are not
  const auto cell = tests::prepared<double>();
  const std::vector<MechanismSetting> slow = {
      {mechanism_index("slow_polarisation"), {0.003, 100, 0, 8 * 0.003 * 3'600 * capacity_ah}, {}}};
  OpenLoopSimulation<double> with(cell, capacity_ah, chosen<double>(slow, capacity_ah), 0.3),
      without(cell, capacity_ah, ChosenLaws<double>{}, 0.3);
  const auto no_change = [](TablePoint<double>&, double) {};
  const double r_ohm = 0.003 + 1e-4 / capacity_ah, soc_shift_per_v = 8 * 0.003 / r_ohm;
  double u_v = 0;
  for (int k = 0; k < 3'000; ++k) {
    const double a = k < 1'000 ? -3 : 0, dt = k == 0 ? 0 : 1;
    const double before_v = u_v;
    if (k > 0) u_v += -std::expm1(-0.01) * (r_ohm * a - u_v);
    const double v = with.step(k, dt, a, 25, no_change), base_v = without.step(k, dt, a, 25, no_change);
    ASSERT_NEAR(v - base_v,
                u_v + look_up(cell, with.soc() + soc_shift_per_v * before_v).ocv_v - look_up(cell, with.soc()).ocv_v,
                1e-12)
        << k;
  }
}

TEST(LoadMemory, FollowsChargeAndDischargeByAResistanceOfItsOwn) {
  const auto cell = tests::prepared<double>();
  const std::vector<MechanismSetting> memory = {{mechanism_index("load_memory"), {0.004, -0.003, 200}, {}}};
  OpenLoopSimulation<double> with(cell, capacity_ah, chosen<double>(memory, capacity_ah), 0.5),
      without(cell, capacity_ah, ChosenLaws<double>{}, 0.5);
  const auto no_change = [](TablePoint<double>&, double) {};
  double u_v = 0;
  for (int k = 1; k < 3'000; ++k) {
    const double a = std::array{3, -3, 0}[static_cast<std::size_t>(k) / 1'000];
    u_v += -std::expm1(-1.0 / 200) * ((a > 0 ? 0.004 : -0.003) * a - u_v);
    const double v = with.step(k, 1, a, 25, no_change), base_v = without.step(k, 1, a, 25, no_change);
    ASSERT_NEAR(v - base_v, u_v, 1e-12) << k;
    if (k == 999 || k == 1'999) {  // up in charge, and in discharge as well
      EXPECT_NEAR(v - base_v, k == 999 ? 0.012 : 0.009, 1e-4);
    }
  }
}

/// table9 with mechanisms that depend on the temperature, valid at a temperature. What a cell file of 25 degrees C
/// states is converted here by formulas of this test. self_heating keeps the reference of 25 degrees C for its own.
struct ReferencedCell {
  explicit ReferencedCell(double reference_c) {
    const double by = 1 / 8.314462618 * (1 / (reference_c + 273.15) - 1 / 298.15), r0_a = std::exp(50'000 * by),
                 r1_a = std::exp(40'000 * by), entropy_v_per_k = 2e-4;
    p.reference_temperature_c = reference_c;
    for (std::size_t k = 0; k < p.rc.soc.size; ++k) {
      p.rc.r0_ohm[k] *= 0.7 + 0.3 * r0_a;
      p.rc.r1_ohm[k] *= r1_a;
    }
    for (std::size_t k = 0; k < p.ocv.b0_v.size; ++k) p.ocv.b0_v[k] += entropy_v_per_k * (reference_c - 25);
    add("fast_polarisation", {0.002 * r1_a, 1.5});
    add("self_heating", {8, 900, 25'000, 25});
    add("temperature_resistance", {50'000, 40'000});
    settings.back().value[3] = 0.3 * r0_a / (0.7 + 0.3 * r0_a);
    add("entropic_ocv", {entropy_v_per_k, entropy_v_per_k, entropy_v_per_k, entropy_v_per_k});
  }
  void add(std::string_view id, std::initializer_list<double> values) {
    std::copy(values.begin(), values.end(),
              settings.emplace_back(default_setting(mechanism_index(id), p)).value.begin());
  }
  std::vector<double> voltages() const {
    const auto cell = tests::prepared<double>(p);
    OpenLoopSimulation<double> simulation(cell, p.capacity_ah, chosen<double>(settings, p.capacity_ah), 0.6);
    std::vector<double> all;
    for (const Row& r : input_of(3'000)) {
      all.push_back(simulation.step(r.time_s, r.duration_s, r.current_a, r.temperature_c - 15,
                                    [](TablePoint<double>&, double) {}));
    }
    return all;
  }
  CellParameters<> p = tests::table9;
  std::vector<MechanismSetting> settings;
};

TEST(ReferenceTemperature, TheSameCellAtAnotherReferenceHasTheSameVoltages) {
  const std::vector<double> at_25 = ReferencedCell(25).voltages();
  for (const double reference_c : {20.0, 32.0}) {
    const ReferencedCell other(reference_c);
    EXPECT_EQ(other.settings[2].value[2], reference_c) << "temperature_resistance takes the cell's";
    EXPECT_EQ(other.settings[3].value[4], reference_c) << "entropic_ocv takes the cell's";
    const std::vector<double> v = other.voltages();
    for (std::size_t k = 0; k < v.size(); ++k) ASSERT_NEAR(v[k], at_25[k], 1e-12) << k;
  }
}

TEST(SelfHeating, TakesTheReferenceTemperatureOfTheCell) {
  CellParameters<> p = tests::table9;
  p.reference_temperature_c = 5;
  const auto setting = default_setting(mechanism_index("self_heating"), p);
  const SelfHeating::Law<double> law(std::array<double, 4>{10, 900, 25'000, setting.value[3]}, capacity_ah);
  TablePoint<double> at{};
  at.r0_ohm = 0.03;
  law.apply_state(at, 0.18, {});
  EXPECT_NEAR(at.r0_ohm / 0.03, std::exp(25'000 / 8.314462618 * (1 / (278.15 + 18) - 1 / 278.15)), 1e-9);
}

TEST(TemperatureResistance, LeavesTheShareOfContactsAndFoilsAlone) {
  const TemperatureResistance::Law<double> law(std::array<double, 8>{50'000, 40'000, 25, 0.3, 0, 0, 0, 1}, capacity_ah);
  for (const double c : {-20.0, 0.0, 25.0, 45.0}) {
    TablePoint<double> at{};
    at.r0_ohm = 0.01;
    at.r1_ohm = 0.02;
    law.tables(at, 0.5, {1, 1, c});
    const double by = 1 / 8.314462618 * (1 / (c + 273.15) - 1 / 298.15);
    EXPECT_NEAR(at.r0_ohm, 0.01 * (0.7 + 0.3 * std::exp(50'000 * by)), 1e-9) << c;
    EXPECT_NEAR(at.r1_ohm, 0.02 * std::exp(40'000 * by), 1e-9) << c;
  }
}

/// Resistance R1 of 2 mohm by the law.
template <class S>
double r1_ohm(const std::array<double, 8>& p, double soc, double c) {
  const TemperatureResistance::Law<S> law(p, capacity_ah);
  TablePoint<S> at{};
  at.r0_ohm = at.r1_ohm = Resistance<S>(0.002);
  at.per_width = PerSoc<S>(1.0);
  law.tables(at, Soc<S>(soc), {Current<S>(1), TimeStep<S>(1), Temperature<S>(c)});
  return as_double(at.r1_ohm);
}

/// An energy that saturates between two nodes would make R1 a hundred times too large there.
TEST(TemperatureResistance, FixedPointRefusesEnergiesThatItCannotHold) {
  int refused = 0;
  for (const double energy : {30'000.0, 60'000.0, 90'000.0}) {
    for (const double more : {-1.0, 0.0, 1.3, 4.0}) {
      for (const double reference_c : {-30.0, 25.0}) {
        const std::array<double, 8> p{20'000, energy, reference_c, 1, more, more, 0, 1};
        std::array<double, max_mechanism_parameters> values{};
        std::copy(p.begin(), p.end(), values.begin());
        const bool fits = TemperatureResistance::fits_fixed_point(values, capacity_ah);
        refused += fits ? 0 : 1;
        if (!fits) continue;
        for (const double c : {-20.0, 10.0, 40.0}) {
          for (double soc = 0.05; soc < 1; soc += 0.05) {
            const double exact = r1_ohm<double>(p, soc, c);
            EXPECT_NEAR(r1_ohm<FixedPoint>(p, soc, c), exact, 0.01 * exact + 1e-6)
                << energy << " " << more << " " << soc;
          }
        }
      }
    }
  }
  EXPECT_EQ(refused, 3) << "60 kJ/mol five times at -30 degrees C, 90 kJ/mol five times";
}

}  // namespace
}  // namespace bms::model
