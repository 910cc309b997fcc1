#include "measurement/in_parallel.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace bms::measurement {
namespace {

TEST(InParallel, EachPieceIsDoneOnce) {
  std::vector<int> done(1'000, 0);
  in_parallel(done.size(), [&](std::size_t k) { ++done[k]; });
  for (const int times : done) EXPECT_EQ(times, 1);
  in_parallel(0, [](std::size_t) { FAIL(); });
}

TEST(InParallel, TheFirstExceptionArrivesAfterAllHaveEnded) {
  std::atomic<int> ended = 0;
  try {
    in_parallel(20, [&](std::size_t k) {
      ++ended;
      if (k == 3 || k == 7) throw std::runtime_error(std::to_string(k));
    });
    FAIL() << "no exception";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "3");
  }
  EXPECT_EQ(ended, 20);
}

}  // namespace
}  // namespace bms::measurement
