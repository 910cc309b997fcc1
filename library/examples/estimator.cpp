// The estimator in C++: prints the state of charge during a minute of discharge at 6 A.
#include <cstdio>

#include <greybox/estimator.hpp>

#include "my_cell.hpp"

int main() {
  greybox::Estimator<float, bms::generated::Model> estimator;
  for (int second = 0; second <= 60; ++second) {
    const greybox::Sample sample{.time_us = static_cast<std::uint64_t>(second) * 1'000'000,
                                 .current_ua = second == 0 ? 0 : -6'000'000,
                                 .voltage_uv = second == 0 ? 3'330'000 : 3'250'000,
                                 .temperature_cdegc = 2'500};
    const auto estimate = estimator.step(bms::generated::cell<float>, sample);
    if (second % 20 == 0)
      std::printf("%2d s: %.4f +- %.4f\n", second, static_cast<double>(estimate.soc),
                  static_cast<double>(estimate.soc_sigma));
  }
}
