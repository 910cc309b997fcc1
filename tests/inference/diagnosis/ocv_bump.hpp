// A made-up mechanism: the open-circuit voltage has a bump at half charge. It has this file and its place in the
// catalogue, and nothing else anywhere.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct OcvBump {
  static constexpr std::string_view id = "ocv_bump";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"height_v", "V", Role::strength, 0, -0.2, 0.2, Per::cell, "at half charge; 0 from 5 % of soc away"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables;
    Voltage<S> height_v;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : height_v(Voltage<S>(p[0])) {}

    constexpr void tables(TablePoint<S>& at, const Soc<S>& soc, const StepInput<S>&) const {
      const Soc<S> apart = soc < Soc<S>(0.5) ? Soc<S>(Soc<S>(0.5) - soc) : Soc<S>(soc - Soc<S>(0.5));
      if (apart < Soc<S>(0.05)) at.ocv_v = at.ocv_v + Voltage<S>(height_v * Soc<S>(Soc<S>(1) - Soc<S>(20) * apart));
    }
  };
};

}  // namespace bms::model
