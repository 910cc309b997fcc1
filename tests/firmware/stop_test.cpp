// A stop in every state of the contactors, against every source that can ask for power, while the source goes on
// asking.
#include <algorithm>
#include <functional>
#include <set>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/firmware/service_fixture.hpp"
#include "tests/firmware/truck_day.hpp"

namespace bms::firmware {
namespace {

constexpr authentication::Key own_key{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};

enum class Source { command_drive, command_charge, drive_request, charger };
constexpr std::array source_names{"CommandToDrive", "CommandToCharge", "DriveRequest", "HeartbeatOfACharger"};

/// A truck whose source asks, or asks for nothing.
class Asking {
 public:
  explicit Asking(Source source)
      : source_(source),
        day(true,
            source == Source::drive_request ? std::optional<std::array<std::uint8_t, 16>>(own_key) : std::nullopt) {
    day.talks = false;
  }
  void step(bool asks) {
    day.charger.plugged = asks && source_ == Source::charger;
    if (asks && samples_ % 10 == 0 && source_ == Source::command_drive) day.send_request(1);
    if (asks && samples_ % 10 == 0 && source_ == Source::command_charge) day.send_request(2);
    if (asks && samples_ % 10 == 0 && source_ == Source::drive_request) day.send(driver_.drive());
    ++samples_;
    day.step();
  }
  void run(double seconds, bool asks) {
    for (double t = 0; t < seconds - 1e-9; t += 0.1) step(asks);
  }
  bool charges() const { return source_ == Source::charger || source_ == Source::command_charge; }

 private:
  Source source_;
  KeyHolder driver_{own_key};
  unsigned samples_ = 0;

 public:
  TruckDay day;
};

class Stop : public ::testing::TestWithParam<Source> {
 protected:
  static std::uint32_t closed_state() {
    const bool charges = GetParam() == Source::charger || GetParam() == Source::command_charge;
    return charges ? can::ContactorState::state_charge : can::ContactorState::state_drive;
  }
  static can::Frame frame(std::uint8_t counter = 0) { return can::Stop{}.frame(counter); }
};
INSTANTIATE_TEST_SUITE_P(Against, Stop,
                         ::testing::Values(Source::command_drive, Source::command_charge, Source::drive_request,
                                           Source::charger),
                         [](const auto& p) { return std::string(source_names[static_cast<std::size_t>(p.param)]); });

/// From before the first request through self-test, precharge and closed contactors to an emergency stop and the state
/// safe. Sent once, or with every sample.
TEST_P(Stop, InEveryStateEndsTheRequestUntilTheSourceAsksAgain) {
  std::set<std::uint32_t> states;
  int cases = 0, slowest = 0;
  for (const bool once : {true, false}) {
    for (int at = GetParam() == Source::charger ? 7 : 0; at < 130; ++at) {  // its second heartbeat asks
      Asking t(GetParam());
      for (int k = 0; k < at; ++k) {
        t.day.emergency_stop = k >= 100 && k < 103;
        t.step(true);
      }
      t.day.emergency_stop = false;
      states.insert(t.day.state());
      ++cases;
      for (int k = 0; k < 300; ++k) {
        if (k == 0 || !once) t.day.send(frame(static_cast<std::uint8_t>(k % can::counters)));
        t.step(true);
        if (t.day.any_closed()) slowest = std::max(slowest, k + 1);
        ASSERT_LE(slowest, 3) << at << ": closed " << 0.1 * k << " s after a stop";
      }
      if (at % 10 != 0 || at >= 100) continue;
      t.run(6, false);
      t.run(10, true);
      ASSERT_TRUE(t.charges() ? t.day.charges() : t.day.drives()) << at << ": the source has asked again";
    }
  }
  fmt::print("{}: {} stops in {} states, contacts open within {:.1f} s\n",
             source_names[static_cast<std::size_t>(GetParam())], cases, states.size(), 0.1 * slowest);
  for (const std::uint32_t state :
       {can::ContactorState::state_off, can::ContactorState::state_self_test, can::ContactorState::state_precharge,
        closed_state(), can::ContactorState::state_opening, can::ContactorState::state_safe})
    EXPECT_TRUE(states.contains(state)) << state;
}

/// The contactors stay closed until the load has been lowered. A charger obeys ChargeEnable.
TEST_P(Stop, UnderLoadWaitsForTheLoadAndThenOpens) {
  for (const double lasts_s : {0.5, 4.0, 40.0}) {
    Asking t(GetParam());
    t.run(8, true);
    t.day.load_a = 100;
    t.run(3, true);
    t.day.send(frame());
    t.run(0.2, true);
    EXPECT_EQ(t.day.state(), can::ContactorState::state_unloading);
    EXPECT_FALSE(t.day.charges());
    t.day.send(frame(1));  // in unloading
    for (double s = 0.2; s < lasts_s - 0.05; s += 0.1) {
      t.step(true);
      ASSERT_EQ(t.day.state(), can::ContactorState::state_unloading) << s;
    }
    t.day.load_a = 0;
    t.run(0.3, true);
    EXPECT_FALSE(t.day.any_closed()) << lasts_s;
    for (int k = 0; k < 300; ++k) {
      t.step(true);
      ASSERT_FALSE(t.day.any_closed()) << lasts_s;
    }
  }
}

/// Request 0 and DriveRequest none are those of the truck: they end its request, and a charger's goes on.
TEST_P(Stop, RequestForNothingEndsTheRequestOfTheTruck) {
  for (const bool by_drive_request : {false, true}) {
    Asking t(GetParam());
    t.run(8, true);
    ASSERT_TRUE(t.charges() ? t.day.charges() : t.day.drives());
    for (int k = 0; k < 50; ++k) {
      if (by_drive_request) {
        can::DriveRequest nothing;
        nothing.request = can::DriveRequest::request_none;
        t.day.send(nothing.frame(static_cast<std::uint8_t>(k % can::counters)));
      } else {
        t.day.send_request(0);
      }
      t.step(true);
      if (GetParam() == Source::charger) {
        ASSERT_TRUE(t.day.charges());
      } else if (k >= 4) {
        ASSERT_FALSE(t.day.any_closed()) << k;
      }
    }
    t.run(10, true);
    EXPECT_TRUE(t.charges() ? t.day.charges() : t.day.drives()) << "asks again";
  }
}

/// A truck repeats its request 0 each second, and the driver may turn the key in the moment of such a repetition: both
/// arrive with one sample. With a stop in the same sample nothing is followed until the truck has asked for nothing.
TEST(RequestOfOneSample, IsFollowedWithItsRepetitionUnlessAStopCame) {
  for (const bool stop : {false, true}) {
    TruckDay t;
    t.talks = false;
    t.run(1);
    if (stop) t.send(can::Stop{}.frame(0));
    t.send_request(0);
    t.send_request(1);
    t.step();
    EXPECT_EQ(t.state(), can::ContactorState::state_off) << "the request 0 may have come last";
    for (int k = 0; k < 100; ++k) {
      if (k % 10 == 9) t.send_request(1);
      t.step();
      ASSERT_FALSE(stop && t.any_closed()) << k;
    }
    EXPECT_EQ(t.drives(), !stop);
    if (!stop) continue;
    t.send_request(0);
    t.step();
    for (int k = 0; k < 100; ++k) {
      if (k % 10 == 0) t.send_request(1);
      t.step();
    }
    EXPECT_TRUE(t.drives());
  }
}

}  // namespace
}  // namespace bms::firmware
