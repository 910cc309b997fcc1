// Whether probabilities that are stated come true as often as they say.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace bms::numerics {

/// Expected calibration error: findings in five bins of their probability. (M. P. Naeini et al., AAAI 2015.)
class CalibrationError {
 public:
  void add(double probability, bool right) {
    Bin& b = bins_[static_cast<std::size_t>(std::min(probability * 5, 4.0))];
    b.probability += probability;
    b.right += right ? 1 : 0;
    ++count_;
  }
  std::size_t count() const { return count_; }
  /// 0..1; 0 without findings.
  double error() const {
    double error = 0;
    for (const Bin& b : bins_) {
      if (count_ > 0) error += std::abs(b.probability - b.right) / static_cast<double>(count_);
    }
    return error;
  }

 private:
  struct Bin {
    double probability = 0, right = 0;
  };
  std::array<Bin, 5> bins_{};
  std::size_t count_ = 0;
};

}  // namespace bms::numerics
