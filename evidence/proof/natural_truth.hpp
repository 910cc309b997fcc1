// What is truly there in a recording, from the measurement that is withheld from the diagnosis.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "diagnosis/verdict.hpp"
#include "measurement/recording.hpp"
#include "proof/natural_judge.hpp"

namespace bms::proof {

/// A [[case]] of the list: a fault that nobody put in. Paths are relative to the folder of the data.
struct NaturalCase {
  std::string name, set;                ///< the set from which the cell file is identified
  std::string recording;                ///< with all columns
  std::string current, voltage;         ///< columns that are taken for current_a and voltage_v; empty: these
  std::string second;                   ///< another recording with the same; empty: none
  std::string before;                   ///< a healthy recording before it; empty: none
  std::string cycles;                   ///< table with the capacity of every cycle of the cell
  std::vector<std::string> references;  ///< reference columns that are there to be given
  std::vector<std::string> truths;      ///< what is there: "contact", "current_gain", ...
  std::vector<std::string> also;        ///< causes that may be named or not
  double within = 0;                    ///< of the first truth, as a share of its value
  bool set_aside = false;               ///< decided nothing
  bool without_temperature = false;
};

/// What is given in addition to the recording with its withheld columns.
struct Given {
  bool references = false, second = false, before = false;
};
std::string name_of(const Given& given);

/// The recording as the diagnosis gets it.
measurement::Recording as_given(const measurement::Recording& whole, const NaturalCase& c, bool with_references);

/// All truths of a case. whole: the recording with all columns. calibration: files of the set.
std::vector<Truth> truths_of(const NaturalCase& c, const measurement::Recording& whole, const std::string& data_folder,
                             const std::vector<std::string>& calibration, const Given& given);

/// The answer, with sizes in the units of the truths. records: as they were diagnosed.
Answer answer_of(const diagnosis::Diagnosis& d, const std::vector<diagnosis::PreparedRecording>& records,
                 const std::vector<Truth>& truths);

}  // namespace bms::proof
