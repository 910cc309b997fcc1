// The forklift board with a bus of its own for the charger (BMS_CHARGER_BUS=can2, 125 kbit/s), flashed image, in the
// circuit of a truck whose own bus has 250 kbit/s.
#include <array>
#include <memory>
#include <optional>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/firmware/world/charges.hpp"

namespace bms::world {
namespace {

using ::testing::IsEmpty;

enum class Protocol { elcon, cia418 };
using Inputs = can::TruckInputs;

/// What the board says about the charger's own bus.
struct SeenInputs {
  std::set<std::uint32_t> states;
  std::uint32_t offs = 0;
  void receive(const can::Frame& f) {
    if (f.long_id || f.id != Inputs::id) return;
    states.insert(Inputs::of(f).charger_bus);
    offs = Inputs::of(f).charger_bus_offs;
  }
};

class OwnBus : public ::testing::Test {
 protected:
  static const Pack& pack(Protocol protocol) {
    static const Pack elcon = pack_with_charger_bus("elcon"), cia418 = pack_with_charger_bus("cia418");
    return protocol == Protocol::elcon ? elcon : cia418;
  }
  void plug_in(Protocol protocol, double soc) {
    if (protocol == Protocol::elcon)
      charger = std::make_unique<firmware::ElconCharger>();
    else
      charger = std::make_unique<firmware::CanopenCharger>();
    charge.emplace(pack(protocol), *charger, soc, outcome, own_charger_bit_rate);
  }
  void TearDown() override {
    charge->end();
    EXPECT_TRUE(outcome.good) << outcome.why;
  }
  firmware::BxcanModel& bus() { return charge->world().charger_bus->can; }
  firmware::BxcanModel& truck_bus() { return charge->world().board.can; }
  /// The cycle of the messages of the truck is measured from now on.
  void watch_truck_bus() {
    charge->world().vehicle.shortest_cycle_ms = 1e9;
    charge->world().vehicle.longest_cycle_ms = 0;
  }
  void expect_truck_bus_went_on() {
    EXPECT_LT(charge->world().vehicle.longest_cycle_ms, 150) << "PackState comes with every sample";
    EXPECT_LT(charge->world().vehicle.silent_ms(), 1'100) << "Faults come each second";
    EXPECT_EQ(truck_bus().times_off, 0U);
    EXPECT_EQ(truck_bus().transmit_errors(), 0U);
  }

  Outcome outcome;
  std::unique_ptr<firmware::Charger> charger;
  std::optional<Charge> charge;
};

/// Nearly full at first, so derated.
class FullOnOwnBus : public OwnBus {
 protected:
  void charge_from_plug_in_to_full(Protocol protocol) {
    plug_in(protocol, 0.996);
    ASSERT_TRUE(charge->begins(0.1));
    const double ended_s = charge->opens(3'600);
    ASSERT_GT(ended_s, 60) << "the tail";
    fmt::print("from plug in to full: {:.0f} s\n", ended_s);
    EXPECT_GT(charge->soc(), 0.97);
    EXPECT_LT(charge->highest_v(), 3.65);
    charge->no_fault();
    charge->stays_open(20);
    expect_truck_bus_went_on();
  }
};
TEST_F(FullOnOwnBus, ChargesOfAnElconChargerEndByThemselves) { charge_from_plug_in_to_full(Protocol::elcon); }
TEST_F(FullOnOwnBus, ChargesOfACanopenChargerEndByThemselves) { charge_from_plug_in_to_full(Protocol::cia418); }

class ChargerBus : public OwnBus, public ::testing::WithParamInterface<Protocol> {
 protected:
  void plug_in(double soc) { OwnBus::plug_in(GetParam(), soc); }
};

TEST_P(ChargerBus, NeitherBusCarriesTheOthersMessages) {
  plug_in(0.5);
  std::set<std::uint32_t> on_truck_bus;
  charge->world().vehicle.on_frame = [&](const can::Frame& f) { on_truck_bus.insert(f.id); };
  ASSERT_TRUE(charge->begins());
  charge->stop();
  ASSERT_GT(charge->opens(10), 0);
  charge->run_s(3);
  std::set<std::uint32_t> on_charger_bus;
  for (const firmware::SeenFrame& f : bus().seen) {
    if (f.from_board) on_charger_bus.insert(f.frame.id);
  }
  const std::set<std::uint32_t> elcon{0x1806E5F4}, cia418{0x20A, 0x30A, 0x40A, 0x701};
  const std::set<std::uint32_t>& of_profile = GetParam() == Protocol::elcon ? elcon : cia418;
  EXPECT_EQ(on_charger_bus, of_profile);
  EXPECT_GT(on_truck_bus.size(), 15U);
  constexpr std::uint32_t heartbeat = 0x701;  // of a node of either bus
  for (const std::uint32_t id : of_profile) EXPECT_EQ(on_truck_bus.contains(id), id == heartbeat) << std::hex << id;
  expect_truck_bus_went_on();
}

TEST_P(ChargerBus, ACutBusEndsTheChargeAsItsSilenceDoesAndTheTrucksBusGoesOn) {
  plug_in(0.5);
  ASSERT_TRUE(charge->begins());
  watch_truck_bus();
  charger->silent = charger->deaf = true;  // its wires: nothing arrives, and nobody acknowledges
  bus().others_acknowledge = false;
  const double ended_s = charge->opens(20);
  EXPECT_GT(ended_s, 2.4) << "two lost frames do not end it, the last one may be a second old";
  EXPECT_LT(ended_s, 10);
  charge->run_s(5);
  charge->no_fault();
  expect_truck_bus_went_on();
  charger->silent = charger->deaf = false;
  bus().others_acknowledge = true;
  EXPECT_TRUE(charge->begins()) << "the wires are repaired";
  expect_truck_bus_went_on();
}

/// Of the truck's bus. Its frames are errors for the board: bus-off again and again.
TEST_P(ChargerBus, ABusThatIsHeldLowOrDisturbedTakesNothingFromTheTrucksBusAndRecoversByItself) {
  plug_in(0.5);
  ASSERT_TRUE(charge->begins());
  SeenInputs said;
  charge->world().vehicle.on_frame = [&](const can::Frame& f) { said.receive(f); };
  charge->run_s(2);
  EXPECT_EQ(said.states, std::set<std::uint32_t>{Inputs::charger_bus_active});
  EXPECT_EQ(said.offs, 0U);
  watch_truck_bus();
  bus().corrupt_sent = 40;  // 32 errors are a bus-off
  charge->run_s(3);
  EXPECT_GE(bus().times_off, 1U);
  EXPECT_EQ(said.offs, bus().times_off) << "the truck sees it";
  EXPECT_TRUE(charge->gives()) << "it recovers before the charger gives up";
  bus().stuck_dominant = true;
  charge->run_s(12);
  EXPECT_FALSE(charge->world().any_main_closed());
  charge->no_fault();
  expect_truck_bus_went_on();
  bus().stuck_dominant = false;
  EXPECT_TRUE(charge->begins());
  expect_truck_bus_went_on();
}

TEST_P(ChargerBus, ATrucksBusThatIsOffTakesNothingFromTheCharge) {
  plug_in(0.5);
  ASSERT_TRUE(charge->begins());
  truck_bus().stuck_dominant = true;
  charge->run_s(10);
  EXPECT_TRUE(charge->gives());
  EXPECT_EQ(bus().times_off, 0U);
  EXPECT_EQ(bus().transmit_errors(), 0U);
  truck_bus().stuck_dominant = false;
  charge->run_s(5);
  EXPECT_LT(charge->world().vehicle.silent_ms(), 1'100);
  EXPECT_TRUE(charge->gives());
}

TEST_P(ChargerBus, FramesOfTheChargersProtocolOnTheTrucksBusAreNotObeyed) {
  plug_in(0.5);
  charge->on_the_wrong_bus = true;
  charge->stays_open(20);
  charge->on_the_wrong_bus = false;
  ASSERT_TRUE(charge->begins());
  charge->on_the_wrong_bus = true;  // they go on there, and the charger's own ones end
  EXPECT_GT(charge->opens(10), 0);
}

/// The stop of an application that has passed the filters of the wrong bus does not exist: nothing but the protocol is
/// received there.
TEST_P(ChargerBus, MessagesOfTheTruckOnTheChargersBusAreNotObeyed) {
  plug_in(0.5);
  ASSERT_TRUE(charge->begins());
  can::Stop stop;
  can::Command request;
  request.code = can::Command::code_request;
  request.argument = 0;
  for (std::uint8_t k = 0; k < 10; ++k) {
    bus().others.push_back({firmware::wire_frame(stop.frame(k)), 0, true});
    bus().others.push_back({firmware::wire_frame(request.frame(k)), 0, true});
    charge->run_s(0.2);
  }
  EXPECT_TRUE(charge->gives());
  charge->stop();
  EXPECT_GT(charge->opens(10), 0) << "of the truck's bus";
}

INSTANTIATE_TEST_SUITE_P(Of, ChargerBus, ::testing::Values(Protocol::elcon, Protocol::cia418),
                         [](const auto& tested) { return tested.param == Protocol::elcon ? "Elcon" : "Cia418"; });

class CanopenBuses : public ChargerBus {
 protected:
  /// Of the truck's bus, to node 1.
  void send(std::uint32_t id, std::uint8_t length, const std::array<std::uint8_t, 8>& data) {
    truck_bus().others.push_back({firmware::wire_frame({id, length, data}), 0, true});
  }
};

/// A CANopen truck reads the battery's objects and watches its heartbeat, whichever bus the charger has.
TEST_P(CanopenBuses, TheBatteryIsANodeOfTheTrucksBusTooAndATruckThatStopsItDoesNotStopTheCharge) {
  plug_in(0.5);
  ASSERT_TRUE(charge->begins());
  std::optional<can::Frame> answer;
  std::uint8_t state = 0;
  charge->world().vehicle.on_frame = [&](const can::Frame& f) {
    if (f.id == 0x581) answer = f;
    if (f.id == 0x701) state = f.data[0];
  };
  const auto answered = [&] { return answer.has_value(); };
  const std::array<std::uint8_t, 8> read_device_type{0x40, 0x00, 0x10}, stop_node{2, 1}, start_node{1, 1};
  send(0x601, 8, read_device_type);
  ASSERT_GE(charge->world().run_until(answered, 500), 0);
  EXPECT_EQ(answer->data[0], 0x43);
  EXPECT_EQ(answer->data[4] | answer->data[5] << 8, 418);
  for (const firmware::SeenFrame& f : bus().seen) EXPECT_NE(f.frame.id, 0x581U) << "not on the charger's bus";
  answer.reset();
  send(0x000, 2, stop_node);
  charge->run_s(2);
  EXPECT_EQ(state, 4) << "stopped";
  send(0x601, 8, read_device_type);
  charge->run_s(1);
  EXPECT_FALSE(answered());
  EXPECT_TRUE(charge->gives()) << "the charger's node goes on";
  send(0x000, 2, start_node);
  charge->run_s(1);
  EXPECT_EQ(state, 5);
  charge->no_fault();
}
INSTANTIATE_TEST_SUITE_P(Of, CanopenBuses, ::testing::Values(Protocol::cia418),
                         [](const auto&) { return std::string("Cia418"); });

/// A parked battery whose charger does not listen.
class ChargerBusAsleep : public ::testing::Test {
 protected:
  ChargerBusAsleep() {
    world.fit_clock();
    world.fit_charger_bus(own_charger_bit_rate);
    world.charger_bus->can.others_acknowledge = false;
  }

  const Pack pack = pack_with_charger_bus("elcon");
  TruckWorld world{pack.image, typical_setup(pack)};
};

/// Parked: both buses are silent, so the chip stops between the samples; a charger's frame wakes it.
TEST_F(ChargerBusAsleep, TheChipStopsWhileBothBusesAreSilentAndAFrameOfTheChargerWakesIt) {
  world.silence_bus(true);
  world.run_ms(13'000);
  const unsigned stops = world.board.stops;
  world.run_ms(3'000);
  EXPECT_GT(world.board.stops - stops, 25U) << "between all samples";
  const auto frame = [&] {
    world.charger_bus->can.others.push_back(
        {firmware::wire_frame({0x18FF50E5, 8, {2, 8, 0, 0, 0, 0, 0, 0}, true}), 0, true});
  };
  const std::size_t before = world.charger_bus->can.seen.size();
  world.charger_bus->can.others_acknowledge = true;
  frame();
  const auto answers = [&] {
    for (std::size_t k = before; k < world.charger_bus->can.seen.size(); ++k) {
      if (world.charger_bus->can.seen[k].from_board) return true;
    }
    return false;
  };
  unsigned needed = 1;
  for (; needed < 4 && world.run_until(answers, 1'000) < 0; ++needed) frame();
  EXPECT_LE(needed, 3U) << "frames of a charger that repeats them each second";
  EXPECT_TRUE(answers());
  const unsigned awake = world.board.stops;
  for (int k = 0; k < 5; ++k) {
    frame();
    world.run_ms(1'000);
  }
  EXPECT_LE(world.board.stops - awake, 1U) << "the charger goes on to talk";
  EXPECT_THAT(world.violations(), IsEmpty());
}

/// A node of one bus that talks keeps the controllers of both buses on: none leaves its bus ten times a second.
TEST_F(ChargerBusAsleep, ATruckThatTalksKeepsTheControllerOfTheChargerOnItsBus) {
  world.run_ms(15'000);
  EXPECT_EQ(world.board.stops, 0U);
  unsigned off = 0;
  for (int k = 0; k < 400; ++k) {
    world.run_ms(5);
    off += world.charger_bus->can.on_the_bus() ? 0 : 1;
  }
  EXPECT_EQ(off, 0U);
  EXPECT_THAT(world.violations(), IsEmpty());
}

}  // namespace
}  // namespace bms::world
