// The messages for chargers and displays of other makers: J1939 (RV-C) and CANopen (CiA 418), on this machine.
#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <vector>

#include "firmware/cia418_profile.hpp"
#include "firmware/j1939_profile.hpp"
#include "tests/firmware/application_fixture.hpp"

namespace bms::firmware {
namespace {

/// The expected bytes are written by hand, from the layouts that firmware/can/messages.md names.
TEST_F(TelemetryTest, J1939ProfileAddsMessagesInTheUnitsOfRvc) {
  Application<Board<16>, J1939Profile> with_profile{std::nullopt, {0, 0}, 6, persistence};
  measurement::PackSample<16> pack{};
  for (auto& uv : pack.cell_uv) uv = 3'300'000;
  pack.pack_uv = 52'800'000;
  pack.current_ua = 5'000'000;
  pack.temperature_cdegc = {2'500, 2'500, 2'500, 2'500};
  const auto of_dgn = [](std::uint32_t dgn) {
    std::vector<std::array<std::uint8_t, 8>> all;
    for (const can::Frame& f : sent) {
      if (f.long_id && f.id == (6U << 26 | dgn << 8 | 0x80U)) all.push_back(f.data);
    }
    return all;
  };
  for (int k = 0; k < 24; ++k) {  // 0.3 s for the claim of an address
    with_profile.process_sample(pack);
    pack.time_us += 100'000;
  }
  ASSERT_EQ(of_dgn(0x1FFFD).size(), 3U) << "every second, over two seconds";
  EXPECT_EQ(of_dgn(0x1FEC9).size(), 5U) << "every half second";
  using Bytes = std::array<std::uint8_t, 8>;
  EXPECT_EQ(of_dgn(0x1FFFD)[0], (Bytes{1, 120, 0x20, 0x04, 0x78, 0x80, 0x35, 0x77}))
      << "1056 times 50 mV; 2e9 mA minus 5,000 mA: charging";
  EXPECT_EQ(of_dgn(0x1FFFC)[0], (Bytes{1, 120, 0x40, 0x25, 109, 0xFF, 0xFF, 0xFF}))
      << "9536 is 25 degrees C; 54.32 % in halves";
  EXPECT_EQ(of_dgn(0x1FFFB)[0], (Bytes{1, 120, 200, 3, 0, 0xFF, 0xFF, 0xFF})) << "as new, 3.3 Ah remaining";
  EXPECT_EQ(of_dgn(0x1FEC9)[0], (Bytes{1, 120, 1, 0x90, 0x04, 0x00, 0x7D, 0xF3}))
      << "do not charge: all contactors are open; 58.4 V, 0 A, LiFePO4";
  EXPECT_EQ(of_dgn(0x1FEC7)[0], (Bytes{1, 120, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}));
  EXPECT_EQ(of_dgn(0x1FEA5)[0], (Bytes{1, 120, 0xD0, 6, 0, 0xFF, 0xFF, 0xFF}))
      << "charging current although the contactors are open";
  for (const can::Frame& f : sent) EXPECT_EQ(f.long_id, f.id > 0x7FF);
  sent.clear();
  pack.pack_uv = pack.current_ua = measurement::no_reading;
  pack.temperature_cdegc.fill(measurement::no_temperature);
  for (auto& uv : pack.cell_uv) uv = 3'900'000;
  for (int k = 0; k < 20; ++k) {
    with_profile.process_sample(pack);
    pack.time_us += 100'000;
  }
  EXPECT_EQ(of_dgn(0x1FFFD).back(), (Bytes{1, 120, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF})) << "not known";
  EXPECT_EQ(of_dgn(0x1FFFC).back()[2], 0xFF);
  EXPECT_EQ(of_dgn(0x1FEC7).back()[2], 0x05) << "above a limit, contactors open";
  listening = false;
  sent.clear();
  for (int k = 0; k < 20; ++k) {
    with_profile.process_sample(pack);
    pack.time_us += 100'000;
  }
  EXPECT_TRUE(sent.empty());
}

/// With a charger as node 10 of a CANopen bus. The expected bytes are written by hand, from the sources that
/// firmware/can/messages.md names.
class ChargerTest : public PackWith<Cia418Profile> {
 protected:
  using Bytes = std::vector<std::uint8_t>;
  std::vector<Bytes> frames_of(unsigned id) const {
    std::vector<Bytes> all;
    for (const can::Frame& f : sent) {
      if (f.id == id) all.emplace_back(f.data.begin(), f.data.begin() + f.length);
    }
    return all;
  }
  void charge_for_s(int seconds) {
    for (int k = 0; k < seconds; ++k) {
      send_command(can::Command::code_request, 2, counter_ = can::next(counter_));
      second();
    }
  }
  /// One second with a heartbeat of the charger, and a request of the truck if there is one.
  void second_with(std::optional<int> heartbeat, std::optional<std::uint32_t> truck = std::nullopt) {
    if (heartbeat) requests.push_back({0x70A, 1, {static_cast<std::uint8_t>(*heartbeat)}});
    if (truck) send_command(can::Command::code_request, *truck, counter_ = can::next(counter_));
    second();
  }
  void seconds_with(int seconds, std::optional<int> heartbeat, std::optional<std::uint32_t> truck = std::nullopt) {
    for (int k = 0; k < seconds; ++k) second_with(heartbeat, truck);
  }
  bool any_closed() const { return switched.main_plus || switched.main_minus || switched.precharge; }
  std::uint32_t state() const { return last<can::ContactorState>().value().state; }
  void send_nmt(std::uint8_t command, std::uint8_t node) { requests.push_back({0x000, 2, {command, node}}); }
  /// Answer of the SDO server to a request; empty without an answer.
  Bytes sdo_answer(std::array<std::uint8_t, 8> request) {
    requests.push_back({0x601, 8, request});
    sent.clear();
    second();
    const auto answers = frames_of(0x581);
    return answers.size() == 1 ? answers[0] : Bytes{};
  }

