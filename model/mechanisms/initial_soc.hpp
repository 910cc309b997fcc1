// The initial state of charge differs from the given one.
#pragma once

#include "model/mechanism.hpp"

namespace bms::model {

struct InitialSoc {
  static constexpr std::string_view id = "initial_soc";
  static constexpr Domain domain = Domain::start;
  static constexpr bool on_board = false;
  static constexpr std::array parameters = {
      Parameter{"shift", "1", Role::strength, 0, -0.5, 0.5, Per::cell, "true minus given SOC"},
  };

  template <class S>
  struct Law {
    static constexpr LawMembers members = law_member::none;
    Soc<S> shift;

    template <class Real>
    constexpr Law(const std::array<Real, 1>& p, double) : shift(Soc<S>(p[0])) {}
  };
};

}  // namespace bms::model
