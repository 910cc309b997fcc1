#include "numerics/in_parallel.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>

namespace bms::numerics {
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

TEST(InParallel, UsesNoMoreProcessorsThanAllowed) {
  const int idle = idle_processors();
  use_processors(1);
  EXPECT_EQ(best_pieces(), 1U);
  const std::thread::id caller = std::this_thread::get_id();
  in_parallel(20, [&](std::size_t) { EXPECT_EQ(std::this_thread::get_id(), caller); });
  use_processors(3);
  std::atomic<int> at_work = 0;
  std::atomic<bool> all = false;
  in_parallel(3, [&](std::size_t) {
    ++at_work;
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (!all && std::chrono::steady_clock::now() < end) {
      if (at_work == 3) all = true;
    }
  });
  EXPECT_TRUE(all) << "three threads at the same time";
  idle_processors() = idle;
}

/// Pieces call it again; as many threads as processors work, whatever is nested.
TEST(InParallel, PiecesShareTheProcessors) {
  const int idle = idle_processors();
  std::atomic<int> at_work = 0, most = 0, done = 0;
  const auto outer = [&](std::size_t k) {
    in_parallel(5, [&](std::size_t) {
      const int now = ++at_work;
      for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      --at_work;
      ++done;
    });
    if (k == 2) throw std::runtime_error("given back as well");
  };
  EXPECT_THROW(in_parallel(6, outer), std::runtime_error);
  EXPECT_EQ(done, 30);
  EXPECT_LE(most, idle + 1);
  EXPECT_EQ(idle_processors(), idle);
}

}  // namespace
}  // namespace bms::numerics
