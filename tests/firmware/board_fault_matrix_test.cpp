// A part of the fault matrix on the image of the forklift board in the emulator: every protection below, above, in
// noise and during another fault. The whole matrix: ./bms faults
#include "tests/firmware/board_fault_matrix.hpp"

#include <gtest/gtest.h>

#include "tests/firmware/board_truck.hpp"

namespace bms::protection {
namespace {

TEST(BoardFaultMatrix, EveryFaultIsPublishedInItsTimeAndNoOtherAndOpensAsTheTableSays) {
  const MatrixResult result = run_fault_matrix(false, 1, 2);
  for (const std::string& line : result.wrong) ADD_FAILURE() << line;
  EXPECT_EQ(result.missed, 0U);
  EXPECT_EQ(result.falsely, 0U);
  EXPECT_GT(result.cases, 100U);
  EXPECT_GT(result.samples, 20'000U);
  for (std::size_t k = 0; k < fault_count; ++k) {
    if (!in_frames(k)) continue;
    EXPECT_GE(result.rows[k].silent, 1) << expected_rows[k].name;
    EXPECT_EQ(result.rows[k].above.cases, 1) << expected_rows[k].name;
  }
}

}  // namespace
}  // namespace bms::protection
