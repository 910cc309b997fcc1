// The voltage sensor has a gain error: V_read = (1 + g) V.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct VoltageGain {
  static constexpr std::string_view id = "voltage_gain";
  static constexpr Domain domain = Domain::instrument;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"gain_error", "1", Role::strength, 0, -0.2, 0.2, Per::cell, "g", 0.006},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::reading;
    Factor<S> factor;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : factor(Factor<S>(Real(1) + p[0])) {}

    constexpr Voltage<S> reading(const Voltage<S>& v) const { return v * factor; }
  };
};

}  // namespace bms::model
