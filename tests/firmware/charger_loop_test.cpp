// Sixteen cells and a charger around the real application, ten samples a second: from 20 % to full by both protocols,
// and with chargers that fail. The chargers are written from what their makers publish (firmware/can/messages.md), the
// cells are those of evidence/plant; neither shares code with the firmware.
#include <cmath>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "firmware/cia418_profile.hpp"
#include "firmware/elcon_profile.hpp"
#include "plant/truth_cell.hpp"
#include "tests/firmware/application_fixture.hpp"
#include "tests/firmware/charger_models.hpp"

namespace bms::firmware {
namespace {

constexpr std::size_t cells = 16;
constexpr double step_s = 0.1, capacity_ah = 6;

/// The forklift board with the cell table9.
struct LoopCell : Table9Board<cells> {
  static const protection::ProtectionPlan& plan() {
    static const auto plan = protection::protection_plan(design(step_s));
    return plan;
  }
};

template <class Profile, class Plugged>
class Loop {
 public:
  explicit Loop(double soc) {
    begin();
    for (std::size_t k = 0; k < cells; ++k)
      cells_.emplace_back(plant::CellParameters{.ocv_v = ocv_beyond_full()},
                          plant::CellState{soc + 0.002 * (static_cast<double>(k % 5) - 2), 0, 25});
    application_.emplace(measurement::StartingPoint{static_cast<std::int32_t>(1e9 * soc), 20'000'000},
                         messages::Identity{0, 0}, static_cast<float>(capacity_ah), persistence_);
  }
  ~Loop() { begin(); }
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  void step() {
    now_s_ += step_s;
    charger.pack_v = pack_v();
    for (const can::Frame& f : charger.send(now_s_)) requests.push_back(f);
    const bool closed = switched.main_plus && switched.main_minus;
    const bool connected = closed && switched.charge_enable;
    const double current_a = plugged ? charger.current_a(pack_v(), connected, now_s_) : 0;
    for (auto& cell : cells_) cell.run(current_a, 25, step_s);
    if (closed)
      dc_link_v_ = pack_v();
    else if (switched.precharge && switched.main_minus)
      dc_link_v_ += (pack_v() - dc_link_v_) * (1 - std::exp(-step_s / 0.5));
    else
      dc_link_v_ *= std::exp(-step_s / 5);
    set_link(pack_v(), dc_link_v_);
    measurement::PackSample<cells> sample{};
    sample.time_us = static_cast<std::uint64_t>(std::llround(1e6 * now_s_));
    sample.current_ua = static_cast<std::int32_t>(std::lround(1e6 * current_a));
    const auto noise = static_cast<std::int32_t>(std::lround(10 * now_s_)) % 3;  // so that no reading counts as stuck
    for (std::size_t k = 0; k < cells; ++k)
      sample.cell_uv[k] = static_cast<std::int32_t>(std::lround(1e6 * cells_[k].voltage_v())) + 40 * noise;
    sample.pack_uv = static_cast<std::int32_t>(std::lround(1e6 * pack_v()));
    sample.temperature_cdegc.fill(2'500);
    sent.clear();
    application_->process_sample(sample);
    for (const can::Frame& f : sent) charger.receive(f, now_s_);
    if (const auto faults = last<can::Faults>()) first_cause = std::max(first_cause, faults->first_cause);
    if (const auto allowed = last<can::AllowedCurrent>(); allowed && std::isfinite(allowed->charge))
      most_above_a = std::max(most_above_a, current_a - 1.05 * static_cast<double>(allowed->charge));
    highest_v = std::max(highest_v, highest_cell_v());
  }
  /// Returns the time until the condition, or nothing if it does not come.
  template <class Condition>
  std::optional<double> until(double within_s, Condition&& condition) {
    for (const double begin_s = now_s_; now_s_ - begin_s < within_s;) {
      step();
      if (condition()) return now_s_ - begin_s;
    }
    return std::nullopt;
  }
  bool any_closed() const { return switched.main_plus || switched.main_minus || switched.precharge; }
  double pack_v() const {
    double sum = 0;
    for (const auto& cell : cells_) sum += cell.voltage_v();
    return sum;
  }
  double highest_cell_v() const {
    double highest = 0;
    for (const auto& cell : cells_) highest = std::max(highest, cell.voltage_v());
    return highest;
  }
  double soc() const {
    double sum = 0;
    for (const auto& cell : cells_) sum += cell.soc();
    return sum / cells;
  }
  ChargePhase phase() const { return application_->vehicle_profile().control().phase(); }

  Plugged charger;
  bool plugged = true;
  std::uint32_t first_cause = 0;
  double most_above_a = -100, highest_v = 0;

 private:
  std::vector<plant::Cell> cells_;
  storage::Persistence persistence_;
  std::optional<Application<LoopCell, Profile>> application_;
  double now_s_ = 0, dc_link_v_ = 0;
};

template <class Profile, class Plugged>
struct Protocol {
  using TheLoop = Loop<Profile, Plugged>;
};
using Protocols = ::testing::Types<Protocol<ElconProfile, ElconCharger>, Protocol<Cia418Profile, CanopenCharger>>;

template <class P>
class ChargerLoop : public ::testing::Test {};
TYPED_TEST_SUITE(ChargerLoop, Protocols);

TYPED_TEST(ChargerLoop, ChargesFromAFifthToFullAndEnds) {
  typename TypeParam::TheLoop loop(0.2);
  const auto closed_s = loop.until(60, [] { return switched.charge_enable; });
  ASSERT_TRUE(closed_s);
  const auto full_s = loop.until(4 * 3'600, [&] { return loop.phase() == ChargePhase::full; });
  ASSERT_TRUE(full_s) << "phase " << static_cast<int>(loop.phase()) << ", soc " << loop.soc();
  const auto open_s = loop.until(30, [&] { return !loop.any_closed(); });
  ASSERT_TRUE(open_s);
  fmt::print("closed after {:.1f} s, full after {:.0f} min, open {:.1f} s later; soc {:.3f}, highest cell {:.3f} V\n",
             *closed_s, *full_s / 60, *open_s, loop.soc(), loop.highest_v);
  EXPECT_GT(loop.soc(), 0.97);
  EXPECT_LT(loop.soc(), 1.03);
  EXPECT_LT(loop.highest_v, 3.65);
  EXPECT_EQ(loop.first_cause, 0U);
  EXPECT_LT(loop.most_above_a, 0.3) << "the charger follows within its next message";
  EXPECT_FALSE(loop.until(3'600, [&] { return loop.any_closed(); })) << "still plugged in: the charge is over";
}

TYPED_TEST(ChargerLoop, LostFramesDoNotEndTheChargeAndSilenceDoes) {
  typename TypeParam::TheLoop loop(0.5);
  ASSERT_TRUE(loop.until(60, [] { return switched.charge_enable; }));
  for (int k = 0; k < 20; ++k) {  // two of three frames are lost
    loop.charger.silent = true;
    loop.until(2.5, [] { return false; });
    loop.charger.silent = false;
    loop.until(0.6, [] { return false; });
    ASSERT_TRUE(switched.charge_enable) << k;
  }
  loop.charger.deaf = true;  // it stops by itself
  ASSERT_TRUE(loop.until(6, [&] { return loop.charger.output_a() == 0; }));
  loop.charger.deaf = false;
  ASSERT_TRUE(loop.until(10, [&] { return loop.charger.output_a() > 5; }));
  loop.charger.silent = loop.charger.deaf = true;  // the plug is pulled with its wires
  loop.plugged = false;
  const auto open_s = loop.until(30, [&] { return !loop.any_closed(); });
  ASSERT_TRUE(open_s);
  fmt::print("open {:.1f} s after the last frame\n", *open_s);
  EXPECT_EQ(loop.first_cause, 0U);
  loop.charger.silent = loop.charger.deaf = false;
  loop.plugged = true;
  EXPECT_TRUE(loop.until(60, [&] { return loop.charger.output_a() > 5; })) << "plugged in again";
}

TYPED_TEST(ChargerLoop, AChargerThatIsSilentAndGoesOnIsSwitchedOff) {
  typename TypeParam::TheLoop loop(0.5);
  ASSERT_TRUE(loop.until(60, [&] { return loop.charger.output_a() > 5; }));
  loop.charger.silent = loop.charger.ignores_limit = true;
  const auto open_s = loop.until(80, [&] { return !switched.charge_enable; });
  ASSERT_TRUE(open_s);
  fmt::print("charge enable off {:.1f} s after the last frame\n", *open_s);
  EXPECT_TRUE(loop.until(80, [&] { return !loop.any_closed(); }));
}

/// It holds 70 V whatever it is asked for, but follows the current.
TYPED_TEST(ChargerLoop, AChargerWithATooHighVoltageEndsFullByTheAllowedCurrent) {
  typename TypeParam::TheLoop loop(0.9);
  loop.charger.own_target_v = 70;
  const auto full_s = loop.until(2 * 3'600, [&] { return loop.phase() == ChargePhase::full; });
  ASSERT_TRUE(full_s) << static_cast<int>(loop.phase());
  EXPECT_TRUE(loop.until(30, [&] { return !loop.any_closed(); }));
  fmt::print("full after {:.0f} min; highest cell {:.3f} V, first cause {}\n", *full_s / 60, loop.highest_v,
             loop.first_cause);
  EXPECT_LT(loop.highest_v, 3.66);
}

/// It gives 6 A until it is switched off.
TYPED_TEST(ChargerLoop, AChargerThatIgnoresTheLimitIsSwitchedOffBelowTheSevereVoltage) {
  typename TypeParam::TheLoop loop(0.9);
  loop.charger.own_target_v = 70;
  loop.charger.ignores_limit = true;
  ASSERT_TRUE(loop.until(60, [&] { return loop.charger.output_a() > 5; }));
  const auto off_s = loop.until(2 * 3'600, [&] { return loop.charger.output_a() == 0; });
  ASSERT_TRUE(off_s);
  fmt::print("off after {:.0f} min; highest cell {:.3f} V, first cause {}\n", *off_s / 60, loop.highest_v,
             loop.first_cause);
  EXPECT_LT(loop.highest_v, 3.815) << "cell overvoltage severe";
  EXPECT_NE(loop.first_cause, 0U) << "it is named";
}

/// A charger with a lower end voltage never reaches the target: the charge ends as stalled, not as full.
TYPED_TEST(ChargerLoop, AChargerThatEndsBelowTheTargetEndsAsStalled) {
  typename TypeParam::TheLoop loop(0.8);
  loop.charger.own_target_v = cells * 3.38;
  ASSERT_TRUE(loop.until(4 * 3'600, [&] { return loop.phase() == ChargePhase::stalled; }))
      << static_cast<int>(loop.phase());
  EXPECT_TRUE(loop.until(30, [&] { return !loop.any_closed(); }));
  EXPECT_EQ(loop.first_cause, 0U);
}

TEST(ElconLoop, AnOutputThatIsNotThePackEndsTheChargeUntilTheChargerWasAway) {
  Loop<ElconProfile, ElconCharger> loop(0.5);
  ASSERT_TRUE(loop.until(60, [&] { return loop.charger.output_a() > 5; }));
  loop.charger.reported_v = 26.5;
  const auto end_s = loop.until(30, [&] { return loop.phase() == ChargePhase::wrong; });
  ASSERT_TRUE(end_s);
  fmt::print("ended after {:.1f} s\n", *end_s);
  ASSERT_TRUE(loop.until(30, [&] { return !loop.any_closed(); }));
  loop.charger.reported_v.reset();
  EXPECT_FALSE(loop.until(60, [&] { return loop.any_closed(); }));
  loop.charger.silent = true;
  loop.until(5, [] { return false; });
  loop.charger.silent = false;
  EXPECT_TRUE(loop.until(60, [&] { return loop.charger.output_a() > 5; }));
}

/// The bytes of the maker's example: 98 V and 16 A are 03D4 00A0.
TEST(ElconLoop, SendsVoltageAndCurrentInTheBytesOfTheProtocol) {
  Loop<ElconProfile, ElconCharger> loop(0.5);
  loop.step();
  std::optional<can::Frame> frame;
  const auto of_elcon = [&] {
    for (const can::Frame& f : sent) {
      if (f.long_id && f.id == 0x1806E5F4) frame = f;
    }
  };
  of_elcon();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->data, (std::array<std::uint8_t, 8>{0x02, 0x38, 0, 0, 1, 0, 0, 0})) << "16 * 3.551 V; do not charge";
  ASSERT_TRUE(loop.until(120, [&] { return loop.charger.output_a() > 5.9; }));
  loop.until(1, [&] {
    of_elcon();
    return false;
  });
  EXPECT_EQ(frame->data, (std::array<std::uint8_t, 8>{0x02, 0x38, 0, 60, 0, 0, 0, 0}));
}

}  // namespace
}  // namespace bms::firmware
