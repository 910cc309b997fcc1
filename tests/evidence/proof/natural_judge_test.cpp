// The judgement of answers about faults that nobody put in.
#include "proof/natural_judge.hpp"

#include <gtest/gtest.h>

namespace bms::proof {
namespace {

const Truth contact{"contact", {"contact_step", "resistance_growth"}, "ohm", 0.47, 0.014, true, "both voltmeters"},
    hidden_gain{"current_gain", {"current_gain"}, "", -0.007, 0.002, false, "both ammeters"};

Possible cause(const std::string& id, const std::string& what, double size) {
  return {id, {{what, size}}, {{what, 0.001}}};
}

Outcome outcome(const Answer& a, const std::vector<Truth>& truths, const std::vector<std::string>& also = {}) {
  return judge(a, truths, also).outcome;
}

TEST(NaturalJudge, NameAndSizeMustBeRight) {
  EXPECT_EQ(outcome({"CAUSE", {{cause("contact_step", "contact", 0.475)}}, {}, {}}, {contact}), Outcome::right);
  EXPECT_EQ(outcome({"CAUSE", {{cause("contact_step", "contact", 0.5)}}, {}, {}}, {contact}), Outcome::size_off);
  const Answer two{"CAUSES", {{cause("contact_step", "contact", 0.47)}, {{"self_heating", {}, {}}}}, {}, {}};
  EXPECT_EQ(outcome(two, {contact}), Outcome::wrong) << "a second name that is wrong";
  EXPECT_EQ(outcome(two, {contact}, {"self_heating"}), Outcome::right);
}

TEST(NaturalJudge, OfSeveralAlikeTheSizeIsThatOfTheOneThatIsNamed) {
  const Answer with_size{
      "AMBIGUOUS", {{cause("polarisation_growth", "contact", 0.46), {"resistance_growth", {}, {}}}}, {}, {}};
  EXPECT_EQ(outcome(with_size, {contact}), Outcome::right);
  const Answer without{"AMBIGUOUS", {{{"slow_polarisation", {}, {}}, {"resistance_growth", {}, {}}}}, {}, {}};
  EXPECT_EQ(outcome(without, {contact}), Outcome::undecided);
}

TEST(NaturalJudge, ToSayNothingIsRightOnlyWhereNothingCanBeSeen) {
  EXPECT_EQ(outcome({"NO_MISMATCH", {}, {}, {{"current_gain", 0.03}}}, {hidden_gain}), Outcome::right);
  EXPECT_EQ(outcome({"NO_MISMATCH", {}, {}, {{"current_gain", 0.005}}}, {hidden_gain}), Outcome::wrong)
      << "it says that 0.5 % would have shown";
  EXPECT_EQ(outcome({"CAUSE", {{cause("current_gain", "current_gain", -0.03)}}, {}, {}}, {hidden_gain}),
            Outcome::wrong);
  EXPECT_EQ(outcome({"NO_MISMATCH", {}, {}, {}}, {contact}), Outcome::undecided);
  EXPECT_EQ(outcome({"NO_MISMATCH", {}, {}, {{"contact", 0.01}}}, {contact}), Outcome::wrong);
  EXPECT_EQ(outcome({"UNKNOWN", {}, {}, {}}, {}), Outcome::undecided) << "nothing is there";
}

TEST(NaturalJudge, AFaultOfTheDataIsRightOnlyIfItIsThere) {
  const Answer inverted{"DATA_FAULT", {}, {"current_inverted"}, {}};
  EXPECT_EQ(outcome(inverted, {{"sign", {"current_inverted"}, "", -1, 0, true, ""}}), Outcome::right);
  EXPECT_EQ(outcome(inverted, {contact}), Outcome::wrong);
}

TEST(NaturalJudge, MoreDataMakeAnAnswerWorse) {
  const Judgement named = judge({"CAUSE", {{cause("contact_step", "contact", 0.47)}}, {}, {}}, {contact}, {}),
                  nothing = judge({"UNKNOWN", {}, {}, {}}, {contact}, {}),
                  invisible = judge({"NO_MISMATCH", {}, {}, {}}, {hidden_gain}, {});
  EXPECT_TRUE(made_worse(named, nothing));
  EXPECT_FALSE(made_worse(nothing, named));
  EXPECT_FALSE(made_worse(invisible, nothing)) << "the same answer, where it could now be seen";
}

}  // namespace
}  // namespace bms::proof
