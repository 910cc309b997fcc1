// The thermistor 103AT by the equation of Steinhart and Hart through three values of the manufacturer (-20, 25 and 70
// degrees C): its resistance at a temperature and the reverse, independent of the firmware's table.
#pragma once

#include <array>
#include <cmath>

namespace bms {

/// Temperature at which the thermistor has this resistance.
inline double thermistor_celsius(double ohm) {
  // 1/T = a + b ln R + c (ln R)^3 at three points
  constexpr double t[] = {253.15, 298.15, 343.15}, r[] = {67'770, 10'000, 2'228};
  const double l[] = {std::log(r[0]), std::log(r[1]), std::log(r[2])}, y[] = {1 / t[0], 1 / t[1], 1 / t[2]};
  const double g2 = (y[1] - y[0]) / (l[1] - l[0]), g3 = (y[2] - y[0]) / (l[2] - l[0]);
  const double c = (g3 - g2) / (l[2] - l[1]) / (l[0] + l[1] + l[2]);
  const double b = g2 - c * (l[0] * l[0] + l[0] * l[1] + l[1] * l[1]);
  const double a = y[0] - l[0] * (b + l[0] * l[0] * c);
  const double at = std::log(ohm);
  return 1 / (a + b * at + c * at * at * at) - 273.15;
}

inline double thermistor_ohm(double celsius) {
  double low = std::log(10.0), high = std::log(1e7);
  for (int k = 0; k < 100; ++k) {
    const double middle = (low + high) / 2;
    (thermistor_celsius(std::exp(middle)) > celsius ? low : high) = middle;
  }
  return std::exp(low);
}

}  // namespace bms
