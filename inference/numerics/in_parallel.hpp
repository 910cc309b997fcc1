// Work for several processors. Results must not depend on how many there are: each piece writes its own result.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

namespace bms::numerics {

/// Processors that no call of in_parallel uses at present. Calls within a piece of work take those that are left.
inline std::atomic<int>& idle_processors() {
  static std::atomic<int> idle = static_cast<int>(std::max(1U, std::thread::hardware_concurrency())) - 1;
  return idle;
}

/// Limits the processors of all calls together, that of the caller included. To be called before any of them.
inline void use_processors(int at_most) { idle_processors() = std::max(1, at_most) - 1; }

/// Pieces into which work that can be cut as one likes is best cut at present: one if no other processor is idle.
inline std::size_t best_pieces() { return static_cast<std::size_t>(std::max(0, idle_processors().load())) + 1; }

/// Takes an idle processor for its lifetime, if there is one.
class IdleProcessor {
 public:
  IdleProcessor() : taken_(idle_processors()-- > 0) {
    if (!taken_) ++idle_processors();
  }
  IdleProcessor(IdleProcessor&& o) noexcept : taken_(std::exchange(o.taken_, false)) {}
  IdleProcessor& operator=(IdleProcessor&&) = delete;
  ~IdleProcessor() {
    if (taken_) ++idle_processors();
  }
  explicit operator bool() const { return taken_; }

 private:
  bool taken_;
};

/// Runs work(k) for k = 0 .. count - 1, in this thread and in one for each processor that is idle. Rethrows the
/// exception of the first k that threw, after all have ended.
template <class Work>
void in_parallel(std::size_t count, const Work& work) {
  std::atomic<std::size_t> next = 0;
  std::vector<std::exception_ptr> thrown(count);
  const auto take = [&] {
    for (std::size_t k = next++; k < count; k = next++) {
      try {
        work(k);
      } catch (...) {
        thrown[k] = std::current_exception();
      }
    }
  };
  std::vector<std::thread> others;
  while (others.size() + 1 < count) {
    IdleProcessor processor;
    if (!processor) break;
    // given back as soon as nothing is left to take: what the last pieces call may use it
    others.emplace_back([&take, taken = std::move(processor)] { take(); });
  }
  take();
  ++idle_processors();  // this one, while it waits
  for (std::thread& t : others) t.join();
  --idle_processors();
  for (const std::exception_ptr& e : thrown) {
    if (e) std::rethrow_exception(e);
  }
}

}  // namespace bms::numerics
