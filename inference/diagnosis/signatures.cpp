#include "diagnosis/signatures.hpp"

#include <cmath>

#include "diagnosis/testability.hpp"
#include "diagnosis/thresholds.hpp"
#include "numerics/in_parallel.hpp"

namespace bms::diagnosis {

namespace {

using model::catalogue;
using model::Role;

/// Collects probes and their columns.
class Collector {
 public:
  explicit Collector(const LikelihoodModel& likelihood) : likelihood_(likelihood) {}

  void add(ProbedColumns d) {
    d.probe.block = set_.blocks.size();
    set_.probes.push_back(std::move(d.probe));
    set_.blocks.push_back(std::move(d.columns));
  }

  /// A resistance from a moment on: the current after it, one column per moment of the first recording. Later
  /// recordings have it from their start.
  void add_contact_change(std::size_t mechanism) {
    constexpr std::size_t moments = thresholds.screening.moments, margin = thresholds.screening.moments_margin;
    const std::vector<PreparedRecording>& records = likelihood_.records();
    const PreparedRecording& first = records.front();
    Columns steps = Columns::Zero(static_cast<Eigen::Index>(likelihood_.samples()), moments);
    for (std::size_t m = 0; m < moments; ++m) {
      const std::size_t onset = (m + margin) * first.size() / (moments + 2 * margin);
      Eigen::Index row = 0;
      for (const PreparedRecording& r : records) {
        for (std::size_t k = 0; k < r.size(); ++k, ++row) {
          const bool changed = &r != &first || k >= onset;
          if (changed && std::isfinite(r.current_a[k])) steps(row, static_cast<Eigen::Index>(m)) = r.current_a[k];
        }
      }
      MechanismSetting setting{mechanism, {}, {}};
      setting.value[contact_onset] = first.time_s[onset];
      set_.probes.push_back({setting, {contact_resistance}, set_.blocks.size(), static_cast<Eigen::Index>(m)});
    }
    likelihood_.whiten(steps);
    set_.blocks.push_back(std::move(steps));
  }

  SignatureSet collected() && { return std::move(set_); }

 private:
  const LikelihoodModel& likelihood_;
  SignatureSet set_;
};

}  // namespace

ProbedColumns signature_at(const LikelihoodModel& likelihood, const HypothesisFit& around,
                           const MechanismSetting& setting) {
  const model::MechanismInfo& info = catalogue[setting.index];
  const Hypothesis probe = with(around.hypothesis, setting);
  ProbedColumns d{{setting, {}, 0, 0}, {}};
  std::vector<ParameterRef> by;
  for (std::size_t k = 0; k < info.parameters; ++k) {
    const Role role = info.parameter[k].role;
    if (role != Role::strength && !(role == Role::place && knowledge_of(setting.index).probes_places)) continue;
    d.probe.parameters.push_back(k);
    by.push_back({probe.settings.size() - 1, k});
  }
  d.columns = likelihood.derivatives(probe, around.calibration, by);
  return d;
}

std::vector<MechanismSetting> probe_settings(const LikelihoodModel& likelihood, std::size_t mechanism) {
  const double capacity_ah = likelihood.cell().capacity_ah;
  const model::MechanismInfo& info = catalogue[mechanism];
  const MechanismKnowledge& knowledge = knowledge_of(mechanism);
  std::vector<double> shapes = knowledge.probing_shapes(capacity_ah);
  const bool shaped = !shapes.empty();
  if (!shaped) shapes = {0};
  std::vector<MechanismSetting> settings;
  for (std::size_t n = 0; n < knowledge.forms * shapes.size(); ++n) {
    const double shape = shapes[n % shapes.size()];
    MechanismSetting& setting = settings.emplace_back(model::default_setting(mechanism, likelihood.cell()));
    knowledge.choose_form(setting, n / shapes.size(), likelihood.cell());
    for (std::size_t k = 0; k < info.parameters; ++k) {
      const model::Parameter& parameter = info.parameter[k];
      if (parameter.role == Role::shape && shaped) setting.value[k] = shape;
      if (parameter.role == Role::strength && parameter.low >= 0)
        setting.value[k] = numerics.signatures.probing_strength * parameter.upper(capacity_ah);
    }
    knowledge.adjust_probe(setting, likelihood.facts());
  }
  return settings;
}

bool is_searched(std::size_t mechanism, double capacity_ah) {
  const MechanismKnowledge& knowledge = knowledge_of(mechanism);
  return knowledge.signature == Signature::contact_change || !knowledge.probing_shapes(capacity_ah).empty();
}

SignatureSet signatures(const LikelihoodModel& likelihood, const HypothesisFit& around,
                        const std::vector<std::size_t>& over) {
  const auto probed = [&](std::size_t mechanism, Signature kind) {
    return knowledge_of(mechanism).signature == kind && around.hypothesis.find(mechanism) == nullptr &&
           !not_testable(likelihood, around.hypothesis, mechanism);
  };
  std::vector<MechanismSetting> settings;
  for (const std::size_t mechanism : over) {
    if (!probed(mechanism, Signature::derivatives)) continue;
    const std::vector<MechanismSetting> of = probe_settings(likelihood, mechanism);
    settings.insert(settings.end(), of.begin(), of.end());
  }
  std::vector<ProbedColumns> probed_columns(settings.size());
  numerics::in_parallel(settings.size(),
                        [&](std::size_t k) { probed_columns[k] = signature_at(likelihood, around, settings[k]); });
  Collector collector(likelihood);
  for (ProbedColumns& d : probed_columns) collector.add(std::move(d));
  for (const std::size_t mechanism : over) {
    if (probed(mechanism, Signature::contact_change)) collector.add_contact_change(mechanism);
  }
  return std::move(collector).collected();
}

}  // namespace bms::diagnosis
