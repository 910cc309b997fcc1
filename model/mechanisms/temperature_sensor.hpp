// The temperature sensor has an offset and a lag.
//
//   T = T_read - b + lag dT_read/dt        (the lag on the host only, where readings are smoothed over a minute)
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct TemperatureSensor {
  static constexpr std::string_view id = "temperature_sensor";
  static constexpr Domain domain = Domain::instrument;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"offset_k", "K", Role::strength, 0, -25, 25, Per::cell, "b; up to 5 K with its mounting is usual", 5},
      Parameter{"lag_s", "s", Role::strength, 0, 0, 3000, Per::cell, "time constant of the sensor's lag"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::true_temperature;
    Temperature<S> offset_k;
    Duration<S> lag_s;

    template <class Real>
    constexpr Law(const std::array<Real, 2>& p, double) : offset_k(Temperature<S>(p[0])), lag_s(Duration<S>(p[1])) {}

    constexpr Temperature<S> true_temperature(const Temperature<S>& read_c) const { return read_c - offset_k; }
  };
};

}  // namespace bms::model
