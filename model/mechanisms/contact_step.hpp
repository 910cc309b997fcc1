// A contact becomes worse at one moment and stays so: from that moment a resistance is added to R0. On a board, which
// does not start recordings again, it is always added.
#pragma once

#include "arithmetic/exponential.hpp"
#include "model/mechanism.hpp"

namespace bms::model {

struct ContactStep {
  static constexpr std::string_view id = "contact_step";
  static constexpr Domain domain = Domain::physics;
  static constexpr bool on_board = true;
  static constexpr std::array parameters = {
      Parameter{"resistance_ohm", "ohm", Role::strength, 0, -0.05, 1.5, Per::siemens, "added to R0"},
      Parameter{"onset_s", "s", Role::given, 0, -1e12, 1e12, Per::cell,
                "time in the recording; in later recordings it acts from the start"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::tables | law_member::at;
    Resistance<S> added_ohm;
    double onset_s = 0;
    bool active = true;

    template <class Real>
    constexpr Law(const std::array<Real, 2>& p, double) : added_ohm(Resistance<S>(p[0])) {
      if constexpr (Dual<Real>)
        onset_s = p[1].a;
      else
        onset_s = p[1];
    }

    constexpr void at(double time_s) { active = time_s >= onset_s; }
    constexpr void tables(TablePoint<S>& at, const Soc<S>&, const StepInput<S>&) const {
      if (active) at.r0_ohm = Resistance<S>(at.r0_ohm + added_ohm);
    }
  };
};

}  // namespace bms::model
