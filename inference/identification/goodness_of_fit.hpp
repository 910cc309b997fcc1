// Figures of merit of a prediction compared with a measurement.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace bms::identification {

/// RMS and largest absolute value of errors; NaN is left out.
class ErrorFigure {
 public:
  void add(double error) {
    if (std::isnan(error)) return;
    squares_ += error * error;
    largest_ = std::max(largest_, std::abs(error));
    ++count_;
  }
  std::size_t count() const { return count_; }
  double rms() const { return count_ > 0 ? std::sqrt(squares_ / static_cast<double>(count_)) : 0; }
  double max() const { return largest_; }

 private:
  double squares_ = 0, largest_ = 0;
  std::size_t count_ = 0;
};

/// fit = 100 (1 - |y - y_hat| / |y - mean(y)|) in percent (Eq. A6); 0 where y is constant. NaN is left out.
class FitFigure {
 public:
  void add(double measured, double simulated) {
    if (std::isnan(measured) || std::isnan(simulated)) return;
    ++count_;
    misfit_ += (measured - simulated) * (measured - simulated);
    const double from_mean = measured - mean_;  // Welford
    mean_ += from_mean / static_cast<double>(count_);
    spread_ += from_mean * (measured - mean_);
  }
  double percent() const { return spread_ > 0 ? 100 * (1 - std::sqrt(misfit_ / spread_)) : 0; }

 private:
  double misfit_ = 0, spread_ = 0, mean_ = 0;
  std::size_t count_ = 0;
};

}  // namespace bms::identification
