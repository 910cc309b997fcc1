#include "reports/identify_tables.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "reports/json_parts.hpp"

namespace bms::reports {

namespace id = identification;

namespace {

constexpr double dcir_s[] = {1, 10, 30};
constexpr double least_correlation = 0.5;
constexpr std::size_t most_pairs = 12, most_pulses = 60;

const char* remark(const id::Parameter& p) {
  if (!p.identifiable) return "not identifiable";
  return p.at_bound ? "at its bound" : "";
}

std::string named(const std::string& name) {
  for (const auto& [key, text] :
       {std::pair{"r0_ohm", "R0"}, {"r1_ohm", "R1"}, {"c1_f", "C1"}, {"ocv_lean", "branch position of the OCV"}}) {
    if (name == key) return text;
  }
  return name;
}

struct Unit {
  double scale;
  const char* name;
};
Unit unit_of(const std::string& name) {
  if (name.ends_with("_ohm")) return {1e3, " mOhm"};
  if (name.ends_with("_f")) return {1, " F"};
  if (name.ends_with("_s")) return {1, " s"};
  return {1, ""};
}

/// With the digits that an error of `std` leaves, at least two; no exponent.
std::string digits(double value, double std) {
  if (!std::isfinite(value)) return "";
  const double last = std > 0 ? std : std::abs(value) * 1e-3;
  const int decimals = last > 0 ? std::clamp(static_cast<int>(std::ceil(-std::log10(last))) + 1, 0, 9) : 3;
  return fmt::format("{:.{}f}", value, decimals);
}

std::string shown(double value, const char* format) {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : std::string();
}

/// A number of a CSV file; empty: missing.
std::string field(double value) { return shown(value, "{:.9g}"); }

std::string resistance_text(const measurement::PulseReading* reading) {
  return reading == nullptr ? std::string() : digits(1e3 * reading->resistance_ohm, 0);
}

std::vector<files::PageCell> pulse_row(const measurement::Pulse& p) {
  std::vector<files::PageCell> row;
  const auto add = [&](const std::string& text) { row.push_back(files::text_cell(text)); };
  add(p.charges() ? "charge" : "discharge");
  add(shown(std::round(1'000 * p.soc) / 10 + 0.0, "{:.1f} %"));  // + 0.0: no minus at empty
  add(shown(p.temperature_c, "{:.1f}"));
  add(fmt::format("{:.4g} A", std::abs(p.current_a)));
  add(fmt::format("{:.4f} V", p.start_voltage_v));
  add(fmt::format("{:.4f} V", p.end_voltage_v));
  for (const double after_s : dcir_s) add(resistance_text(p.after(after_s)));
  const measurement::PulseReading& last = p.at.back();
  const bool of_end =
      std::none_of(std::begin(dcir_s), std::end(dcir_s), [&](double after_s) { return p.after(after_s) == &last; });
  add(of_end ? fmt::format("{} after {:.3g} s", resistance_text(&last), last.after_s) : "");
  return row;
}

std::string parameters_csv(const id::Identification& found) {
  std::string csv = "name,soc,temperature_c,value,std,std_white,by_ocv_tolerance,at_bound,identifiable\n";
  for (const std::vector<id::Parameter>* list : {&found.parameters, &found.polynomials}) {
    for (const id::Parameter& p : *list) {
      csv += fmt::format("{},{},{},{},{},{},{},{},{}\n", p.name, field(p.soc),
                         p.temperature_c ? field(*p.temperature_c) : "", field(p.value), field(p.std),
                         field(p.std_white), field(p.by_ocv_tolerance), p.at_bound ? 1 : 0, p.identifiable ? 1 : 0);
    }
  }
  return csv;
}

/// The parameters of the joint fit of --extend.
std::string joint_csv(const id::StructureChoice& choice) {
  std::string csv = "name,value,std,at_bound\n";
  for (std::size_t k = 0; k < choice.model.unknowns.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    csv += fmt::format("{},{},{},{}\n", choice.model.unknowns[k].name(), field(choice.fit.value[i]),
                       field(choice.fit.std[i]), choice.fit.at_bound[i] != 0 ? 1 : 0);
  }
  return csv;
}

std::string name_with_soc(const id::Parameter& p) {
  return p.soc > 0 ? fmt::format("{} at {:g}", p.name, p.soc) : p.name;
}

std::string correlation_csv(const id::Identification& found) {
  const std::vector<id::Parameter> parameters = correlated_parameters(found);
  std::string csv = "parameter";
  for (const id::Parameter& p : parameters) csv += "," + name_with_soc(p);
  csv += "\n";
  for (std::size_t a = 0; a < parameters.size(); ++a) {
    csv += name_with_soc(parameters[a]);
    for (std::size_t b = 0; b < parameters.size(); ++b)
      csv += "," + field(found.correlation(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)));
    csv += "\n";
  }
  return csv;
}

/// A field of CSV that may contain anything.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

std::string pulse_csv(const std::vector<workflow::RecordedPulses>& recordings) {
  std::string csv =
      "recording,begin_s,direction,soc,temperature_c,current_a,duration_s,start_voltage_v,end_voltage_v,after_s,"
      "voltage_v,resistance_ohm\n";
  for (const workflow::RecordedPulses& r : recordings) {
    for (const measurement::Pulse& p : r.pulses) {
      for (const measurement::PulseReading& reading : p.at) {
        csv += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\n", quoted(r.recording), field(p.begin_s),
                           p.charges() ? "charge" : "discharge", field(p.soc), field(p.temperature_c),
                           field(p.current_a), field(p.duration_s), field(p.start_voltage_v), field(p.end_voltage_v),
                           field(reading.after_s), field(reading.voltage_v), field(reading.resistance_ohm));
      }
    }
  }
  return csv;
}

}  // namespace

std::string label_of(const id::Parameter& p) {
  const std::string text = p.soc > 0 ? fmt::format("{} at {:.0f} %", named(p.name), 100 * p.soc) : named(p.name);
  return p.temperature_c ? fmt::format("{}, {:.0f} degrees C", text, *p.temperature_c) : text;
}

std::string value_text(const std::string& name, double value, double std) {
  const Unit unit = unit_of(name);
  const std::string number = digits(unit.scale * value, unit.scale * std);
  return std > 0 ? fmt::format("{} +- {}{}", number, digits(unit.scale * std, unit.scale * std), unit.name)
                 : number + unit.name;
}

std::vector<id::Parameter> correlated_parameters(const id::Identification& found) {
  const std::vector<id::Parameter>& all = found.polynomials.empty() ? found.parameters : found.polynomials;
  std::vector<id::Parameter> first;  // the fit at the first temperature
  for (const id::Parameter& p : all) {
    if (p.temperature_c != all.front().temperature_c || std::ssize(first) >= found.correlation.rows()) break;
    first.push_back(p);
  }
  return first;
}

std::vector<CorrelatedPair> strongest_correlations(const id::Identification& found, std::size_t most) {
  std::vector<CorrelatedPair> pairs;
  const std::size_t count = correlated_parameters(found).size();
  for (std::size_t a = 0; a < count; ++a) {
    for (std::size_t b = a + 1; b < count; ++b) {
      const double c = found.correlation(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      if (std::abs(c) > least_correlation) pairs.push_back({a, b, c});
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(), [](const CorrelatedPair& x, const CorrelatedPair& y) {
    return std::abs(x.correlation) > std::abs(y.correlation);
  });
  pairs.resize(std::min(pairs.size(), most));
  return pairs;
}

files::PageTable parameter_table(const id::Identification& found) {
  files::PageTable table{"parameters",
                         "Parameters",
                         {"parameter", "value and standard deviation", "if the residuals were white",
                          "effect of the OCV tolerance", "remarks"},
                         {},
                         ""};
  std::vector<id::Parameter> all = found.parameters;
  all.insert(all.end(), found.polynomials.begin(), found.polynomials.end());
  for (const id::Parameter& p : all) {
    const Unit unit = unit_of(p.name);
    table.rows.push_back(
        {files::text_cell(label_of(p)), files::text_cell(value_text(p.name, p.value, p.std)),
         files::text_cell("+- " + digits(unit.scale * p.std_white, unit.scale * p.std_white) + unit.name),
         files::text_cell(digits(unit.scale * p.by_ocv_tolerance, unit.scale * p.by_ocv_tolerance) + unit.name),
         files::text_cell(remark(p))});
  }
  return table;
}

files::PageTable correlation_table(const id::Identification& found) {
  files::PageTable table{"correlations",
                         "Strongest correlations of the parameters",
                         {"parameter", "with", "correlation"},
                         {},
                         "Near -1 the recording determines the sum of the two better than each, near 1 their "
                         "difference. The standard deviations above contain this. All pairs: --json, --csv."};
  const std::vector<id::Parameter> parameters = correlated_parameters(found);
  for (const CorrelatedPair& pair : strongest_correlations(found, most_pairs)) {
    table.rows.push_back({files::text_cell(label_of(parameters[pair.a])),
                          files::text_cell(label_of(parameters[pair.b])),
                          files::text_cell(fmt::format("{:+.2f}", pair.correlation))});
  }
  if (table.rows.empty()) table.note = "No two parameters have a correlation beyond 0.5.";
  return table;
}

files::PageTable pulse_table(const std::vector<workflow::RecordedPulses>& recordings) {
  files::PageTable table{
      "pulse_resistances",
      "Pulse resistances of the recordings (DCIR), in mOhm",
      {"pulse", "SOC", "degrees C", "current", "voltage before", "voltage at its end", "1 s", "10 s", "30 s", "end"},
      {},
      "Voltage step over current step of pulses that follow a rest of 10 s or more. No model is "
      "involved; they include what the open-circuit voltage moves during the pulse."};
  std::size_t pulses = 0;
  for (const workflow::RecordedPulses& r : recordings) {
    for (const measurement::Pulse& p : r.pulses) {
      if (++pulses <= most_pulses) table.rows.push_back(pulse_row(p));
    }
  }
  if (pulses == 0) table.note = "No pulse follows a rest of 10 s or more.";
  if (pulses > most_pulses) table.note += fmt::format(" The first {} of {}; all: --json, --csv.", most_pulses, pulses);
  return table;
}

std::string with_pulses(const std::string& json, const std::vector<workflow::RecordedPulses>& recordings) {
  Json list = Json::array();
  for (const workflow::RecordedPulses& r : recordings) {
    for (const measurement::Pulse& p : r.pulses) {
      Json at = Json::array();
      for (const measurement::PulseReading& reading : p.at)
        at.push_back({{"after_s", reading.after_s},
                      {"voltage_v", reading.voltage_v},
                      {"resistance_ohm", reading.resistance_ohm}});
      list.push_back({{"recording", r.recording},
                      {"begin_s", p.begin_s},
                      {"direction", p.charges() ? "charge" : "discharge"},
                      {"soc", number(p.soc)},
                      {"temperature_c", number(p.temperature_c)},
                      {"current_a", p.current_a},
                      {"duration_s", p.duration_s},
                      {"start_voltage_v", p.start_voltage_v},
                      {"end_voltage_v", p.end_voltage_v},
                      {"at", at}});
    }
  }
  Json all = Json::parse(json);
  all["pulse_resistances"] = std::move(list);
  return text_of(all);
}

std::vector<CsvFile> identify_csv(const workflow::IdentifyResult& r,
                                  const std::vector<workflow::RecordedPulses>& recordings) {
  std::vector<CsvFile> files = {{"parameters.csv", parameters_csv(r.identification)},
                                {"correlation.csv", correlation_csv(r.identification)},
                                {"pulse_resistance.csv", pulse_csv(recordings)}};
  if (r.joint) files.push_back({"extended_parameters.csv", joint_csv(r.joint->choice)});
  return files;
}

}  // namespace bms::reports
