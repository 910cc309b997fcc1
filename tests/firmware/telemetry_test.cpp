// The firmware's application on this machine: the few functions of hal/ that it calls are here.
#include <gtest/gtest.h>

#include <vector>

#include "firmware/application.hpp"

namespace bms {
namespace {

bool listening = true;
std::vector<hal::CanFrame> sent;
std::vector<std::vector<std::uint32_t>> recorded;
int fed = 0;
std::optional<hal::FaultRecord> fault;

}  // namespace

namespace hal {
bool can_listening() { return listening; }
bool can_send(const CanFrame& frame) {
  sent.push_back(frame);
  return true;
}
ResetCause reset_cause() { return ResetCause::watchdog; }
std::optional<FaultRecord> last_fault() { return fault; }
void record(std::span<const std::uint32_t> words) { recorded.emplace_back(words.begin(), words.end()); }
void watchdog_feed() { ++fed; }
}  // namespace hal

namespace {

using namespace messages;

Estimate<float> fixed_answer(SocEstimator<float>&, const Sample&) {
  Estimate<float> e;
  e.soc = 0.54321F;
  e.soc_sigma = 0.01F;
  e.v_rc_v = -0.0123456F;
  e.voltage_predicted_v = 3.2999F;
  e.flags = voltage_stuck;
  return e;
}

class Telemetry : public ::testing::Test {
 protected:
  void SetUp() override {
    listening = true;
    sent.clear();
    recorded.clear();
    fed = 0;
    fault.reset();
  }
  std::vector<unsigned> ids() const {
    std::vector<unsigned> all;
    for (const hal::CanFrame& f : sent) all.push_back(f.id);
    return all;
  }
  Application<SocEstimator<float>, fixed_answer> application{std::nullopt, {0xCE110001, 0x000100}};
  Sample sample{};
};

TEST_F(Telemetry, EverySampleIsToldRecordedAndFeedsTheWatchdog) {
  sample.current_ua = -12'345'678;
  sample.voltage_uv = 3'301'499;
  application.take(sample);
  EXPECT_EQ(ids(), (std::vector<unsigned>{0x183, 0x180, 0x181, 0x182}));
  const PackState state = pack_state_of(sent[1]);
  EXPECT_EQ(state.soc_permyriad, 5432);
  EXPECT_EQ(state.soc_sigma_permyriad, 100);
  EXPECT_EQ(state.voltage_mv, 3301);
  EXPECT_EQ(state.current_ca, -1235);
  const EstimateDetail detail = estimate_detail_of(sent[2]);
  EXPECT_NEAR(detail.v_rc_uv, -12346, 1);
  EXPECT_NEAR(detail.voltage_predicted_uv, 3'299'900, 1);
  const Status status = status_of(sent[3]);
  EXPECT_EQ(status.flags, voltage_stuck);
  EXPECT_EQ(status.sample_counter, 1);
  EXPECT_EQ(status.reset_cause, 4);
  EXPECT_EQ(identity_of(sent[0]).cell_hash, 0xCE110001U);
  EXPECT_EQ(recorded.size(), 1U);
  EXPECT_EQ(fed, 1);
}

TEST_F(Telemetry, WhatIsNotKnownIsSaidAndWhatDoesNotFitSaturates) {
  sample.current_ua = no_reading;
  sample.voltage_uv = no_reading;
  application.take(sample);
  EXPECT_EQ(pack_state_of(sent[1]).voltage_mv, invalid_u16);
  EXPECT_EQ(pack_state_of(sent[1]).current_ca, invalid_i16);
  sample.current_ua = 2'000'000'000;
  sample.voltage_uv = 2'000'000'000;
  sample.time_us = 1;
  application.take(sample);
  EXPECT_EQ(pack_state_of(sent[4]).current_ca, 0x7FFF);
  EXPECT_EQ(pack_state_of(sent[4]).voltage_mv, 0xFFFE);
  Estimate<float> e;
  e.soc = -0.1F;
  e.soc_sigma = 9;
  EXPECT_EQ(pack_state(sample, e).soc_permyriad, 0);
  EXPECT_EQ(pack_state(sample, e).soc_sigma_permyriad, 0xFFFE);
  e.flags = not_started;
  EXPECT_EQ(pack_state(sample, e).soc_permyriad, invalid_u16);
}

TEST_F(Telemetry, NobodyListeningIsToldNothingAndTheCountersSayHowMuchWasMissed) {
  listening = false;
  for (int k = 0; k < 5; ++k) application.take(sample);
  EXPECT_TRUE(sent.empty());
  EXPECT_EQ(fed, 5);
  listening = true;
  application.take(sample);
  EXPECT_EQ(status_of(sent.back()).sample_counter, 6);
  EXPECT_EQ(status_of(sent.back()).status_counter, 1);
}

TEST_F(Telemetry, IdentityComesEachSecondAndAFaultOnce) {
  fault = hal::FaultRecord{};
  fault->pc = 0x08001234;
  fault->cfsr = 0x8200;
  for (int k = 0; k < 30; ++k) {
    sample.time_us = static_cast<std::uint64_t>(k) * 100'000;
    application.take(sample);
  }
  std::size_t identities = 0, faults = 0;
  for (const unsigned id : ids()) {
    identities += id == identity_id ? 1 : 0;
    faults += id == fault_id ? 1 : 0;
  }
  EXPECT_EQ(identities, 3U);
  EXPECT_EQ(faults, 1U);
  EXPECT_EQ(sent[0].id, fault_id);
  EXPECT_EQ(last_fault_of(sent[0]).pc, 0x08001234U);
}

}  // namespace
}  // namespace bms
