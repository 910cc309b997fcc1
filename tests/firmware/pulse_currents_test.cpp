// The message PulseCurrents of the real application with sixteen cells of evidence/plant: a truck that draws at random
// what it says, for as long as it says, is never forbidden to, and nothing opens.
#include "firmware/pulse_currents.hpp"

#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "firmware/pulse_model.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"
#include "tests/firmware/application_fixture.hpp"

namespace bms::firmware {
namespace {

constexpr std::size_t cells = 16;
constexpr double step_s = 0.1, capacity_ah = 6, continuous_a = 6;
constexpr double rated_10s_a = 18, rated_30s_a = 12, charge_10s_a = 9;

/// The cell table9 with ratings of 3 and 2 times the continuous current, and of 1.5 times for a charge of 10 s. Its
/// resistances are OhmTimes as large, and its file says so.
template <int OhmTimes>
struct RatedCell : Table9Board<cells> {
  using Pulses = PulsePublisher;
  static const auto& tables() {
    static const auto of_file = [] {
      auto parameters = tests::table9;
      for (std::size_t k = 0; k < parameters.rc.soc.size; ++k) {
        parameters.rc.r0_ohm[k] *= OhmTimes;
        parameters.rc.r1_ohm[k] *= OhmTimes;
        parameters.rc.c1_f[k] /= OhmTimes;
      }
      return model::prepare<float, model::max_intervals>(parameters);
    }();
    return of_file;
  }
  static estimator::Estimate<float> step(Estimator& estimator, const measurement::Sample& sample) {
    return estimator.step(tables(), sample);
  }
  static void update_condition(estimator::Condition<Estimator>& condition, const Estimator& estimator,
                               const measurement::Sample& sample, const estimator::Estimate<float>& e,
                               bool limits_wanted) {
    condition.update(tables(), sample, e, estimator, limits_wanted);
  }
  static const protection::ProtectionPlan& plan() {
    static const auto plan = [] {
      protection::PackDesign d = design(step_s);
      d.pulses = {.temperature_min_c = 10,
                  .charge = {.for_10s_a = charge_10s_a},
                  .discharge = {.for_10s_a = rated_10s_a, .for_30s_a = rated_30s_a}};
      return protection::protection_plan(d);
    }();
    return plan;
  }
  static PulseModel pulse_model(const Estimator& estimator, const Snapshot<Estimator, cells>& now) {
    auto own = tables();
    return firmware::pulse_model(own, estimator, now);
  }
};

plant::CellParameters plant_cell(int ohm_times) {
  plant::CellParameters p;
  const auto times = [](const plant::MonotoneCurve& curve, double factor) {
    std::vector<plant::Point> points;
    for (int k = 0; k <= 100; ++k) points.push_back({k / 100.0, factor * curve.at(k / 100.0)});
    return plant::MonotoneCurve(points);
  };
  p.circuit = {times(p.circuit.r0_ohm, ohm_times), times(p.circuit.r1_ohm, ohm_times),
               times(p.circuit.c1_f, 1.0 / ohm_times)};
  return p;
}

/// A battery that is closed for a truck.
template <int OhmTimes = 1>
class Truck {
 public:
  Truck(double soc, double celsius, std::uint64_t seed) : random_(seed), celsius_(celsius) {
    begin();
    for (std::size_t k = 0; k < cells; ++k)
      cells_.emplace_back(plant_cell(OhmTimes), plant::CellState{soc + 0.004 * (random_.uniform() - 0.5), 0, celsius});
    application_.emplace(measurement::StartingPoint{static_cast<std::int32_t>(1e9 * soc), 10'000'000},
                         messages::Identity{0, 0}, static_cast<float>(capacity_ah), persistence_);
  }
  ~Truck() { begin(); }
  Truck(const Truck&) = delete;
  Truck& operator=(const Truck&) = delete;

