// The open-circuit voltage's steps lie at another soc than in the cell file: one electrode has slipped against the other (loss of
// lithium) or lost material. The curve is read elsewhere:
//
//   V = OCV(soc + d(soc)),  d linear between 0 at empty, d_1 at 1/3, d_2 at 2/3 and 0 at full
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct OcvShape {
  static constexpr std::string_view id = "ocv_shape";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"slide_at_33", "1", Role::strength, 0, -0.2, 0.2, Per::cell, "d_1, in soc"},
      Parameter{"slide_at_67", "1", Role::strength, 0, -0.2, 0.2, Per::cell, "d_2, in soc"},
  };

  template <class S>
  struct Law {
    Soc<S> low, high;

    template <class Real>
    constexpr Law(const std::array<Real, 2>& p, double) : low(p[0]), high(p[1]) {}

    constexpr Soc<S> read_at(const Soc<S>& soc) const {
      const Soc<S> third(1.0 / 3), two(2.0 / 3), one(1), none(0), three(3);
      if (!(soc > none) || !(soc < one)) return soc;
      if (soc < third) return soc + Soc<S>(soc * three) * low;
      if (soc < two) return soc + (low + Soc<S>(Soc<S>(soc - third) * three) * Soc<S>(high - low));
      return soc + Soc<S>(Soc<S>(one - soc) * three) * high;
    }
  };
};

}  // namespace bms::model
