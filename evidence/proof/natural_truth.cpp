#include "proof/natural_truth.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/quantity_text.hpp"
#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "files/text_file.hpp"
#include "measurement/statistics.hpp"
#include "model/extended.hpp"

namespace bms::proof {

namespace {

using diagnosis::PreparedRecording;
using measurement::Column;
using measurement::Recording;
using model::MechanismSetting;

constexpr double kelvin = 273.15, gas_constant = 8.314;
constexpr double loaded_share = 0.5;    ///< of the largest current, above which a row is loaded
constexpr double edge_share = 0.3;      ///< of the largest current, of an edge at which a resistance is read
constexpr double edge_at_most_s = 1.5;  ///< between its two rows
constexpr double wanders = 0.1;         ///< of a contact's median, from its 5 to its 95 % quantile
constexpr double gain_within = 0.002, capacity_within = 0.04, change_within = 0.2;

std::string full(const std::string& folder, const std::string& name) {
  return (std::filesystem::path(folder) / name).string();
}

double largest_of(const Column& current_a) {
  double largest = 0;
  for (const double a : current_a) largest = std::isfinite(a) ? std::max(largest, std::abs(a)) : largest;
  return largest;
}

/// (V_load - V_cell) / I in the rows with load.
std::vector<double> contact_ohm(const Recording& r) {
  if (r.voltage_ref_v.empty() || r.current_ref_a.empty())
    throw files::BadInput(r.path, 1, "no columns of a second voltmeter and ammeter, expected both");
  std::vector<double> ohm;
  const double largest_a = largest_of(r.current_ref_a);
  for (std::size_t k = 0; k < r.rows(); ++k) {
    const double a = r.current_ref_a[k];
    if (std::abs(a) > loaded_share * largest_a) ohm.push_back((r.voltage_v[k] - r.voltage_ref_v[k]) / a);
  }
  return ohm;
}

Truth contact_of(const Recording& r, double within) {
  const std::vector<double> ohm = contact_ohm(r);
  Truth t{"contact", {"contact_step", "resistance_growth"}, "ohm", measurement::median(ohm), 0,
          true,      "both voltmeters, median under load"};
  t.within = within * t.value;
  if (measurement::quantile(ohm, 0.95) - measurement::quantile(ohm, 0.05) < wanders * t.value) return t;
  t.what = "wandering contact";
  t.ids.insert(t.ids.end(), {"contact_intermittent", "UNKNOWN"});
  return t;
}

Truth contact_change_of(const Recording& r, const std::string& folder, const std::vector<std::string>& calibration) {
  std::vector<double> before;
  for (const std::string& name : calibration)
    before.push_back(measurement::median(contact_ohm(files::read_recording(full(folder, name)))));
  Truth t{"contact",
          {"contact_step", "resistance_growth"},
          "ohm",
          measurement::median(contact_ohm(r)) - measurement::mean(before),
          0,
          true,
          "both voltmeters, before and now"};
  t.within = change_within * std::abs(t.value);
  return t;
}

Truth current_gain_of(const Recording& r, bool visible) {
  std::vector<double> ratio;
  const double largest_a = largest_of(r.current_ref_a);
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (std::abs(r.current_ref_a[k]) > loaded_share * largest_a) ratio.push_back(r.current_a[k] / r.current_ref_a[k]);
  }
  return {"current_gain", {"current_gain"}, "", measurement::median(ratio) - 1, gain_within, visible, "both ammeters"};
}

bool is_inverted(const Recording& r) {
  double product = 0;
  for (std::size_t k = 0; k < r.rows(); ++k) product += r.current_a[k] * r.current_ref_a[k];
  return product < 0;
}

/// A value of the table of cycles, at the test that the recording's name states: "B0005/d021.csv".
double of_cycle(const std::string& table, const std::string& recording, std::string_view column) {
  const std::string name = std::filesystem::path(recording).filename().string();
  const std::string id = std::to_string(std::stoi(name.substr(1))) + ",";
  const auto cell = [](const std::string& line, std::size_t n) {
    std::size_t from = 0;
    for (; n > 0; --n) from = line.find(',', from) + 1;
    return line.substr(from, line.find(',', from) - from);
  };
  std::optional<std::size_t> wanted;
  const std::string text = files::read_file(table);
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find('\n', from), text.size());
    const std::string line = text.substr(from, end - from);
    from = end + 1;
    if (!wanted) {
      wanted = static_cast<std::size_t>(
          std::count(line.begin(), line.begin() + static_cast<std::ptrdiff_t>(line.find(column)), ','));
    } else if (line.starts_with(id)) {
      return std::stod(cell(line, *wanted));
    }
  }
  throw files::BadInput(table, 1, fmt::format("no test {}, expected one", id));
}

