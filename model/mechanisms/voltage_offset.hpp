// The voltage sensor has an offset: V_read = V + b.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct VoltageOffset {
  static constexpr std::string_view id = "voltage_offset";
  static constexpr Domain domain = Domain::instrument;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"offset_v", "V", Role::strength, 0, -0.5, 0.5, Per::cell, "b", 0.02},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::reading;
    Voltage<S> offset_v;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : offset_v(Voltage<S>(p[0])) {}

    constexpr Voltage<S> reading(const Voltage<S>& v) const { return v + offset_v; }
  };
};

}  // namespace bms::model
