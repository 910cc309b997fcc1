// greybox/greybox.h: the same bits as the estimator, and an error for every wrong call.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <string>
#include <vector>

#include <greybox/greybox.h>

#include "tests/library/tool_replay.hpp"

namespace bms {
namespace {

using ::testing::HasSubstr;
using ::testing::StrEq;

/// Samples of a shift for which an estimate of the C interface differs in a bit from that of the tool.
std::size_t differences(const greybox_start* start) {
  greybox_memory memory;
  greybox_estimator* c = nullptr;
  EXPECT_EQ(greybox_create(&memory, sizeof memory, start, &c), GREYBOX_OK);
  std::size_t count = 0;
  const auto rows = tool_replay("table9", start == nullptr ? std::nullopt : std::optional(start->soc_ppb));
  EXPECT_GT(rows.size(), 28'000U);
  for (const ReplayedSample& row : rows) {
    const greybox_sample sample = {row.time_us, row.current_ua, row.voltage_uv, row.temperature_cdegc};
    greybox_estimate e;
    EXPECT_EQ(greybox_step(c, &sample, &e), GREYBOX_OK);
    const std::array<std::uint32_t, 5> words = {
        std::bit_cast<std::uint32_t>(e.soc), std::bit_cast<std::uint32_t>(e.soc_sigma),
        std::bit_cast<std::uint32_t>(e.v_rc_v), std::bit_cast<std::uint32_t>(e.voltage_predicted_v), e.flags};
    if (words != row.words) ++count;
  }
  return count;
}

TEST(CInterface, HasTheBitsOfTheToolOverAShift) {
  EXPECT_EQ(differences(nullptr), 0U);
  const greybox_start start = {780'000'000, 200'000'000};
  EXPECT_EQ(differences(&start), 0U);
}

TEST(CInterface, TheStateIsTheLastEstimate) {
  greybox_memory memory;
  greybox_estimator* c = nullptr;
  ASSERT_EQ(greybox_create(&memory, sizeof memory, nullptr, &c), GREYBOX_OK);
  greybox_estimate state{}, stepped{};
  ASSERT_EQ(greybox_state(c, &state), GREYBOX_OK);
  EXPECT_EQ(state.soc, 0.5F);
  EXPECT_EQ(state.flags, std::uint32_t{GREYBOX_NOT_STARTED});
  const greybox_sample sample = {1'000'000, -1'000'000, 3'300'000, 2'500};
  ASSERT_EQ(greybox_step(c, &sample, &stepped), GREYBOX_OK);
  ASSERT_EQ(greybox_step(c, &sample, nullptr), GREYBOX_OK);  // not later than the one before
  ASSERT_EQ(greybox_state(c, &state), GREYBOX_OK);
  EXPECT_EQ(state.soc, stepped.soc);
  EXPECT_EQ(state.flags, std::uint32_t{GREYBOX_TIME_NOT_INCREASING});
  EXPECT_EQ(stepped.flags & GREYBOX_NOT_STARTED, 0U);
}

TEST(CInterface, TwoEstimatorsDoNotShareAnything) {
  std::array<greybox_memory, 2> memory;
  std::array<greybox_estimator*, 2> c{};
  const greybox_start full = {1'000'000'000, 1'000'000}, empty = {0, 1'000'000};
  ASSERT_EQ(greybox_create(&memory[0], sizeof memory[0], &full, &c[0]), GREYBOX_OK);
  ASSERT_EQ(greybox_create(&memory[1], sizeof memory[1], &empty, &c[1]), GREYBOX_OK);
  const greybox_sample sample = {1'000'000, 0, GREYBOX_NO_READING, GREYBOX_NO_TEMPERATURE};
  std::array<greybox_estimate, 2> e{};
  for (std::size_t k = 0; k < 2; ++k) ASSERT_EQ(greybox_step(c[k], &sample, &e[k]), GREYBOX_OK);
  EXPECT_NEAR(e[0].soc, 1, 1e-6);
  EXPECT_NEAR(e[1].soc, 0, 1e-6);
  EXPECT_STREQ(greybox_flag_text(e[0].flags), "the voltage is missing");
}

TEST(CInterface, RefusesMemoryThatIsTooSmallOrMisaligned) {
  greybox_memory memory;
  greybox_estimator* c = nullptr;
  EXPECT_LE(greybox_size(), sizeof memory);
  EXPECT_EQ(greybox_create(&memory, greybox_size(), nullptr, &c), GREYBOX_OK);
  EXPECT_EQ(greybox_create(&memory, greybox_size() - 1, nullptr, &c), GREYBOX_MEMORY_TOO_SMALL);
  EXPECT_EQ(c, nullptr);
  EXPECT_EQ(greybox_create(memory.bytes + 1, sizeof memory - 1, nullptr, &c), GREYBOX_MEMORY_MISALIGNED);
  EXPECT_EQ(c, nullptr);
}

TEST(CInterface, RefusesNullAndMemoryWithoutAnEstimator) {
  greybox_memory memory;
  greybox_estimator* c = nullptr;
  greybox_estimate e;
  const greybox_sample sample{};
  EXPECT_EQ(greybox_create(nullptr, sizeof memory, nullptr, &c), GREYBOX_BAD_ARGUMENT);
  EXPECT_EQ(greybox_create(&memory, sizeof memory, nullptr, nullptr), GREYBOX_BAD_ARGUMENT);
  EXPECT_EQ(greybox_step(nullptr, &sample, &e), GREYBOX_BAD_ARGUMENT);
  EXPECT_EQ(greybox_state(nullptr, &e), GREYBOX_BAD_ARGUMENT);
  ASSERT_EQ(greybox_create(&memory, sizeof memory, nullptr, &c), GREYBOX_OK);
  EXPECT_EQ(greybox_step(c, nullptr, &e), GREYBOX_BAD_ARGUMENT);
  EXPECT_EQ(greybox_state(c, nullptr), GREYBOX_BAD_ARGUMENT);
  std::memset(memory.bytes, 0, sizeof memory);
  EXPECT_EQ(greybox_step(c, &sample, &e), GREYBOX_NOT_CREATED);
  EXPECT_EQ(greybox_state(c, &e), GREYBOX_NOT_CREATED);
}

TEST(CInterface, EveryStatusAndFlagHasItsWords) {
  std::vector<std::string> texts;
  for (int status = GREYBOX_OK; status <= GREYBOX_NOT_CREATED; ++status)
    texts.emplace_back(greybox_status_text(static_cast<greybox_status>(status)));
  for (unsigned bit = 0; bit <= 11; ++bit) {
    if (bit != 7) texts.emplace_back(greybox_flag_text(1U << bit));
  }
  for (const std::string& text : texts) {
    EXPECT_THAT(text, ::testing::Not(HasSubstr("no such")));
    EXPECT_EQ(std::count(texts.begin(), texts.end(), text), 1) << text;
  }
  EXPECT_THAT(greybox_flag_text(0), StrEq(""));
  EXPECT_THAT(greybox_flag_text(1U << 13), StrEq("no such flag"));
  EXPECT_THAT(greybox_status_text(static_cast<greybox_status>(7)), StrEq("no such status"));
}

TEST(CInterface, NamesTheCellThatItWasCompiledFor) {
  EXPECT_THAT(greybox_cell_name(), StrEq("table9"));
  EXPECT_EQ(greybox_cell_hash(), hash_of("table9"));
}

}  // namespace
}  // namespace bms