Truth capacity_of(const NaturalCase& c, const std::string& folder, const std::vector<std::string>& calibration) {
  const auto ah = [&](const std::string& name) { return of_cycle(full(folder, c.cycles), name, "capacity_ah"); };
  std::vector<double> before;
  for (const std::string& name : calibration) before.push_back(ah(name));
  return {"capacity", {"capacity_change"}, "lost", 1 - ah(c.recording) / measurement::mean(before), capacity_within,
          true,       "capacity tests"};
}

Truth temperature_rise_of(const Recording& r, double within) {
  double highest_c = r.temperature_c.front();
  for (const double c : r.temperature_c) highest_c = std::max(highest_c, c);
  const double rise_k = highest_c - r.temperature_c.front();
  return {"rise", {"self_heating"}, "K", rise_k, within * rise_k, true, "thermocouple"};
}

/// Median of dV / dI at steps of the current.
double edge_ohm(const Recording& r) {
  std::vector<double> ohm;
  const double least_a = edge_share * largest_of(r.current_a);
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double step_a = r.current_a[k] - r.current_a[k - 1];
    if (std::abs(step_a) > least_a && r.time_s[k] - r.time_s[k - 1] <= edge_at_most_s)
      ohm.push_back((r.voltage_v[k] - r.voltage_v[k - 1]) / step_a);
  }
  return measurement::median(ohm);
}

Truth temperature_resistance_of(const Recording& r, const std::string& folder,
                                const std::vector<std::string>& calibration) {
  const double change = edge_ohm(r) / edge_ohm(files::read_recording(full(folder, calibration.front()))) - 1;
  return {"resistance at its temperature",
          {"temperature_resistance"},
          "",
          change,
          change_within * std::abs(change),
          true,
          "edges"};
}

Truth unlike_cells_of(const Recording& r) {
  double largest_a = 0;
  const measurement::OtherColumn *one = nullptr, *other = nullptr;
  for (const measurement::OtherColumn& o : r.others) {
    if (o.name == "current_1_a") one = &o;
    if (o.name == "current_2_a") other = &o;
  }
  for (std::size_t k = 0; one != nullptr && other != nullptr && k < one->text.size(); ++k)
    largest_a = std::max(largest_a, std::abs(std::stod(one->text[k]) - std::stod(other->text[k])));
  return {"unlike cells", {"UNKNOWN", "slow_polarisation"}, "A", largest_a, 0, true, "both currents"};
}

/// A column of the tables at a state of charge.
template <class Nodes, class Values>
double at_soc(const Nodes& soc, const Values& value, double at) {
  std::size_t k = 1;
  while (k + 1 < soc.size && soc[k] < at) ++k;
  if (soc.size < 2) return value[0];
  const double share = std::clamp((at - soc[k - 1]) / (soc[k] - soc[k - 1]), 0.0, 1.0);
  return value[k - 1] + share * (value[k] - value[k - 1]);
}

/// Mean of R0 or R1 over the table.
template <class Values>
double mean_ohm(const model::CellParameters<>& cell, const Values& values) {
  double sum = 0;
  for (std::size_t k = 0; k < cell.rc.soc.size; ++k) sum += values[k];
  return sum / static_cast<double>(cell.rc.soc.size);
}

