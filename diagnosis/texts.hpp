// A diagnosis in words: what each mechanism is to a technician, one sentence for the verdict, and why this cause and
// not its neighbour.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/diagnose.hpp"

namespace bms::diagnosis {

/// A mechanism of the catalogue, told.
struct MechanismText {
  std::string_view id;
  std::string_view name;     ///< "OCV hysteresis"
  std::string_view brief;    ///< the claim without a number, as part of a sentence
  std::string_view mark;     ///< how it shows, after its name: "turns with ..."
  std::string_view meaning;  ///< what goes on
  std::string_view action;   ///< what to do about it
};
const MechanismText& text_of_mechanism(std::size_t mechanism);

/// A number with its deviation in a unit that suits its size: "12.4 +- 0.8 mV". deviation 0: the number alone. Its sign
/// as it stands.
std::string quantity(double value, double deviation, std::string_view unit);

/// The same for a parameter of a mechanism; shares and fractions in percent.
std::string parameter_text(const model::Parameter& parameter, double value, double deviation);

/// What a finding says, with its number, as the beginning of a sentence: "the cell holds 8.1 +- 0.5 % less charge than
/// its file says".
std::string claim(const MechanismSetting& setting);

/// What the recordings hold that tells neighbours apart.
struct RecordingFacts {
  double capacity_ah = 1;
  double error_v = 0;  ///< RMS of measured less cell file's voltage
  double longest_rest_s = 0;
  std::size_t reversals = 0;      ///< of the charge's direction, 1 % of the capacity or more each way
  std::size_t rates = 0;          ///< kinds of current, told apart by a third
  double temperature_span_k = 0;  ///< 0: not recorded, or constant
  double soc_span = 0;
};
RecordingFacts recording_facts(const model::CellParameters<>& cell, const std::vector<PreparedRecording>& records,
                               const std::vector<RecordingView>& views);

/// "a, b and c"; last: "and", "or".
std::string joined(const std::vector<std::string>& parts, const char* last);

/// "2:14 h", "3:05 min", "12 s".
std::string duration_text(double seconds);

/// One sentence for the verdict.
std::string statement(const Diagnosis& diagnosis, const RecordingFacts& occasions);

/// Why this finding and not its best rival: the fact that parts them, and by how much the rival fits worse.
std::string because(const Diagnosis& diagnosis, const Finding& finding, const RecordingFacts& occasions);

/// Fills in what the diagnosis leaves empty of statement and Finding::because.
void describe(Diagnosis& diagnosis, const model::CellParameters<>& cell, const std::vector<PreparedRecording>& records);

}  // namespace bms::diagnosis
