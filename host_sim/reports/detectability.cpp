#include "reports/detectability.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "diagnosis/texts.hpp"
#include "experiments/experiment.hpp"
#include "reports/diagnosis_charts.hpp"
#include "reports/json_parts.hpp"

namespace bms::reports {

namespace {

using diagnosis::DetectionLimit;
using diagnosis::Isolability;
using model::catalogue;

std::string in_words(const std::string& means) {
  if (means == diagnosis::second_voltmeter) return "a trusted voltmeter at the cell, read alongside";
  if (means == diagnosis::second_ammeter) return "a trusted ammeter, read alongside";
  const experiments::Experiment* course = experiments::find_experiment(means);
  return fmt::format("bms experiment {}{}{}", means, course == nullptr ? "" : ": ",
                     course == nullptr ? "" : course->description);
}

}  // namespace

nlohmann::json limits_chart(const workflow::DiagnoseResult& r) {
  nlohmann::json list = nlohmann::json::array();
  for (const diagnosis::DetectionLimit& l : r.diagnosis.limits) {
    const model::MechanismInfo& info = catalogue[l.mechanism];
    const model::Parameter& p = info.parameter[l.parameter];
    list.push_back({{"id", info.id},
                    {"name", diagnosis::text_of_mechanism(l.mechanism).name},
                    {"text", diagnosis::parameter_text(p, l.value, 0)},
                    {"ratio", rounded(l.value / p.upper(r.cell.parameters.capacity_ah), 7)}});
  }
  std::stable_sort(list.begin(), list.end(), [](const auto& a, const auto& b) { return a["ratio"] < b["ratio"]; });
  return list;
}

nlohmann::ordered_json isolability_json(const diagnosis::Diagnosis& d) {
  const Isolability i = d.isolability.value_or(Isolability{});
  nlohmann::ordered_json ids = nlohmann::ordered_json::array(), sizes = ids, by = ids, gain = ids;
  for (const DetectionLimit& c : i.causes) {
    const model::Parameter& p = catalogue[c.mechanism].parameter[c.parameter];
    ids.push_back(catalogue[c.mechanism].id);
    sizes.push_back({{"parameter", p.name}, {"value", number(c.value)}, {"unit", p.unit}});
  }
  for (const std::vector<double>& row : i.gain) {
    nlohmann::ordered_json& gains = gain.emplace_back(nlohmann::ordered_json::array());
    for (const double g : row) gains.push_back(number(std::round(10 * g) / 10));
  }
  for (const std::vector<std::string>& row : i.separated_by) {
    nlohmann::ordered_json& means = by.emplace_back(nlohmann::ordered_json::array());
    for (const std::string& m : row)
      means.push_back(m.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(m));
  }
  return {{"ids", std::move(ids)},
          {"sizes", std::move(sizes)},
          {"gain", std::move(gain)},
          {"separable", i.separable},
          {"separated_by", std::move(by)}};
}

nlohmann::json isolability_chart(const diagnosis::Diagnosis& d) {
  if (!d.isolability || d.isolability->causes.size() < 2) return nullptr;
  const Isolability& i = *d.isolability;
  nlohmann::json names = nlohmann::json::array(), pairs = names, means = names;
  std::vector<std::string> known;
  for (const DetectionLimit& c : i.causes)
    names.push_back(fmt::format("{}, {}", diagnosis::text_of_mechanism(c.mechanism).name,
                                diagnosis::parameter_text(catalogue[c.mechanism].parameter[c.parameter], c.value, 0)));
  for (std::size_t a = 0; a < i.causes.size(); ++a) {
    nlohmann::json& row = pairs.emplace_back(nlohmann::json::array());
    for (std::size_t b = 0; b < a; ++b) {
      const std::string& by = i.separated_by[a][b];
      if (i.separable[a][b] || by.empty()) {
        row.push_back(i.separable[a][b] ? nlohmann::json(-1) : nlohmann::json(nullptr));
        continue;
      }
      const auto at = std::find(known.begin(), known.end(), by);
      row.push_back(at - known.begin());
      if (at == known.end()) known.push_back(by);
    }
  }
  for (const std::string& k : known) means.push_back(in_words(k));
  return {{"names", std::move(names)}, {"pairs", std::move(pairs)}, {"means", std::move(means)}};
}

}  // namespace bms::reports