/// Arrhenius factor of a resistance.
double colder(double energy, double reference_c, double at_c) {
  return std::exp(energy / gas_constant * (1 / (at_c + kelvin) - 1 / (reference_c + kelvin)));
}

/// Largest rise of the temperature inside, of all recordings.
double largest_rise_k(const MechanismSetting& s, const diagnosis::Diagnosis& d,
                      const std::vector<PreparedRecording>& records) {
  double largest_k = 0;
  for (std::size_t n = 0; n < records.size() && n < d.views.size(); ++n) {
    const PreparedRecording& r = records[n];
    double rise_k = 0;
    for (std::size_t k = 1; k < r.size(); ++k) {
      const double soc = d.views[n].soc[k], a = r.current_a[k],
                   ohm = (at_soc(d.cell.rc.soc, d.cell.rc.r0_ohm, soc) + at_soc(d.cell.rc.soc, d.cell.rc.r1_ohm, soc)) *
                         colder(s.value[2], s.value[3], s.value[3] + rise_k);
      rise_k += -std::expm1(-(r.time_s[k] - r.time_s[k - 1]) / s.value[1]) * (s.value[0] * a * a * ohm - rise_k);
      largest_k = std::max(largest_k, rise_k);
    }
  }
  return largest_k;
}

double mean_temperature_c(const std::vector<PreparedRecording>& records) {
  return measurement::mean({records.front().temperature_c.begin(), records.front().temperature_c.size()});
}

/// Size of a cause in a truth's unit; nothing if it has none there.
std::optional<double> size_of(const MechanismSetting& s, const Truth& t, const diagnosis::Diagnosis& d,
                              const std::vector<PreparedRecording>& records) {
  const std::string id(model::catalogue[s.index].id);
  const bool of_resistance = std::find(t.ids.begin(), t.ids.end(), "resistance_growth") != t.ids.end();
  if ((id == "resistance_growth" || id == "polarisation_growth") && !of_resistance) return std::nullopt;
  if ((id == "self_heating" || id == "temperature_resistance") &&
      std::find(t.ids.begin(), t.ids.end(), id) == t.ids.end())
    return std::nullopt;
  if (id == "resistance_growth") return s.value[0] * mean_ohm(d.cell, d.cell.rc.r0_ohm);
  // in a recording whose rows are farther apart than its time constant it is a resistance
  if (id == "polarisation_growth") return s.value[0] * mean_ohm(d.cell, d.cell.rc.r1_ohm);
  if (id == "self_heating") return largest_rise_k(s, d, records);
  if (id == "temperature_resistance" && !records.front().temperature_c.empty())
    return s.value[3] * (colder(s.value[0], s.value[2], mean_temperature_c(records)) - 1);
  const bool as_it_is = std::find(t.ids.begin(), t.ids.end(), id) != t.ids.end() && t.what != "unlike cells";
  return as_it_is ? std::optional(s.value[0]) : std::nullopt;
}

Possible possible_of(const MechanismSetting& s, const std::vector<Truth>& truths, const diagnosis::Diagnosis& d,
                     const std::vector<PreparedRecording>& records) {
  Possible p{std::string(model::catalogue[s.index].id), {}, {}};
  for (const Truth& t : truths) {
    const std::optional<double> size = size_of(s, t, d, records);
    if (!size) continue;
    p.size[t.what] = *size;
    // to first order all of them are in proportion to the first parameter
    p.sigma[t.what] = s.value[0] != 0 ? std::abs(*size * s.deviation[0] / s.value[0]) : 0;
  }
  return p;
}

}  // namespace

std::string name_of(const Given& given) {
  std::string text = given.references ? "+ reference" : "";
  if (given.second) text += text.empty() ? "+ second" : ", second";
  if (given.before) text += text.empty() ? "+ healthy before" : ", healthy before";
  return text.empty() ? "alone" : text;
}

