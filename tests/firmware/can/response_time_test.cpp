#include "tests/firmware/can/response_time.hpp"

#include <gtest/gtest.h>

#include <set>

namespace bms::can_bus {
namespace {

/// Table 2 in section 3.1 of the paper. The older analysis gave 3 ms for C.
TEST(ResponseTime, AgreesWithThePapersExampleInWhichTheSecondInstanceIsWorst) {
  const std::vector<Message> messages{{"A", 1, 8, 2.5e-3, 0}, {"B", 2, 8, 3.5e-3, 0}, {"C", 3, 8, 3.5e-3, 0}};
  const auto a_millisecond = [](const Message&) { return 1e-3; };
  EXPECT_NEAR(response_s(messages, 0, 1e-3, 8e-6, a_millisecond), 2e-3, 1e-9);
  EXPECT_NEAR(response_s(messages, 1, 1e-3, 8e-6, a_millisecond), 3e-3, 1e-9);
  EXPECT_NEAR(response_s(messages, 2, 0, 8e-6, a_millisecond), 3.5e-3, 1e-9);
}

TEST(ResponseTime, IsInfiniteOnAFullBusAndAFrameHasAtMost135Bits) {
  const std::vector<Message> messages{{"A", 1, 8, 1e-3, 0}, {"B", 2, 8, 1e-3, 0}};
  EXPECT_TRUE(std::isinf(response_on_the_bus_s(messages, 1, 250e3)));
  EXPECT_FALSE(std::isinf(response_on_the_bus_s(messages, 0, 250e3)));
  EXPECT_EQ(worst_bits(8), 135U);
  EXPECT_EQ(worst_bits(0), 55U);
  EXPECT_EQ(worst_bits(8, true), 160U) << "of 29 bits";
  EXPECT_NEAR(load(messages, 250e3), 1.08, 1e-9);
}

TEST(ResponseTime, CoversEveryMessageOfTheDbcFile) {
  const std::size_t in_the_file = std::tuple_size_v<can::Messages>;
  EXPECT_EQ(messages_on_the_bus(10, 0, Cells::measured_by_the_board, Profile::none, Pack::of_32_cells).size(),
            in_the_file);
  EXPECT_EQ(messages_on_the_bus(10, 0, Cells::measured_by_the_board).size(), in_the_file - 5)
      << "without cells 17 to 32 and the voltage of a large pack";
  const auto with_samples = messages_on_the_bus(10, 0, Cells::measured_by_another_node);
  EXPECT_EQ(with_samples.size(), in_the_file - 5 + 13)
      << "check, current and voltage, DC link, eight of cells, temperatures, time";
  for (const Profile profile : {Profile::none, Profile::cia418, Profile::j1939}) {
    std::set<std::uint32_t> ids;
    for (const Message& m : messages_on_the_bus(10, 0, Cells::measured_by_another_node, profile, Pack::of_32_cells))
      EXPECT_TRUE(ids.insert(m.id).second) << "two messages with the identifier of " << m.name;
  }
}

TEST(ResponseTime, StaysBelowThePeriodAndTheLoadBelow30PercentWithEitherProfile) {
  constexpr double bits_per_second = 250e3;
  const auto without = messages_on_the_bus(10, sample_to_queue_s, Cells::measured_by_another_node);
  const auto judge = [&](Profile profile, std::size_t more, double more_bits_each_second) {
    const auto all = messages_on_the_bus(10, sample_to_queue_s, Cells::measured_by_another_node, profile);
    EXPECT_EQ(all.size(), without.size() + more);
    EXPECT_LT(load(all, bits_per_second), 0.3);
    EXPECT_NEAR(load(all, bits_per_second) - load(without, bits_per_second), more_bits_each_second / bits_per_second,
                1e-9);
    for (std::size_t k = 0; k < all.size(); ++k)
      EXPECT_LE(response_on_the_bus_s(all, k, bits_per_second), all[k].period_s) << all[k].name;
    return all;
  };
  judge(Profile::cia418, 4, 2 * 65 + 5 * (85 + 125 + 85));
  const auto all = judge(Profile::j1939, 6, 7 * 160);
  for (std::size_t k = 0; k < all.size(); ++k)
    EXPECT_EQ(all[k].long_id, k + 6 >= all.size()) << all[k].name << ": the battery's own messages are sent first";
}

/// 32 cells at 250 kbit/s: 31 % if another node measures them.
TEST(ResponseTime, OfAPackOf32CellsStaysBelowThePeriod) {
  for (const Profile profile : {Profile::none, Profile::cia418, Profile::j1939}) {
    auto all = messages_on_the_bus(10, sample_to_queue_s, Cells::measured_by_another_node, profile, Pack::of_32_cells);
    for (std::size_t k = 0; k < all.size(); ++k)
      EXPECT_LE(response_on_the_bus_s(all, k, 250e3), all[k].period_s) << all[k].name;
    EXPECT_LT(load(all, 500e3), 0.3);
    const auto own =
        messages_on_the_bus(10, sample_to_queue_s, Cells::measured_by_the_board, profile, Pack::of_32_cells);
    EXPECT_LT(load(own, 250e3), 0.3);
  }
}

TEST(ResponseTime, OfAPackOf24CellsStaysBelowThePeriodAndTheLoadBelow30Percent) {
  for (const Profile profile : {Profile::none, Profile::cia418, Profile::j1939}) {
    auto all = messages_on_the_bus(10, sample_to_queue_s, Cells::measured_by_another_node, profile, Pack::of_24_cells);
    for (std::size_t k = 0; k < all.size(); ++k)
      EXPECT_LE(response_on_the_bus_s(all, k, 250e3), all[k].period_s) << all[k].name;
    EXPECT_LT(load(all, 500e3), 0.3) << "a pack above 655 A, which sends PackCurrent, needs 500 kbit/s for this";
    EXPECT_EQ(std::erase_if(all, [](const Message& m) { return m.id == can::PackCurrent::id; }), 1U);
    EXPECT_LT(load(all, 250e3), 0.31) << "while a workshop reads the parameters";
    EXPECT_EQ(std::erase_if(all, [](const Message& m) { return m.id == can::ParameterValue::id; }), 1U);
    EXPECT_LT(load(all, 250e3), 0.3);
  }
}

}  // namespace
}  // namespace bms::can_bus
