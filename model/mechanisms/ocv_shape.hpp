// The knees of the open-circuit voltage lie at another SOC than in the cell file: one electrode has shifted relative to
// the other (loss of lithium) or lost material. The curve is read at a shifted SOC:
//
//   V = OCV(soc + d(soc)),  d linear between 0 at empty, d_1 at 20 %, d_2 at 80 % and 0 at full
//
// Empty and full stay at the voltage limits; in between the stages of the graphite shift together.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct OcvShape {
  static constexpr std::string_view id = "ocv_shape";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"slide_at_20", "1", Role::strength, 0, -0.15, 0.15, Per::cell, "d_1, in soc"},
      Parameter{"slide_at_80", "1", Role::strength, 0, -0.15, 0.15, Per::cell, "d_2, in soc"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::ocv_soc | law_member::ocv_soc_slope;
    Soc<S> low, high;

    template <class Real>
    constexpr Law(const std::array<Real, 2>& p, double) : low(Soc<S>(p[0])), high(Soc<S>(p[1])) {}

    constexpr Soc<S> ocv_soc(const Soc<S>& soc) const {
      const auto one = Soc<S>(1), none = Soc<S>(0), five = Soc<S>(5);
      if (!(soc > none) || !(soc < one)) return soc;
      if (soc < Soc<S>(0.2)) return soc + Soc<S>(soc * five) * low;
      if (soc < Soc<S>(0.8))
        return soc + (low + Soc<S>(Soc<S>(soc - Soc<S>(0.2)) * Soc<S>(1 / 0.6)) * Soc<S>(high - low));
      return soc + Soc<S>(Soc<S>(one - soc) * five) * high;
    }
    /// d ocv_soc / d soc
    constexpr Coupling<S> ocv_soc_slope(const Soc<S>& soc) const {
      const auto one = Soc<S>(1), none = Soc<S>(0), five = Soc<S>(5);
      if (!(soc > none) || !(soc < one)) return Coupling<S>(1);
      if (soc < Soc<S>(0.2)) return Coupling<S>(one + low * five);
      if (soc < Soc<S>(0.8)) return Coupling<S>(one + Soc<S>(high - low) * Soc<S>(1 / 0.6));
      return Coupling<S>(one - high * five);
    }
  };
};

}  // namespace bms::model
