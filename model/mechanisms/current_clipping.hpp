// The current sensor saturates at +-L: beyond L, the true current exceeds the reading by e on average. The reading
// bends before it saturates, from (1 - knee) L on.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct CurrentClipping {
  static constexpr std::string_view id = "current_clipping";
  static constexpr Domain domain = Domain::instrument;
  static constexpr bool on_board = false;
  static constexpr bool needs_fpu = true;
  static constexpr std::array parameters = {
      Parameter{"excess_a", "A", Role::strength, 0, 0, 8, Per::ah,
                "e: mean current beyond L while the sensor saturates; bounds in multiples of 1C"},
      Parameter{"limit_a", "A", Role::given, 1, 0, 100, Per::ah, "L, the largest reading"},
      Parameter{"knee", "1", Role::shape, 0.1, 0.01, 0.7, Per::cell, "share of L over which the reading bends"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::true_current;
    Current<S> excess_a, limit_a, from_a;

    template <class Real>
    constexpr Law(const std::array<Real, 3>& p, double)
        : excess_a(Current<S>(p[0])), limit_a(Current<S>(p[1])), from_a(Current<S>(p[1] * (Real(1) - p[2]))) {}

    constexpr Current<S> true_current(const Current<S>& read_a) const {
      const bool negative = read_a < Current<S>(0);
      const Current<S> size_a = negative ? Current<S>(-read_a) : read_a;
      if (!(size_a > from_a)) return read_a;
      const Current<S> more_a = excess_a * ((size_a - from_a) / (limit_a - from_a));
      return negative ? Current<S>(read_a - more_a) : Current<S>(read_a + more_a);
    }
  };
};

}  // namespace bms::model
