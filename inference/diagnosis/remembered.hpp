// A result that is kept for later users, who may be in several threads.
#pragma once

#include <memory>
#include <mutex>

namespace bms::diagnosis {

/// Two threads that miss it at once both compute it, with equal results: one of them is kept. A copy shares the result.
template <class Result>
class Remembered {
 public:
  Remembered() = default;
  Remembered(const Remembered& other) : result_(other.get()) {}
  Remembered& operator=(const Remembered& other) {
    set(other.get());
    return *this;
  }
  ~Remembered() = default;

  std::shared_ptr<const Result> get() const {
    const std::lock_guard one_at_a_time(access_);
    return result_;
  }
  std::shared_ptr<const Result> set(std::shared_ptr<const Result> result) {
    const std::lock_guard one_at_a_time(access_);
    return result_ = std::move(result);
  }

 private:
  mutable std::mutex access_;
  std::shared_ptr<const Result> result_;
};

}  // namespace bms::diagnosis
