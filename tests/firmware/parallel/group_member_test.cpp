// Two to four batteries at one DC link: the contactors of the firmware in each, with their self-test and precharge, and
// the frames of the bus between them. The circuit is solved here: batteries, precharge resistors, the capacitor of the
// DC link and its load.
#include "parallel/group_member.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "plant/link_poles.hpp"

namespace bms::parallel::members {
namespace {

using protection::ContactorState;

constexpr double step_s = 0.001, sample_s = 0.1, capacitance_f = 0.01, bleeder_ohm = 2e3, precharge_ohm = 50;
constexpr double most_apart_v = 0.7, limit_a = 100;  // firmware/parallel/README.md
constexpr protection::ContactorPlan plan{.test_us = 300'000,
                                         .half_time_constant_us = 250'000,
                                         .rest_ua = 2'000'000,
                                         .max_closing_gap_uv = 9'000'000,
                                         .dc_link = true};

struct Battery {
  explicit Battery(const Design& design) : member(design) {}

  double emf_v = 79, ohm = 0.02, current_a = 0;
  bool powered = true, on_the_bus = true, faulty = false;
  protection::Outputs out;
  protection::Contactors contactors{plan};
  protection::ContactorEvents seen;
  GroupMember member;
  GroupMember::Order order;

  bool plus() const { return out.main_plus || out.precharge; }
  bool connected() const { return out.main_plus && out.main_minus; }
  double siemens() const {
    if (!out.main_minus || !plus()) return 0;
    return 1 / (ohm + (out.main_plus ? 0 : precharge_ohm));
  }
};

class Truck {
 public:
  explicit Truck(const std::vector<double>& emf_v) {
    for (std::size_t k = 0; k < emf_v.size(); ++k) {
      batteries.emplace_back(
          Design{static_cast<std::uint8_t>(k + 1), static_cast<std::uint8_t>(emf_v.size()), 500'000});
      batteries.back().emf_v = emf_v[k];
      batteries.back().ohm = 0.015 + 0.005 * static_cast<double>(k);
    }
  }

  void run_s(double seconds) {
    for (int k = 0; k < static_cast<int>(std::lround(seconds / step_s)); ++k) {
      ++steps_;
      for (std::size_t b = 0; b < batteries.size(); ++b) {
        if ((steps_ + 23 * b) % 100 == 0) sample(batteries[b]);
      }
      solve();
    }
  }
  std::size_t connected() const {
    return static_cast<std::size_t>(std::ranges::count_if(batteries, [](const Battery& b) { return b.connected(); }));
  }
  bool any_event() const {
    return std::ranges::any_of(
        batteries, [](const Battery& b) { return b.seen.welded || b.seen.precharge_failed || b.seen.not_closed; });
  }
  /// Time until so many are connected [s], or -1.
  double until_connected_s(std::size_t count, double most_s) {
    for (double t = 0; t < most_s; t += sample_s) {
      if (connected() == count) return t;
      run_s(sample_s);
    }
    return -1;
  }

  std::vector<Battery> batteries;
  protection::Request request = protection::Request::none;
  double demand_a = 0, link_v = 0, largest_apart_v = 0, largest_share = 0;

 private:
  std::uint64_t now_us() const { return 1'000 * steps_; }

  void sample(Battery& b) {
    if (!b.powered) {
      b.out = {};
      return;
    }
    const double pack_v = b.emf_v + b.current_a * b.ohm;
    protection::ContactorInput in{.request = b.order.request,
                                  .open_now = b.faulty,
                                  .coils_dead = b.order.leave,
                                  .current_ua = static_cast<std::int32_t>(1e6 * b.current_a),
                                  .pack_uv = static_cast<std::int32_t>(1e6 * pack_v),
                                  .step_us = 100'000};
    const plant::LinkPoles poles = plant::link_poles(b.plus(), b.out.main_minus, pack_v, link_v);
    in.link_plus_uv = static_cast<std::int32_t>(1e6 * poles.plus_v);
    in.link_minus_uv = static_cast<std::int32_t>(1e6 * poles.minus_v);
    b.order = b.member.update({.request = request,
                               .state = b.contactors.state(),
                               .open_circuit_uv = static_cast<std::int32_t>(1e6 * b.emf_v),
                               .current_ua = in.current_ua,
                               .allowed_discharge_ua = static_cast<std::int32_t>(1e6 * limit_a),
                               .allowed_charge_ua = static_cast<std::int32_t>(1e6 * limit_a),
                               .rest_ua = plan.rest_ua},
                              now_us());
    in.request = b.order.request;
    in.coils_dead = b.order.leave;
    const bool was_connected = b.connected();
    b.out = b.contactors.update(in);
    b.seen.welded |= b.contactors.events().welded;
    b.seen.precharge_failed |= b.contactors.events().precharge_failed;
    b.seen.not_closed |= b.contactors.events().not_closed;
    if (b.connected() && !was_connected) {
      for (const Battery& other : batteries) {
        if (&other != &b && other.connected())
          largest_apart_v = std::max(largest_apart_v, std::abs(other.emf_v - b.emf_v));
      }
    }
    if (!b.on_the_bus) return;
    for (const can::Frame& frame : b.member.frames()) {
      for (Battery& other : batteries) {
        if (&other != &b && other.powered && other.on_the_bus) other.member.receive(frame, now_us());
      }
    }
  }
  /// The truck obeys the limit of the leader, and stops without one.
  double load_a() const {
    double limit = 1e9;
    bool any = false;
    for (const Battery& b : batteries) {
      if (!b.powered || !b.member.decision().leads) continue;
      any = true;
      limit = std::min(limit, 1e-6 * b.order.discharge_ua);
    }
    return any && connected() > 0 ? std::min(demand_a, limit) : 0;
  }
  void solve() {
    double siemens = capacitance_f / step_s + 1 / bleeder_ohm, amperes = capacitance_f / step_s * link_v - load_a();
    for (const Battery& b : batteries) {
      siemens += b.siemens();
      amperes += b.siemens() * b.emf_v;
    }
    link_v = std::max(0.0, amperes / siemens);
    for (Battery& b : batteries) {
      b.current_a = b.siemens() * (link_v - b.emf_v);
      if (connected() > 1) largest_share = std::max(largest_share, std::abs(b.current_a) / limit_a);
    }
  }

  std::uint64_t steps_ = 0;
};

TEST(GroupOfContactors, ClosesOneAfterTheOtherOntoTheLiveDcLinkAndSharesTheLoad) {
  for (const std::vector<double>& emf_v : {std::vector{79.0, 79.3}, {79.4, 79.0}, {79.0, 79.2, 79.1, 79.3}}) {
    Truck truck(emf_v);
    truck.run_s(1);
    EXPECT_EQ(truck.connected(), 0U) << "without a request";
    truck.request = protection::Request::drive;
    const double took_s = truck.until_connected_s(emf_v.size(), 20);
    EXPECT_GT(took_s, 0);
    truck.demand_a = 1'000;
    truck.run_s(60);
    EXPECT_EQ(truck.connected(), emf_v.size());
    EXPECT_FALSE(truck.any_event());
    EXPECT_LE(truck.largest_apart_v, most_apart_v);
    EXPECT_LE(truck.largest_share, 1.05);
    std::printf("%zu batteries: all connected after %.1f s, the most used one has %.0f %% of its limit\n", emf_v.size(),
                took_s, 100 * truck.largest_share);
    truck.demand_a = 0;
    truck.run_s(1);
    truck.request = protection::Request::none;
    truck.run_s(2);
    EXPECT_EQ(truck.connected(), 0U);
    truck.request = protection::Request::drive;
    EXPECT_GE(truck.until_connected_s(emf_v.size(), 20), 0) << "again, with a charged DC link";
    EXPECT_FALSE(truck.any_event());
  }
}

/// The load that flows on after the end of the request is not interrupted, with or without equalising currents.
TEST(GroupOfContactors, OpensWhenTheTruckDrawsNothingWhateverFlowsBetweenTheBatteries) {
  Truck truck({79.0, 79.4});
  truck.request = protection::Request::drive;
  ASSERT_GT(truck.until_connected_s(2, 20), 0);
  truck.demand_a = 30;
  truck.run_s(5);
  truck.request = protection::Request::none;
  truck.run_s(3);
  EXPECT_EQ(truck.connected(), 2U) << "30 A flow";
  truck.demand_a = 0;
  truck.run_s(0.5);
  EXPECT_EQ(truck.connected(), 0U);
  EXPECT_FALSE(truck.any_event());
}

TEST(GroupOfContactors, ABatteryThatDiffersStaysOpen) {
  Truck truck({79.0, 80.0});
  truck.request = protection::Request::drive;
  truck.run_s(20);
  EXPECT_FALSE(truck.batteries[0].connected());
  EXPECT_TRUE(truck.batteries[1].connected()) << "the fuller one drives";
  EXPECT_FALSE(truck.any_event());
}

TEST(GroupOfContactors, TheLostBusLeavesTheLeaderAndTheBatteriesReturnWithIt) {
  Truck truck({79.0, 79.2, 79.1});
  truck.request = protection::Request::drive;
  ASSERT_GT(truck.until_connected_s(3, 20), 0);
  truck.demand_a = 120;
  truck.run_s(20);
  for (Battery& b : truck.batteries) b.on_the_bus = false;
  truck.run_s(1.6);
  EXPECT_EQ(truck.connected(), 1U);
  EXPECT_TRUE(truck.batteries[0].connected());
  truck.run_s(10);
  EXPECT_LE(std::abs(truck.batteries[0].current_a), 1.02 * limit_a);
  EXPECT_EQ(truck.connected(), 1U) << "nothing closes without the bus";
  for (Battery& b : truck.batteries) b.on_the_bus = true;
  truck.demand_a = 0;
  EXPECT_GE(truck.until_connected_s(3, 30), 0);
  EXPECT_FALSE(truck.any_event());
}

TEST(GroupOfContactors, OneThatDropsOutUnderLoadReturnsAfterItsFault) {
  for (const std::size_t which : {0U, 1U}) {
    Truck truck({79.1, 79.0});
    truck.request = protection::Request::drive;
    ASSERT_GT(truck.until_connected_s(2, 20), 0);
    truck.demand_a = 150;
    truck.run_s(60);
    Battery& lost = truck.batteries[which];
    lost.faulty = true;
    truck.run_s(0.2);
    EXPECT_FALSE(lost.connected());
    truck.run_s(3);
    EXPECT_TRUE(truck.batteries[1 - which].connected());
    EXPECT_LE(std::abs(truck.batteries[1 - which].current_a), 1.02 * limit_a);
    lost.faulty = false;
    truck.demand_a = 0;
    EXPECT_GE(truck.until_connected_s(2, 40), 0) << which;
    EXPECT_FALSE(truck.any_event());
  }
}

TEST(GroupOfContactors, NothingClosesWhileOneIsWithoutPower) {
  Truck truck({79.1, 79.0});
  truck.batteries[1].powered = false;
  truck.request = protection::Request::drive;
  truck.run_s(20);
  EXPECT_EQ(truck.connected(), 0U);
}

}  // namespace
}  // namespace bms::parallel::members