  void step(double wanted_a) {
    now_s_ += step_s;
    const bool closed = switched.main_plus && switched.main_minus;
    const double current_a = closed ? wanted_a : 0;
    double pack_v = 0;
    for (auto& cell : cells_) {
      cell.run(current_a, celsius_, step_s);
      pack_v += cell.voltage_v();
    }
    if (closed)
      dc_link_v_ = pack_v;
    else if (switched.precharge && switched.main_minus)
      dc_link_v_ += (pack_v - dc_link_v_) * (1 - std::exp(-step_s / 0.5));
    set_link(pack_v, dc_link_v_);
    measurement::PackSample<cells> sample{};
    sample.time_us = static_cast<std::uint64_t>(std::llround(1e6 * now_s_));
    // of a 1 % sensor
    sample.current_ua = static_cast<std::int32_t>(std::lround(1e6 * current_a * sensor_gain));
    const auto noise = static_cast<std::int32_t>(std::lround(10 * now_s_)) % 3;
    for (std::size_t k = 0; k < cells; ++k)
      sample.cell_uv[k] = static_cast<std::int32_t>(std::lround(1e6 * cells_[k].voltage_v())) + 40 * noise;
    sample.pack_uv = static_cast<std::int32_t>(std::lround(1e6 * pack_v));
    for (std::size_t k = 0; k < sample.temperature_cdegc.size(); ++k)
      sample.temperature_cdegc[k] = static_cast<std::int16_t>(std::lround(100 * cells_[5 * k].temperature_c()) + noise);
    if (std::lround(now_s_ / step_s) % 10 == 0) ask();
    sent.clear();
    application_->process_sample(sample);
    if (const auto m = last<can::PulseCurrents>()) pulses = *m;
    if (const auto m = last<can::AllowedCurrent>()) allowed = *m;
    if (const auto m = last<can::Faults>()) faults = *m;
  }
  bool closes() {
    for (int k = 0; k < 300 && !(closed() && allowed.discharge >= continuous_a - 0.03F); ++k) step(0);
    return closed();
  }
  bool closed() const { return switched.main_plus && switched.main_minus; }
  double soc() const { return cells_[0].soc(); }
  void run(double amperes, double seconds) {
    for (int k = 0; k < std::lround(seconds / step_s); ++k) step(amperes);
  }

  double sensor_gain = 1;
  can::PulseCurrents pulses{};
  can::AllowedCurrent allowed{};
  can::Faults faults{};

 private:
  void ask() {
    can::Command command;
    command.code = can::Command::code_request;
    command.argument = 1;
    counter_ = can::next(counter_);
    requests.push_back(command.frame(counter_));
  }

