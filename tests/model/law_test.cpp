// The check of laws at compile time: what it accepts and what it refuses.
#include "model/law.hpp"

#include <gtest/gtest.h>

#include "model/mechanism.hpp"

namespace bms::model {
namespace {

/// Correct: one member, declared.
struct Offset {
  static constexpr LawMembers members = law_member::true_current;
  constexpr double true_current(double read_a) const { return read_a - 0.1; }
};
static_assert(MechanismLaw<Offset, double>);

/// The member is misspelt.
struct MisspeltMember {
  static constexpr LawMembers members = law_member::true_current;
  constexpr double true_curent(double read_a) const { return read_a - 0.1; }
};
static_assert(!MechanismLaw<MisspeltMember, double>);

/// The member takes other arguments than LawSet passes.
struct WrongArguments {
  static constexpr LawMembers members = law_member::counted;
  constexpr double counted(double counted_a) const { return counted_a; }
};
static_assert(!MechanismLaw<WrongArguments, double>);

/// The member is not declared.
struct Undeclared {
  static constexpr LawMembers members = law_member::none;
  constexpr double reading(double v) const { return 2 * v; }
};
static_assert(!MechanismLaw<Undeclared, double>);

/// Nothing is declared.
struct NoDeclaration {
  constexpr double reading(double v) const { return 2 * v; }
};
static_assert(!MechanismLaw<NoDeclaration, double>);

/// A state that does not move.
struct StateWithoutRelaxation {
  static constexpr LawMembers members = law_member::states | law_member::voltage_states | law_member::initial;
  static constexpr std::size_t states = 1;
  static constexpr bool voltage_states = true;
  constexpr double initial(std::size_t) const { return 0; }
};
static_assert(!MechanismLaw<StateWithoutRelaxation, double>);

/// A relaxation with the law's own states as fourth argument.
struct OwnStates {
  static constexpr LawMembers members =
      law_member::states | law_member::voltage_states | law_member::initial | law_member::relaxation;
  static constexpr std::size_t states = 1;
  static constexpr bool voltage_states = true;
  constexpr double initial(std::size_t) const { return 0; }
  constexpr Relaxation<double> relaxation(std::size_t, const TablePoint<double>&, const StepInput<double>&,
                                          const double* x) const {
    return {0.5, x[0]};
  }
};
static_assert(MechanismLaw<OwnStates, double>);

TEST(MechanismLaw, FindsTheMembersOfALaw) {
  EXPECT_EQ((law_member::found_in<Offset, double>()), LawMembers{law_member::true_current});
  EXPECT_EQ((law_member::found_in<MisspeltMember, double>()), LawMembers{law_member::none});
  EXPECT_EQ((law_member::found_in<OwnStates, double>()), OwnStates::members);
}

}  // namespace
}  // namespace bms::model
