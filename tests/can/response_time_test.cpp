#include "tests/can/response_time.hpp"

#include <gtest/gtest.h>

#include <set>

namespace bms::can_bus {
namespace {

/// Section 3.1 of the paper, table 2: what the older analysis gave as 3 ms for C.
TEST(ResponseTime, IsThatOfThePapersExampleWhereTheSecondInstanceIsTheWorst) {
  const std::vector<Message> messages{{"A", 1, 8, 2.5e-3, 0}, {"B", 2, 8, 3.5e-3, 0}, {"C", 3, 8, 3.5e-3, 0}};
  const auto a_millisecond = [](const Message&) { return 1e-3; };
  EXPECT_NEAR(response_s(messages, 0, 1e-3, 8e-6, a_millisecond), 2e-3, 1e-9);
  EXPECT_NEAR(response_s(messages, 1, 1e-3, 8e-6, a_millisecond), 3e-3, 1e-9);
  EXPECT_NEAR(response_s(messages, 2, 0, 8e-6, a_millisecond), 3.5e-3, 1e-9);
}

TEST(ResponseTime, OfAFullBusIsNeverAndAFrameIs135BitsAtMost) {
  const std::vector<Message> messages{{"A", 1, 8, 1e-3, 0}, {"B", 2, 8, 1e-3, 0}};
  EXPECT_TRUE(std::isinf(response_on_the_bus_s(messages, 1, 250e3)));
  EXPECT_FALSE(std::isinf(response_on_the_bus_s(messages, 0, 250e3)));
  EXPECT_EQ(worst_bits(8), 135U);
  EXPECT_EQ(worst_bits(0), 55U);
  EXPECT_NEAR(load(messages, 250e3), 1.08, 1e-9);
}

TEST(ResponseTime, EveryMessageOfTheFileIsInTheTable) {
  const std::size_t in_the_file = std::tuple_size_v<can::Messages>;
  EXPECT_EQ(messages_on_the_bus(10, 0, Cells::measured_by_the_board).size(), in_the_file);
  const auto with_samples = messages_on_the_bus(10, 0, Cells::measured_by_another_node);
  EXPECT_EQ(with_samples.size(), in_the_file + 13) << "check, current and voltage, link, eight of cells, temperatures, time";
  std::set<std::uint32_t> ids;
  for (const Message& m : with_samples) EXPECT_TRUE(ids.insert(m.id).second) << "two messages with the identifier of " << m.name;
}

}  // namespace
}  // namespace bms::can_bus
