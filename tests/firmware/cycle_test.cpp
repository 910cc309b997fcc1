// The cycle times of all messages while the times of the samples jitter, on this machine.
#include "firmware/cycle.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <tuple>

#include "firmware/cia418_profile.hpp"
#include "firmware/j1939_profile.hpp"
#include "firmware/telemetry.hpp"
#include "tests/firmware/host_hal.hpp"

namespace bms::firmware {
namespace {

using namespace host_hal;

constexpr std::size_t all_cells = 24;
constexpr std::uint32_t sample_us = 100'000, hour_us = 3'600'000'000;

struct Board : Table9Board<all_cells> {
  static const protection::ProtectionPlan& plan() {
    static const auto plan = protection::protection_plan(design(0.1));
    return plan;
  }
};

struct CyclicMessage {
  std::string name;
  std::uint32_t cycle_us = 0;
  std::uint32_t sent = 0, last_us = 0, shortest_us = ~0U, longest_us = 0;

  void send(std::uint32_t now_us) {
    if (sent++ > 0) {
      shortest_us = std::min(shortest_us, now_us - last_us);
      longest_us = std::max(longest_us, now_us - last_us);
    }
    last_us = now_us;
  }
};

/// All cyclic messages of the DBC files and of the CANopen profile, by identifier.
std::map<std::uint32_t, CyclicMessage> cyclic_messages() {
  std::map<std::uint32_t, CyclicMessage> all;
  const auto add = [&](auto... m) { ((all[m.id] = {m.name, m.cycle_us}), ...); };
  std::apply(add, can::Messages{});
  std::apply(add, can::j1939::Messages{});
  for (const auto& pdo : Cia418Profile::pdos) all[pdo.id] = {pdo.name, 200'000};
  all[0x701] = {"heartbeat", 500'000};
  std::erase_if(all, [](const auto& m) { return m.second.cycle_us == 0; });
  return all;
}

/// Telemetry and both profiles with a sample every 0.1 s for an hour; each is up to jitter_us late.
std::map<std::uint32_t, CyclicMessage> hour_with_jitter_of(std::uint32_t jitter_us) {
  begin();
  estimator::SocEstimator<float>::Result estimate;
  const estimator::Condition<estimator::SocEstimator<float>> condition;
  const estimator::PackCells<float, all_cells> cells;
  const protection::Decision decision;
  const storage::Persistence persistence;
  const BoardStatus board;
  measurement::PackSample<all_cells> pack;
  const measurement::Sample mean;
  Telemetry<estimator::SocEstimator<float>, all_cells> telemetry{{}, std::nullopt};
  J1939Profile j1939;
  Cia418Profile cia418;
  auto messages = cyclic_messages();
  std::mt19937 random(jitter_us);
  for (std::uint32_t k = 0; k < hour_us / sample_us; ++k) {
    pack.time_us = 7 + std::uint64_t{k} * sample_us + random() % (jitter_us + 1);
    const Snapshot<estimator::SocEstimator<float>, all_cells> now{.pack = pack,
                                                                  .mean = mean,
                                                                  .estimate = estimate,
                                                                  .condition = condition,
                                                                  .cells = cells,
                                                                  .decision = decision,
                                                                  .plan = Board::plan(),
                                                                  .persistence = persistence,
                                                                  .board = board,
                                                                  .capacity_ah = 6,
                                                                  .log_samples = false,
                                                                  .stored_part = std::nullopt};
    telemetry.publish(now);
    j1939.publish(now);
    cia418.publish(now);
    for (const can::Frame& f : sent) {
      if (const auto m = messages.find(f.id); m != messages.end())
        m->second.send(static_cast<std::uint32_t>(pack.time_us));
    }
    sent.clear();
  }
  std::erase_if(messages, [](const auto& m) { return m.second.sent == 0; });
  return messages;
}

class CycleTimes : public ::testing::TestWithParam<std::uint32_t> {};

TEST_P(CycleTimes, AreHeldWhileSamplesJitter) {
  const auto messages = hour_with_jitter_of(GetParam());
  for (const auto id : {can::Faults::id, can::ContactorState::id, can::AllowedCurrent::id, can::Identity::id,
                        can::CellVoltages1::id, can::CellVoltages4::id, can::Board::id})
    EXPECT_TRUE(messages.contains(id)) << id;
  EXPECT_TRUE(messages.contains(0x701) && messages.contains(0x20A) && messages.contains(j1939::DcSourceStatus1::id));
  for (const auto& [id, m] : messages) {
    EXPECT_LE(m.longest_us, m.cycle_us + m.cycle_us / 2) << m.name;
    EXPECT_GE(m.shortest_us, m.cycle_us / 2) << m.name;
    EXPECT_NEAR(m.sent, hour_us / m.cycle_us, 1) << m.name << ": the cycle must not drift";
  }
}

INSTANTIATE_TEST_SUITE_P(JitterUs, CycleTimes, ::testing::Values(0, 1, 50, 1'000, 5'000));

TEST(Cycle, OfOneSecondIsKeptWithSamplesThatAreLateByTurns) {
  Cycle cycle;
  std::vector<std::uint32_t> sent_ms;
  for (std::uint32_t k = 0; k < 40; ++k) {
    const std::uint32_t now_ms = 100 * k + (k % 2 == 0 ? 40 : 0);
    if (cycle.due(1'000 * now_ms, 1'000'000)) sent_ms.push_back(now_ms);
  }
  EXPECT_EQ(sent_ms, (std::vector<std::uint32_t>{40, 1'040, 2'040, 3'040}));
}

TEST(Cycle, NeverSendsTwiceWithinHalfACycleAndRestartsAfterAPause) {
  Cycle cycle;
  EXPECT_TRUE(cycle.due(0, 100'000));
  EXPECT_TRUE(cycle.due(149'000, 100'000)) << "late";
  EXPECT_FALSE(cycle.due(151'000, 100'000)) << "a sample that follows at once";
  EXPECT_TRUE(cycle.due(200'000, 100'000)) << "as planned";
  EXPECT_TRUE(cycle.due(900'000, 100'000));
  EXPECT_FALSE(cycle.due(940'000, 100'000));
  EXPECT_TRUE(cycle.due(1'000'000, 100'000));
  EXPECT_TRUE(cycle.due(500'000, 100'000)) << "the time went back";
  cycle.restart();
  EXPECT_TRUE(cycle.due(500'001, 100'000));
}

TEST(Cycle, GoesOnWhenTheTimeWraps) {
  Cycle cycle;
  int sent = 0;
  std::uint32_t now_us = 0U - 1'000'000'000;
  for (int k = 0; k < 20'000; ++k, now_us += 100'000)
    sent += cycle.due(now_us + static_cast<std::uint32_t>(k % 3), 500'000) ? 1 : 0;
  EXPECT_EQ(sent, 4'000);
}

}  // namespace
}  // namespace bms::firmware
