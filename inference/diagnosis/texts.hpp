// A diagnosis in words: what is wrong, how sure that is, and what to do next; and why this cause and not a rival.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/mechanism.hpp"
#include "diagnosis/quantity_text.hpp"
#include "diagnosis/recording_facts.hpp"

namespace bms::diagnosis {

/// mechanism: index in the catalogue.
const MechanismText& text_of_mechanism(std::size_t mechanism);

/// What a finding says, with its number, as the beginning of a sentence: "the cell holds 8.1 ± 0.5 % less charge than
/// its file says".
std::string claim(const MechanismSetting& setting);

/// What is wrong, how sure, what to do next.
std::string statement(const Diagnosis& diagnosis, const RecordingFacts& facts);

/// The end of a statement that nothing is wrong.
inline constexpr std::string_view no_action = "No action is needed.";

/// The end of an ambiguous statement.
inline constexpr std::string_view another_experiment = "Another experiment is needed.";

/// What to do where causes have rivals that no experiment would distinguish; empty if none has any.
std::string nothing_more_text(const Diagnosis& diagnosis);

/// Why this finding and not its best rival: the fact that distinguishes them, and by how much the rival fits worse.
std::string because(const Diagnosis& diagnosis, const Finding& finding, const RecordingFacts& facts);

/// Resistances at the temperature of the recordings, each a phrase: "at -5 degrees C its resistance is 21.3 ± 0.2 mOhm,
/// at 25 degrees C 7 ± 2 mOhm". Only those that are larger, smaller or better known there.
std::vector<std::string> at_temperature_text(const Diagnosis& diagnosis, const std::vector<ResistanceAt>& resistances);

/// Fills in what the diagnosis leaves empty of statement and Finding::because.
void describe(Diagnosis& diagnosis, const model::CellParameters<>& cell, const std::vector<PreparedRecording>& records);

/// How much a text says.
struct TextStyle {
  std::size_t limits_named = 3;         ///< detection limits
  std::size_t spans_named_at_most = 3;  ///< more spans than this are not a place
  std::size_t causes_in_full = 2;       ///< the others by name: a sentence must end
  double explained_by_tables = 0.1;     ///< share below which the tables of the cell file contain what was found
  double nearest_explains = 0.2;        ///< share from which the nearest mechanism of an unknown cause is named
  double differs_share = 0.1;           ///< share by which a resistance differs from that at another temperature
  double better_times = 2;              ///< ratio of standard deviations from which a resistance is known better
  double rest_named_s = 60;             ///< shorter rests do not count
  std::size_t changes_of_a_cell = 3;    ///< causes in the cell from which another cell's file is as likely
};
inline constexpr TextStyle text_style{};

}  // namespace bms::diagnosis
