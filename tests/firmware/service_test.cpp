// Who may command: service sessions and drive requests of a pack with a key, on this machine with the real application.
#include <gtest/gtest.h>

#include <random>

#include "monitor/service_client.hpp"
#include "tests/firmware/service_fixture.hpp"
#include "tests/firmware/stored_state_fixture.hpp"

namespace bms::firmware {
namespace {

using host_hal::last;
using Challenge = can::ServiceChallenge;

constexpr authentication::Key own_key{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
constexpr std::uint16_t somebody = 4'711;

class ServiceTest : public StoredStateTest {
 protected:
  void SetUp() override {
    StoredStateTest::SetUp();
    host_hal::key = own_key;
    host_hal::development = false;
    host_hal::calendar = 1'800'000'000;
  }
  void send(HostBoard& board, std::span<const can::Frame> frames) {
    for (const can::Frame& f : frames) host_hal::requests.push_back(f);
    run(board, 1);
  }
  void send(HostBoard& board, const can::Frame& frame) { send(board, std::span(&frame, 1)); }
  std::uint32_t open_session(HostBoard& board, KeyHolder& holder) {
    send(board, holder.challenge());
    send(board, holder.response(somebody));
    return last<Challenge>()->state;
  }
  std::uint32_t result_of(HostBoard& board, std::span<const can::Frame> frames) {
    host_hal::sent.clear();
    send(board, frames);
    const auto answer = last<can::CommandAnswer>();
    return answer ? answer->result : 99;
  }
  /// A short circuit, then the power is switched off and on.
  std::vector<std::uint8_t> after_a_short_circuit() {
    HostBoard board(new_chip, start);
    run(board, 3);
    Input in = second();
    in.pack.current_ua = -60'000'000;
    board.process_sample(in);
    run(board, 2);
    return board.flash();
  }
  static bool short_circuit_latched() { return last<can::Faults>()->short_circuit == 1; }

  KeyHolder workshop{own_key}, stranger{authentication::development_key};
};

TEST_F(ServiceTest, OnlyASessionClearsAShortCircuitAndItIsRecorded) {
  const auto kept = after_a_short_circuit();
  HostBoard board(kept, start);
  run(board, 5);
  ASSERT_TRUE(short_circuit_latched());
  EXPECT_EQ(result_of(board, stranger.command(can::Command::code_clear_faults, 1)),
            can::CommandAnswer::result_not_authorised);
  EXPECT_NE(open_session(board, stranger), Challenge::state_open);
  ASSERT_EQ(open_session(board, workshop), Challenge::state_open);
  EXPECT_EQ(result_of(board, std::array{workshop.command(can::Command::code_clear_faults, 1)[1]}),
            can::CommandAnswer::result_not_authorised)
      << "without its authority";
  run(board, 1);
  EXPECT_TRUE(short_circuit_latched());
  EXPECT_EQ(result_of(board, workshop.command(can::Command::code_clear_faults, 1)), can::CommandAnswer::result_done);
  run(board, 2);
  EXPECT_FALSE(short_circuit_latched());
  const auto& actions = board.persistence().actions();
  EXPECT_EQ(actions.last(0).code, can::StoredAction::code_clear_faults);
  EXPECT_EQ(actions.last(0).argument, 1U);
  EXPECT_EQ(actions.last(0).operator_number, somebody);
  EXPECT_EQ(actions.last(0).time_s, 1'800'000'000U);
  EXPECT_EQ(actions.last(1).code, can::StoredAction::code_session_opened);
}

TEST_F(ServiceTest, EveryCommandThatClearsCalibratesOrSetsTheTimeNeedsASession) {
  HostBoard board(new_chip, start);
  run(board, 3);
  const std::pair<std::uint32_t, std::uint32_t> commands[] = {{can::Command::code_clear_faults, 0},
                                                              {can::Command::code_clear_faults, 1},
                                                              {can::Command::code_set_time, 1'900'000'000},
                                                              {can::Command::code_voltage_gain, 100},
                                                              {can::Command::code_voltage_offset, 100},
                                                              {can::Command::code_current_gain, 100},
                                                              {can::Command::code_current_offset, 100},
                                                              {can::Command::code_request, 1},
                                                              {can::Command::code_request, 2}};
  for (const auto& [code, argument] : commands) {
    EXPECT_EQ(result_of(board, std::array{workshop.command(code, argument)[1]}),
              can::CommandAnswer::result_not_authorised)
        << code;
  }
  EXPECT_EQ(host_hal::calendar_was_set_to, 0U);
  EXPECT_EQ(host_hal::calibrated, hal::SensorCalibration{});
  ASSERT_EQ(open_session(board, workshop), Challenge::state_open);
  for (const auto& [code, argument] : std::span(commands).first(7))
    EXPECT_EQ(result_of(board, workshop.command(code, argument)), can::CommandAnswer::result_done) << code;
  // what harms nobody needs no key
  for (const std::uint32_t code :
       {can::Command::code_log_of_samples, can::Command::code_stored_data, can::Command::code_request})
    EXPECT_EQ(result_of(board, std::array{stranger.command(code, 0)[1]}), can::CommandAnswer::result_done) << code;
}

TEST_F(ServiceTest, WrongResponsesLockForTenMinutesAlsoOverARestart) {
  std::vector<std::uint8_t> kept;
  {
    HostBoard board(new_chip, start);
    run(board, 2);
    for (int k = 0; k < 3; ++k) EXPECT_NE(open_session(board, stranger), Challenge::state_open);
    EXPECT_EQ(last<Challenge>()->state, Challenge::state_locked);
    EXPECT_EQ(open_session(board, workshop), Challenge::state_locked) << "also for the right key";
    run(board, 590);
    EXPECT_EQ(open_session(board, workshop), Challenge::state_locked);
    kept = board.flash();
    run(board, 10);
    EXPECT_EQ(open_session(board, workshop), Challenge::state_open);
  }
  HostBoard board(kept, start);
  run(board, 2);
  EXPECT_EQ(open_session(board, workshop), Challenge::state_locked);
  run(board, 600);
  EXPECT_NE(open_session(board, stranger), Challenge::state_open);
  EXPECT_EQ(last<Challenge>()->state, Challenge::state_locked) << "one attempt each after the first lock";
}

TEST_F(ServiceTest, ASessionEndsAfterAMinuteAndAChallengeAfterTenSeconds) {
  HostBoard board(new_chip, start);
  run(board, 2);
  ASSERT_EQ(open_session(board, workshop), Challenge::state_open);
  run(board, 58);
  EXPECT_EQ(result_of(board, workshop.command(can::Command::code_clear_faults, 0)), can::CommandAnswer::result_done);
  run(board, 60);
  EXPECT_EQ(result_of(board, workshop.command(can::Command::code_clear_faults, 0)),
            can::CommandAnswer::result_not_authorised);
  send(board, workshop.challenge());
  run(board, 10);
  send(board, workshop.response(somebody));
  EXPECT_EQ(last<Challenge>()->state, Challenge::state_closed);
}

TEST_F(ServiceTest, WithoutAKeyOfItsOwnAProductFollowsNobody) {
  for (const bool development_key : {false, true}) {
    host_hal::key.reset();
    if (development_key) host_hal::key = authentication::development_key;
    HostBoard board(new_chip, start);
    run(board, 3);
    KeyHolder holder(authentication::development_key);
    EXPECT_EQ(last<can::RequestChallenge>()->state, can::RequestChallenge::state_no_key);
    EXPECT_EQ(open_session(board, holder), Challenge::state_no_key);
    for (int k = 0; k < 20; ++k) send(board, holder.drive());
    EXPECT_FALSE(host_hal::switched.main_minus || host_hal::switched.precharge);
    EXPECT_EQ(result_of(board, holder.command(can::Command::code_clear_faults, 1)),
              can::CommandAnswer::result_not_authorised);
  }
  host_hal::development = true;  // an image for development with the key for development: the key is needed
  HostBoard board(new_chip, start);
  run(board, 3);
  KeyHolder holder(authentication::development_key);
  EXPECT_EQ(result_of(board, holder.command(can::Command::code_clear_faults, 1)),
            can::CommandAnswer::result_not_authorised);
  EXPECT_EQ(open_session(board, holder), Challenge::state_open);
}

/// All frames of a session and of a drive, recorded and sent again in any order, in the same run and in the next one.
TEST_F(ServiceTest, TenThousandRecordedFramesAreNotAcceptedAgain) {
  std::vector<can::Frame> recorded;
  std::vector<std::uint8_t> kept;
  const auto replay = [&](HostBoard& board, std::uint32_t seed) {
    std::mt19937 random(seed);
    const auto actions = board.persistence().actions().actions;
    for (int k = 0; k < 5'000; ++k) {
      host_hal::requests.push_back(recorded[random() % recorded.size()]);
      if (k % 4 == 3) run(board, 1);
      ASSERT_FALSE(host_hal::switched.precharge || host_hal::switched.main_minus);
    }
    for (std::uint32_t k = 0; k < board.persistence().actions().actions - actions; ++k)
      EXPECT_EQ(board.persistence().actions().last(k).code, can::StoredAction::code_session_locked);
  };
  {
    HostBoard board(new_chip, start);
    run(board, 3);
    const auto record = [&](std::span<const can::Frame> frames) {
      recorded.insert(recorded.end(), frames.begin(), frames.end());
      send(board, frames);
    };
    for (int k = 0; k < 200; ++k) {
      if (k % 20 == 0) {
        record(std::array{workshop.challenge()});
        record(std::array{workshop.response(somebody)});
        ASSERT_EQ(last<Challenge>()->state, Challenge::state_open);
      }
      record(workshop.command(can::Command::code_clear_faults, 1));
      record(std::array{workshop.drive()});
      if (k % 20 == 19) record(std::array{workshop.response(somebody, can::ServiceRequest::kind_close)});
    }
    run(board, 120);
    replay(board, 1);
    kept = board.flash();
  }
  HostBoard board(kept, start);
  run(board, 3);
  replay(board, 2);
}

TEST_F(ServiceTest, ACalibrationIsRefusedWhileClosedAndWhenTooMany) {
  HostBoard board(new_chip, start);
  run(board, 3);
  ASSERT_EQ(open_session(board, workshop), Challenge::state_open);
  unsigned done = 0;
  for (std::uint32_t k = 1; k <= 30; ++k)
    done += result_of(board, workshop.command(can::Command::code_voltage_offset, k)) == can::CommandAnswer::result_done;
  EXPECT_LE(done, 8U);
  EXPECT_GE(done, 4U) << "all four of a calibration";
}

TEST_F(ServiceTest, TheCalibrationThatBoardsCannotApplyIsNotStored) {
  HostBoard board(new_chip, start);
  run(board, 3);
  host_hal::calibration_accepts = false;
  ASSERT_EQ(open_session(board, workshop), Challenge::state_open);
  EXPECT_EQ(result_of(board, workshop.command(can::Command::code_voltage_offset, 5)),
            can::CommandAnswer::result_refused);
  EXPECT_EQ(stored_calibration(board.persistence()), hal::SensorCalibration{});
}

/// `bms service` against the application: one frame exchange a second.
TEST_F(ServiceTest, TheToolClearsWithTheRightKeyAndSaysWhyItCannot) {
  using monitor::ServiceClient;
  const auto ends = [&](HostBoard& board, const authentication::Key& key) {
    ServiceClient client(key, somebody, can::Command::code_clear_faults, 1);
    for (double now_s = 0; client.state() == ServiceClient::State::working && now_s < 60; now_s += 1) {
      for (const can::Frame& frame : client.due(now_s)) host_hal::requests.push_back(frame);
      host_hal::sent.clear();
      run(board, 1);
      for (const can::Frame& frame : host_hal::sent) client.receive(frame, now_s);
    }
    run(board, 2);
    return client.state();
  };
  const auto kept = after_a_short_circuit();
  HostBoard board(kept, start);
  run(board, 5);
  EXPECT_EQ(ends(board, authentication::development_key), ServiceClient::State::wrong_key);
  EXPECT_TRUE(short_circuit_latched());
  EXPECT_EQ(ends(board, own_key), ServiceClient::State::done);
  EXPECT_FALSE(short_circuit_latched());
  EXPECT_EQ(board.persistence().actions().last(0).operator_number, somebody);
  for (int k = 0; k < 3; ++k) ends(board, authentication::development_key);
  EXPECT_EQ(ends(board, own_key), ServiceClient::State::locked);
  host_hal::key.reset();
  HostBoard without(kept, start);
  run(without, 3);
  EXPECT_EQ(ends(without, own_key), ServiceClient::State::no_key);
  host_hal::development = true;
  HostBoard open_to_all(kept, start);
  run(open_to_all, 3);
  EXPECT_EQ(ends(open_to_all, own_key), ServiceClient::State::done) << "no session is needed";
}

}  // namespace
}  // namespace bms::firmware