  plant::Random random_;
  double celsius_, now_s_ = 0, dc_link_v_ = 0;
  std::uint8_t counter_ = 0;
  std::vector<plant::Cell> cells_;
  storage::Persistence persistence_;
  std::optional<Application<RatedCell<OhmTimes>>> application_;
};

TEST(PulseCurrents, AreTheRatingsFromRestAndGoDownWithTheHeatOfThePulsesAndUpWithRest) {
  Truck<> truck(0.6, 25, 1);
  ASSERT_TRUE(truck.closes());
  truck.run(0, 5);
  EXPECT_FLOAT_EQ(truck.pulses.discharge_ten_seconds, rated_10s_a);
  EXPECT_FLOAT_EQ(truck.pulses.discharge_thirty_seconds, rated_30s_a);
  EXPECT_FLOAT_EQ(truck.pulses.charge_ten_seconds, charge_10s_a);
  EXPECT_FLOAT_EQ(truck.pulses.charge_thirty_seconds, 6.75F) << "not rated: what the integral carries for 30 s";
  truck.run(-rated_10s_a, 5);
  const auto half = truck.pulses;
  EXPECT_LT(half.discharge_ten_seconds, rated_10s_a);
  EXPECT_LT(half.discharge_thirty_seconds, rated_30s_a);
  EXPECT_GT(half.discharge_ten_seconds, continuous_a);
  EXPECT_FLOAT_EQ(half.charge_ten_seconds, charge_10s_a) << "the other direction has its own heat";
  truck.run(-rated_10s_a, 4.9);
  EXPECT_LT(truck.pulses.discharge_ten_seconds, half.discharge_ten_seconds);
  EXPECT_GE(truck.pulses.discharge_ten_seconds, continuous_a) << "the continuous current flows for ever";
  truck.run(0, 20);
  EXPECT_LT(truck.pulses.discharge_ten_seconds, rated_10s_a);
  truck.run(0, 120);
  EXPECT_FLOAT_EQ(truck.pulses.discharge_ten_seconds, rated_10s_a);
  EXPECT_TRUE(truck.closed());
}

TEST(PulseCurrents, AreTheAllowedCurrentWhileThatIsDeratedAndNothingWhileOpen) {
  for (const double celsius : {-8.0, 8.0, 49.0, 52.0}) {
    Truck<> truck(0.6, celsius, 2);
    truck.step(0);
    EXPECT_EQ(truck.pulses.discharge_ten_seconds, 0) << "open";
    truck.closes();
    truck.run(0, 20);
    const bool derated = truck.allowed.discharge<continuous_a - 0.03F, near = celsius> 45;
    EXPECT_EQ(derated, celsius == -8.0 || celsius == 52.0);
    if (derated || near) {
      EXPECT_LE(truck.pulses.discharge_ten_seconds, truck.allowed.discharge);
      EXPECT_GT(truck.pulses.discharge_ten_seconds, truck.allowed.discharge - 0.26F);
    } else {
      EXPECT_GT(truck.pulses.discharge_ten_seconds, 1.3 * continuous_a) << "without ratings, in the cold: 2 L for 10 s";
      EXPECT_LT(truck.pulses.discharge_ten_seconds, 2.1 * continuous_a);
    }
    EXPECT_LE(truck.pulses.charge_ten_seconds, truck.allowed.charge + 1e-4F) << "cold or warm for a charge";
  }
}

/// Random pulses in both directions, from full to empty, cold, warm and hot, with both ends of the sensor's error. The
/// truck looks at the message, begins, and ends after the time of the signal, whatever comes meanwhile.
template <int OhmTimes>
void drive_at_random(int drives, int least_above) {
  plant::Random random(2'911);
  int pulses = 0, above = 0;
  for (int drive = 0; drive < drives; ++drive) {
    const double celsius = std::array{25.0, 11.5, 49.0, 8.0, -2.0, 39.2}[static_cast<std::size_t>(drive) % 6];
    const double anywhere = 0.15 + 0.8 * random.uniform();
    const double soc = std::array{0.93, 0.16, anywhere, anywhere}[static_cast<std::size_t>(drive) % 4];
    Truck<OhmTimes> truck(soc, celsius, 100 + static_cast<std::uint64_t>(drive));
    truck.sensor_gain = drive % 2 == 0 ? 1.01 : 0.99;
    truck.closes();
    for (int k = 0; k < 60 && truck.soc() > 0.05; ++k) {
      const bool charges = random.uniform() < 0.4, longer = random.uniform() < 0.4;
      const can::PulseCurrents& m = truck.pulses;
      const double charge_a = longer ? m.charge_thirty_seconds : m.charge_ten_seconds,
                   discharge_a = longer ? m.discharge_thirty_seconds : m.discharge_ten_seconds,
                   most_a = charges ? charge_a : discharge_a;
      const double most_s = longer ? 30 : 10;
      const double part_s = random.uniform() < 0.6 ? most_s : most_s * random.uniform();
      const double a = (charges ? 1 : -1) * most_a * (random.uniform() < 0.7 ? 1 : random.uniform());
      truck.run(a, part_s);
      ++pulses;
      above += std::abs(a) > 1.06 * continuous_a && part_s == most_s ? 1 : 0;
      const can::Faults& f = truck.faults;
      ASSERT_TRUE(truck.closed() && !f.charge_overcurrent && !f.discharge_overcurrent && truck.allowed.discharge > 0)
          << fmt::format("drive {}, pulse {}: {:.2f} A for {:.1f} s at {} degC, soc {:.3f}, cause {}", drive, pulses, a,
                         part_s, celsius, truck.soc(), f.first_cause);
      const double rest_a = -0.5 * static_cast<double>(truck.allowed.discharge) * random.uniform();
      truck.run(rest_a, random.uniform() < 0.5 ? 1 : 60 * random.uniform());
    }
  }
  fmt::print("{} pulses, {} of them above the continuous current for their whole time\n", pulses, above);
  EXPECT_GT(above, least_above);
}

TEST(PulseCurrents, OfAnyProfileAreNeitherForbiddenNorOpenedOn) { drive_at_random<1>(24, 250); }

/// Three times the resistance: the voltage of the cells ends the pulses.
TEST(PulseCurrents, OfACellWithALargeResistanceAreNeitherForbiddenNorOpenedOn) { drive_at_random<3>(24, 80); }

}  // namespace
}  // namespace bms::firmware