 private:
  std::uint8_t counter_ = 0;
};

TEST_F(ChargerTest, ReceivesStatusVoltageAndAllowedCurrentInItsDefaultPdos) {
  second();
  EXPECT_EQ(frames_of(0x701), (std::vector<Bytes>{{0}})) << "boot-up";
  EXPECT_EQ(frames_of(0x20A), (std::vector<Bytes>{{0xC8, 0x00, 0x00}}))
      << "25 degrees C in eighths; not ready to charge, all contactors open";
  EXPECT_EQ(frames_of(0x30A), (std::vector<Bytes>{{0xC8, 0x00, 0x00, 0xF7, 0xD1, 0x00, 0x00}})) << "52.492 V in 1/1024";
  EXPECT_EQ(frames_of(0x40A), (std::vector<Bytes>{{0x00, 0x00, 54}}));
  charge_for_s(30);
  ASSERT_TRUE(switched.charge_enable);
  sent.clear();
  charge_for_s(1);
  EXPECT_EQ(frames_of(0x701), (std::vector<Bytes>{{5}})) << "operational without a master";
  EXPECT_EQ(frames_of(0x20A).at(0).at(2), 1);
  const auto allowed_a = static_cast<double>(last<can::AllowedCurrent>().value().charge);
  EXPECT_GT(allowed_a, 1);
  EXPECT_NEAR((frames_of(0x40A).at(0)[0] | frames_of(0x40A).at(0)[1] << 8) / 16.0, allowed_a, 1.0 / 16);
  reading.temperature_cdegc.fill(measurement::no_temperature);
  charge_for_s(5);
  EXPECT_EQ(frames_of(0x20A).back(), (Bytes{0xFF, 0x7F, 0x00}));
  EXPECT_EQ(frames_of(0x40A).back(), (Bytes{0, 0, 54})) << "no current without a known temperature";
}

TEST_F(ChargerTest, NetworkManagementStopsAndStartsOnlyThisNode) {
  second();
  send_nmt(2, 99);
  second();
  sent.clear();
  second();
  EXPECT_EQ(frames_of(0x20A).size(), 1U) << "the command was for another node";
  send_nmt(2, 1);
  second();
  sent.clear();
  second();
  EXPECT_TRUE(frames_of(0x20A).empty());
  EXPECT_EQ(frames_of(0x701), (std::vector<Bytes>{{4}}));
  EXPECT_TRUE(sdo_answer({0x40, 0x00, 0x10, 0}).empty()) << "stopped";
  send_nmt(128, 0);
  second();
  sent.clear();
  second();
  EXPECT_EQ(frames_of(0x701), (std::vector<Bytes>{{127}}));
  send_nmt(130, 0);
  second();
  sent.clear();
  second();
  EXPECT_EQ(frames_of(0x701), (std::vector<Bytes>{{0}}));
  EXPECT_EQ(frames_of(0x20A).size(), 1U);
}

TEST_F(ChargerTest, SdoServerAnswersTheObjectsOfABatteryModuleAndRefusesOthers) {
  second();
  EXPECT_EQ(sdo_answer({0x40, 0x00, 0x10, 0}), (Bytes{0x43, 0x00, 0x10, 0, 0xA2, 0x01, 0, 0})) << "device profile 418";
  EXPECT_EQ(sdo_answer({0x40, 0x18, 0x10, 0}), (Bytes{0x4F, 0x18, 0x10, 0, 4, 0, 0, 0}));
  EXPECT_EQ(sdo_answer({0x40, 0x20, 0x60, 2}), (Bytes{0x4B, 0x20, 0x60, 2, 6, 0, 0, 0})) << "Ah";
  EXPECT_EQ(sdo_answer({0x40, 0x20, 0x60, 4}), (Bytes{0x4B, 0x20, 0x60, 4, 16, 0, 0, 0})) << "cells";
  EXPECT_EQ(sdo_answer({0x40, 0x10, 0x60, 0}), (Bytes{0x4B, 0x10, 0x60, 0, 0xC8, 0, 0, 0}));
  EXPECT_EQ(sdo_answer({0x40, 0x01, 0x10, 0}), (Bytes{0x4F, 0x01, 0x10, 0, 0, 0, 0, 0})) << "error register";
  EXPECT_EQ(sdo_answer({0x40, 0x17, 0x10, 0}), (Bytes{0x4B, 0x17, 0x10, 0, 0xF4, 0x01, 0, 0}))
      << "a heartbeat every half second";
  EXPECT_EQ(sdo_answer({0x40, 0x60, 0x60, 0})[0], 0x43) << "voltage";
  EXPECT_EQ(sdo_answer({0x40, 0x70, 0x60, 0})[0], 0x4B) << "current requested";
  EXPECT_EQ(sdo_answer({0x40, 0x81, 0x60, 0}), (Bytes{0x4F, 0x81, 0x60, 0, 54, 0, 0, 0})) << "state of charge";
  EXPECT_EQ(sdo_answer({0x40, 0x20, 0x60, 5}), (Bytes{0x80, 0x20, 0x60, 5, 0x11, 0x00, 0x09, 0x06}))
      << "no such sub-index";
  EXPECT_EQ(sdo_answer({0x40, 0x00, 0x60, 1}), (Bytes{0x80, 0x00, 0x60, 1, 0x11, 0x00, 0x09, 0x06}));
  EXPECT_EQ(sdo_answer({0x40, 0x00, 0x50, 0}), (Bytes{0x80, 0x00, 0x50, 0, 0x00, 0x00, 0x02, 0x06}))
      << "no such object";
  EXPECT_EQ(sdo_answer({0x2F, 0x01, 0x60, 0, 7}), (Bytes{0x60, 0x01, 0x60, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sdo_answer({0x40, 0x01, 0x60, 0}), (Bytes{0x4F, 0x01, 0x60, 0, 7, 0, 0, 0}));
  EXPECT_EQ(sdo_answer({0x2B, 0x01, 0x60, 0, 7}), (Bytes{0x80, 0x01, 0x60, 0, 0x10, 0x00, 0x07, 0x06})) << "two bytes";
  EXPECT_EQ(sdo_answer({0x2F, 0x00, 0x60, 0, 1}), (Bytes{0x80, 0x00, 0x60, 0, 0x02, 0x00, 0x01, 0x06})) << "read only";
  EXPECT_EQ(sdo_answer({0x60, 0, 0, 0}), (Bytes{0x80, 0, 0, 0, 0x01, 0x00, 0x04, 0x05})) << "segmented transfer";
  EXPECT_TRUE(sdo_answer({0x80, 0, 0, 0}).empty()) << "an abort is not answered";
  requests.push_back({0x601, 8, {0x40, 0x00, 0x10, 0}, true});
  sent.clear();
  second();
  EXPECT_TRUE(frames_of(0x581).empty()) << "29 bits";
}

// The states are those of CiA 301: 0 boot-up, 4 stopped, 5 operational, 127 pre-operational.

TEST_F(ChargerTest, AnOperationalChargerChargesWithoutTheTruckUntilItsHeartbeatEnds) {
  seconds_with(5, std::nullopt);
  EXPECT_FALSE(any_closed());
  second_with(0);
  seconds_with(20, 5);
  ASSERT_TRUE(switched.charge_enable);
  EXPECT_EQ(state(), can::ContactorState::state_charge);
  EXPECT_EQ(last<can::Faults>().value().first_cause, 0U);
  seconds_with(2, std::nullopt);
  EXPECT_TRUE(switched.charge_enable) << "two lost heartbeats";
  seconds_with(1, 5);
  EXPECT_TRUE(switched.charge_enable);
  seconds_with(6, std::nullopt);
  EXPECT_FALSE(any_closed()) << "pulled out";
  seconds_with(20, 5);
  EXPECT_TRUE(switched.charge_enable) << "plugged in again";
}

TEST_F(ChargerTest, AChargerThatReportsAnotherStateEndsTheCharge) {
  for (const int state : {0, 4, 127}) {
    seconds_with(20, 5);
    ASSERT_TRUE(switched.charge_enable) << state;
    seconds_with(3, state);
    EXPECT_FALSE(any_closed()) << state;
    seconds_with(10, state);
    EXPECT_FALSE(any_closed()) << state;
  }
}

TEST_F(ChargerTest, OneHeartbeatOrThatOfAnotherNodeStartsNothing) {
  second_with(5);
  seconds_with(10, std::nullopt);
  EXPECT_FALSE(any_closed());
  for (int k = 0; k < 20; ++k) {
    requests.push_back({0x70B, 1, {5}});
    requests.push_back({0x70A, 1, {5}, true});
    requests.push_back({0x70A, 8, {5}});
    second();
    ASSERT_FALSE(any_closed());
  }
  for (int k = 0; k < 20; ++k) second_with(k % 2 == 0 ? 5 : 127);
  EXPECT_FALSE(any_closed()) << "never operational twice in a row";
}

/// CiA 301 leaves the time between heartbeats to the device; in answers to node guarding bit 7 alternates.
TEST_F(ChargerTest, HeartbeatsMayBeSlowOrHaveAlternatingBit7) {
  for (int k = 0; k < 24; ++k) second_with(k % 2 == 0 ? std::optional(5) : std::nullopt);
  EXPECT_TRUE(switched.charge_enable) << "every two seconds";
  seconds_with(10, std::nullopt);
  ASSERT_FALSE(any_closed());
  for (int k = 0; k < 20; ++k) second_with(k % 2 == 0 ? 5 : 0x85);
  EXPECT_TRUE(switched.charge_enable);
}

/// No public text says what the bits of object 6001 mean, so no value may change the charge.
TEST_F(ChargerTest, NoValueOfTheChargersStatusObjectStartsOrEndsACharge) {
  const Bytes statuses = {0x00, 0x01, 0x02, 0x80, 0xFF};
  for (const std::uint8_t status : statuses) {
    EXPECT_EQ(sdo_answer({0x2F, 0x01, 0x60, 0, status}), (Bytes{0x60, 0x01, 0x60, 0, 0, 0, 0, 0}));
    seconds_with(10, std::nullopt);
    EXPECT_FALSE(any_closed()) << int{status};
  }
  seconds_with(20, 5);
  for (const std::uint8_t status : statuses) {
    sdo_answer({0x2F, 0x01, 0x60, 0, status});
    seconds_with(3, 5);
    EXPECT_TRUE(switched.charge_enable) << int{status};
  }
}

/// EN 1175: no traction while a charger is connected. A stopped charger counts as not connected.
TEST_F(ChargerTest, ATruckDoesNotDriveWhileAChargerIsPresent) {
  for (const int charger : {5, 127, 0}) {
    seconds_with(20, charger, 1);
    EXPECT_FALSE(any_closed()) << charger;
    seconds_with(10, 4);
  }
  seconds_with(20, 4, 1);
  EXPECT_EQ(state(), can::ContactorState::state_drive);
  seconds_with(10, 4);
  EXPECT_FALSE(any_closed());
}

TEST_F(ChargerTest, AChargerThatIsPluggedInEndsTheDriveWhenTheCurrentIsZeroAndThenCharges) {
  seconds_with(20, std::nullopt, 1);
  ASSERT_EQ(state(), can::ContactorState::state_drive);
  reading.current_ua = -3'000'000;
  seconds_with(10, 5, 1);
  EXPECT_TRUE(driving()) << "not under load";
  EXPECT_EQ(state(), can::ContactorState::state_unloading);
  reading.current_ua = 0;
  seconds_with(20, 5, 1);
  EXPECT_FALSE(any_closed()) << "truck and charger contradict each other";
  seconds_with(30, 5);
  EXPECT_TRUE(switched.charge_enable) << "the truck has withdrawn its request";
  seconds_with(10, 5, 1);
  EXPECT_FALSE(any_closed()) << "a truck that wants to drive ends the charge";
}

TEST_F(ChargerTest, AfterAFaultAChargerMustEndItsRequestBeforeItChargesAgain) {
  seconds_with(20, 5);
  ASSERT_TRUE(switched.charge_enable);
  const std::int32_t before_uv = reading.cell_uv[7];
  reading.cell_uv[7] = 4'000'000;
  seconds_with(10, 5);
  EXPECT_FALSE(any_closed());
  reading.cell_uv[7] = before_uv;
  seconds_with(70, 5);  // charging is allowed again after a minute
  send_command(can::Command::code_clear_faults, 0, 14);
  seconds_with(10, 5);
  EXPECT_FALSE(any_closed());
  seconds_with(5, std::nullopt);
  seconds_with(20, 5);
  EXPECT_TRUE(switched.charge_enable);
}

}  // namespace
}  // namespace bms::firmware
