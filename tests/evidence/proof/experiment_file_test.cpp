#include "proof/experiment_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "files/bad_input.hpp"

namespace bms::proof {
namespace {

using ::testing::HasSubstr;

const std::string& text_of(const std::string& name) {
  for (const ExperimentText& one : experiment_texts()) {
    if (one.name == name) return one.text;
  }
  throw std::out_of_range(name);
}

/// The experiment with one piece replaced.
std::string changed(const std::string& name, const std::string& piece, const std::string& replacement) {
  std::string text = text_of(name);
  const std::size_t at = text.find(piece);
  EXPECT_NE(at, std::string::npos) << piece;
  return text.replace(at, piece.size(), replacement);
}

std::string rejection(const std::string& text) {
  try {
    parse_experiment(text, "e.toml");
  } catch (const files::BadInput& error) {
    EXPECT_THAT(error.what(), ::testing::MatchesRegex("e.toml:[0-9]+: [^\n]+, expected [^\n]+"));
    return error.what();
  }
  ADD_FAILURE() << "accepted";
  return "";
}

TEST(ExperimentFile, EveryBuiltInExperimentIsValidAndHasItsFileNameAsId) {
  std::set<std::string> ids;
  ASSERT_EQ(experiments().size(), experiment_texts().size());
  for (std::size_t k = 0; k < experiments().size(); ++k) {
    const Experiment& e = experiments()[k];
    EXPECT_EQ(e.id, experiment_texts()[k].name);
    EXPECT_TRUE(ids.insert(e.id).second);
    EXPECT_FALSE(e.recordings.empty()) << e.id;
    EXPECT_GT(e.rows, 0) << e.id;
    EXPECT_NE(e.procedure, nullptr) << e.id;
  }
}

TEST(ExperimentFile, RejectsABadFileWithOneLine) {
  EXPECT_THAT(rejection(""), HasSubstr("e.toml:1: 'id' is missing"));
  EXPECT_THAT(rejection("id = \n"), HasSubstr("expected an experiment in TOML"));
  EXPECT_THAT(rejection(changed("faults", "rows = 58_000", "rows = \"many\"")), HasSubstr("'rows' is not acceptable"));
  EXPECT_THAT(rejection(changed("faults", "rows = 58_000", "rows = 58_000\ncolour = 1")),
              HasSubstr("unknown key 'colour'"));
  EXPECT_THAT(rejection(changed("faults", "added_faults", "no_such_thing")), HasSubstr("expected one of: hysteresis"));
}

TEST(ExperimentFile, RejectsAnUnknownMechanismOrParameter) {
  EXPECT_THAT(rejection(changed("relaxation", "[\"slow_polarisation\"]", "[\"slow_polarization\"]")),
              HasSubstr("'claim.named.mechanisms' is not acceptable"));
  EXPECT_THAT(rejection(changed("hysteresis", "\"half_gap_v\"", "\"gap_v\"")),
              HasSubstr("'claim.half_gap.parameter' is not acceptable, expected a parameter of ocv_hysteresis"));
}

TEST(ExperimentFile, RejectsAPlaceholderThatTheProcedureDoesNotFill) {
  EXPECT_THAT(rejection(changed("holdouts", "open loop on {recording}", "open loop on {cell}")),
              HasSubstr("expected no placeholders but {recording}, {before}, {after}"));
}

TEST(ExperimentFile, RejectsAFaultWithoutAllItsSizes) {
  EXPECT_THAT(rejection(changed("faults",
                                "amount = 25\n[[fault.size]]\nparameter = \"limit_a\"\nunit = \"A\"\n"
                                "tolerance_fraction = 0.2\n",
                                "amount = 25\n")),
              HasSubstr("[[fault.size]] 2 times"));
}

}  // namespace
}  // namespace bms::proof
