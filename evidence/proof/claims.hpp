// Claims of an experiment: sentences and tolerances from its file, filled with what was diagnosed and measured.
#pragma once

#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "files/toml_table.hpp"
#include "proof/findings.hpp"
#include "proof/proof.hpp"

namespace bms::proof {

/// Values of the {placeholders} of a sentence.
using Words = std::vector<std::pair<std::string_view, std::string>>;

/// Sentences of a claim with {placeholders}.
struct ClaimText {
  std::string id;      ///< without the id of the experiment
  std::string text;    ///< what is to be shown
  std::string source;  ///< the independent measurement
};

/// Holds if one of the mechanisms is named, alone or among others that the recording cannot distinguish from it.
struct NamedClaim {
  ClaimText text;
  std::vector<std::string> mechanisms;
};

/// Holds if a number of the diagnosis is near a measured one.
struct NumberClaim {
  ClaimText text;
  ParameterName parameter;         ///< of the diagnosis; empty if the experiment computes the number
  std::optional<double> measured;  ///< if it is known beforehand
  double sigma = 0;                ///< standard deviation of the measurement, if it is known beforehand
  double tolerance = 0;            ///< largest difference
  std::string unit;
};

/// Holds if the error of the extended cell file is at most `ratio` of that of the cell file.
struct ErrorClaim {
  ClaimText text;
  double ratio = 0;
};

// Read [claim.NAME] of an experiment; `placeholders` are those that its sentences may use. Throw BadInput.
ClaimText read_claim_text(files::TomlTable& claims, const std::string& name,
                          std::initializer_list<std::string_view> placeholders);
NamedClaim read_named_claim(files::TomlTable& claims, const std::string& name,
                            std::initializer_list<std::string_view> placeholders);
NumberClaim read_number_claim(files::TomlTable& claims, const std::string& name,
                              std::initializer_list<std::string_view> placeholders);
ErrorClaim read_error_claim(files::TomlTable& claims, const std::string& name,
                            std::initializer_list<std::string_view> placeholders);

/// A number of the diagnosis and the measured one.
struct ComparedNumber {
  std::optional<Value> claimed;  ///< nothing: the diagnosis gave none
  std::string diagnosed;         ///< what the diagnosis reported, in words
  Value measured;
  double tolerance = 0;
  std::string unit;
  bool visible = true;  ///< false: "no size" is right as well
};

/// A cause that may be too small for a recording.
struct Visibility {
  std::string limit;    ///< stated beforehand, in words; empty: none is stated
  bool visible = true;  ///< false: it is below that limit, and naming nothing is right as well
};

void add_named(ProofExperiment& experiment, const NamedClaim& claim, const Words& words,
               const workflow::DiagnoseResult& diagnosis, const Visibility& visibility = {});
void add_number(ProofExperiment& experiment, const ClaimText& text, const Words& words, const ComparedNumber& number);
void add_errors(ProofExperiment& experiment, const ErrorClaim& claim, const Words& words, double before_v,
                double after_v);

/// A claim that holds or not, without a number.
struct Outcome {
  std::string diagnosed;  ///< what the diagnosis reported, in words
  std::string expected;
  bool holds = false;
};
void add_outcome(ProofExperiment& experiment, const ClaimText& text, const Words& words, const Outcome& outcome);

/// "12.34 mV".
std::string millivolts(double volts);

/// "a123_26650/udds_P25_A002" without its folder.
std::string stem(const std::string& recording);

}  // namespace bms::proof
