#include "proof/findings.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "numerics/symmetric_eigen.hpp"

namespace bms::proof {

namespace {

using diagnosis::Finding;
using model::catalogue;

const Finding* finding_of(const workflow::DiagnoseResult& r, std::string_view mechanism) {
  if (!r.named()) return nullptr;
  for (const Finding& f : r.diagnosis.findings) {
    if (catalogue[f.setting.index].id == mechanism) return &f;
  }
  return nullptr;
}

/// Place of a parameter by its name; info.parameters if the mechanism does not have it.
std::size_t parameter_index(const model::MechanismInfo& info, std::string_view name) {
  std::size_t k = 0;
  while (k < info.parameters && info.parameter[k].name != name) ++k;
  return k;
}

}  // namespace

bool has_parameter(const ParameterName& name) {
  const std::size_t index = model::mechanism_index(name.mechanism);
  return index < model::mechanism_count &&
         parameter_index(catalogue[index], name.parameter) < catalogue[index].parameters;
}

ParameterName read_parameter_name(files::TomlTable& table) {
  ParameterName name{table.text("mechanism"), table.text("parameter")};
  if (model::mechanism_index(name.mechanism) == model::mechanism_count)
    table.reject("mechanism", "the id of a mechanism");
  if (!has_parameter(name)) table.reject("parameter", "a parameter of " + name.mechanism);
  return name;
}

bool is_named(const workflow::DiagnoseResult& r, std::string_view mechanism) {
  return finding_of(r, mechanism) != nullptr;
}

bool is_named_or_equivalent(const workflow::DiagnoseResult& r, std::string_view mechanism) {
  if (!r.named()) return false;
  return std::any_of(r.diagnosis.findings.begin(), r.diagnosis.findings.end(), [&](const Finding& f) {
    return catalogue[f.setting.index].id == mechanism ||
           std::any_of(f.equivalent_to.begin(), f.equivalent_to.end(),
                       [&](std::size_t m) { return catalogue[m].id == mechanism; });
  });
}

std::string summary_of(const workflow::DiagnoseResult& r) {
  std::string text = name_of(r.diagnosis.verdict);
  if (!r.named()) return text;
  for (std::size_t k = 0; k < r.diagnosis.findings.size(); ++k) {
    const Finding& f = r.diagnosis.findings[k];
    text += fmt::format("{} {}", k == 0 ? ":" : ",", catalogue[f.setting.index].id);
    for (const std::size_t m : f.equivalent_to) text += fmt::format(" or {}", catalogue[m].id);
  }
  return text;
}

std::optional<Value> value_of(const workflow::DiagnoseResult& r, const ParameterName& name) {
  const Finding* f = finding_of(r, name.mechanism);
  if (f == nullptr) return std::nullopt;
  const std::size_t k = parameter_index(catalogue[f->setting.index], name.parameter);
  return Value{f->setting.value[k], std::isfinite(f->setting.deviation[k]) ? f->setting.deviation[k] : 0};
}

std::vector<diagnosis::Hypothesis> one_sigma_away(const diagnosis::Diagnosis& d, std::string_view mechanism) {
  const std::vector<diagnosis::ParameterRef> sought = d.extended.sought();
  std::vector<Eigen::Index> rows;
  for (std::size_t j = 0; j < sought.size(); ++j) {
    if (catalogue[d.extended.settings[sought[j].setting].index].id == mechanism)
      rows.push_back(static_cast<Eigen::Index>(j));
  }
  const numerics::SymmetricEigen axes = numerics::symmetric_eigen(d.covariance(rows, rows));
  std::vector<diagnosis::Hypothesis> list;
  for (Eigen::Index axis = 0; axis < axes.values.size(); ++axis) {
    const double sigma = std::sqrt(std::max(axes.values[axis], 0.0));
    diagnosis::Hypothesis& h = list.emplace_back(d.extended);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const diagnosis::ParameterRef& s = sought[static_cast<std::size_t>(rows[k])];
      model::MechanismSetting& setting = h.settings[s.setting];
      const model::Parameter& p = catalogue[setting.index].parameter[s.parameter];
      double& value = setting.value[s.parameter];
      value = std::clamp(value + sigma * axes.vectors(static_cast<Eigen::Index>(k), axis), p.lower(d.cell.capacity_ah),
                         p.upper(d.cell.capacity_ah));
    }
  }
  return list;
}

}  // namespace bms::proof
