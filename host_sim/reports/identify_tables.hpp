// The tables of bms identify, for page, JSON and CSV.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "files/page_content.hpp"
#include "workflow/recorded_pulses.hpp"

namespace bms::reports {

/// "R0 at 50 %", as a chart names it.
std::string label_of(const identification::Parameter& p);

/// A value with its standard deviation in the unit of a data sheet, by the end of its name: "0.794 +- 0.006 mOhm".
std::string value_text(const std::string& name, double value, double std);

/// Two parameters whose errors belong together: at -1 only their sum is known, at 1 only their difference.
struct CorrelatedPair {
  std::size_t a = 0, b = 0;  ///< places in correlated_parameters()
  double correlation = 0;
};
/// The parameters of the first rows of Identification::correlation.
std::vector<identification::Parameter> correlated_parameters(const identification::Identification& found);
/// The strongest first, at most `most`, those above a half.
std::vector<CorrelatedPair> strongest_correlations(const identification::Identification& found, std::size_t most);

files::PageTable parameter_table(const identification::Identification& found);
files::PageTable correlation_table(const identification::Identification& found);
files::PageTable pulse_table(const std::vector<workflow::RecordedPulses>& recordings);

/// The JSON of bms identify with `pulse_resistances`.
std::string with_pulses(const std::string& json, const std::vector<workflow::RecordedPulses>& recordings);

struct CsvFile {
  std::string name, text;
};
/// parameters.csv, correlation.csv, pulse_resistance.csv: SI units, in full precision.
std::vector<CsvFile> identify_csv(const workflow::IdentifyResult& result,
                                  const std::vector<workflow::RecordedPulses>& recordings);

}  // namespace bms::reports