Recording as_given(const Recording& whole, const NaturalCase& c, bool with_references) {
  const auto column = [&](const std::string& name, const Column& otherwise) {
    if (name == "current_ref_a") return whole.current_ref_a;
    if (name == "voltage_ref_v") return whole.voltage_ref_v;
    return otherwise;
  };
  Recording r = whole;
  r.current_a = column(c.current, whole.current_a);
  r.voltage_v = column(c.voltage, whole.voltage_v);
  const auto withheld = [&](const char* name) {
    return !with_references || std::find(c.references.begin(), c.references.end(), name) == c.references.end();
  };
  if (withheld("current_ref_a")) r.current_ref_a = {};
  if (withheld("voltage_ref_v")) r.voltage_ref_v = {};
  if (c.without_temperature) r.temperature_c = {};
  return r;
}

std::vector<Truth> truths_of(const NaturalCase& c, const Recording& whole, const std::string& folder,
                             const std::vector<std::string>& calibration, const Given& given) {
  std::vector<Truth> truths;
  const bool second_ammeter =
      given.references && std::find(c.references.begin(), c.references.end(), "current_ref_a") != c.references.end();
  for (const std::string& what : c.truths) {
    if (what == "contact")
      truths.push_back(contact_of(whole, c.within));
    else if (what == "contact_change")
      truths.push_back(contact_change_of(whole, folder, calibration));
    else if (what == "current_gain")
      truths.push_back(current_gain_of(whole, second_ammeter));
    else if (what == "capacity")
      truths.push_back(capacity_of(c, folder, calibration));
    else if (what == "temperature_rise")
      truths.push_back(temperature_rise_of(whole, c.within));
    else if (what == "temperature_resistance")
      truths.push_back(temperature_resistance_of(whole, folder, calibration));
    else if (what == "unlike_cells")
      truths.push_back(unlike_cells_of(whole));
    else if (what != "sign" && what != "nothing")
      throw files::BadInput(c.name, 1, "'" + what + "' is not a truth, expected one of the list's");
  }
  const bool sign = std::find(c.truths.begin(), c.truths.end(), "sign") != c.truths.end();
  if (sign && is_inverted(whole)) return {{"sign", {"current_inverted"}, "", -1, 0, true, "both ammeters"}};
  return truths;
}

Answer answer_of(const diagnosis::Diagnosis& d, const std::vector<PreparedRecording>& records,
                 const std::vector<Truth>& truths) {
  Answer answer;
  answer.verdict = diagnosis::name_of(d.verdict);
  for (const diagnosis::DataFault& f : d.faults) answer.data_faults.push_back(f.id);
  if (diagnosis::names(d.verdict)) {
    for (const diagnosis::Finding& f : d.findings) {
      std::vector<Possible>& alike = answer.causes.emplace_back();
      alike.push_back(possible_of(f.setting, truths, d, records));
      for (std::size_t k = 0; k < f.equivalent_to.size(); ++k) {
        const MechanismSetting* s = k < f.rivals.size() ? f.rivals[k].hypothesis.find(f.equivalent_to[k]) : nullptr;
        alike.push_back(s != nullptr ? possible_of(*s, truths, d, records)
                                     : Possible{std::string(model::catalogue[f.equivalent_to[k]].id), {}, {}});
      }
    }
  }
  for (const diagnosis::DetectionLimit& l : d.limits) {
    const std::string id(model::catalogue[l.mechanism].id);
    for (const Truth& t : truths) {
      const bool of_truth = std::find(t.ids.begin(), t.ids.end(), id) != t.ids.end() && l.parameter == 0;
      if (!of_truth || id == "self_heating" || id == "temperature_resistance") continue;
      const double size = id == "resistance_growth" ? l.value * mean_ohm(d.cell, d.cell.rc.r0_ohm) : l.value;
      const auto known = answer.limits.find(t.what);
      answer.limits[t.what] = known == answer.limits.end() ? size : std::min(known->second, size);
    }
  }
  return answer;
}

}  // namespace bms::proof
