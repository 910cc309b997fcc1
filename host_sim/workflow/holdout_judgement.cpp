#include "workflow/holdout_judgement.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/quantity_text.hpp"
#include "diagnosis/texts.hpp"
#include "identification/residuals.hpp"
#include "measurement/normal_distribution.hpp"
#include "workflow/next_steps.hpp"

namespace bms::workflow {

namespace {

constexpr double significant_increase = 1.05;  ///< of an error on the hold-outs, before a warning says so
constexpr double false_alarms = 0.01;          ///< share of right predictions that may be called wrong

using diagnosis::millivolts;

std::string interval_text(const diagnosis::Coverage& c) {
  return fmt::format("{} RMS, and its {:.0f} % interval contains {:.1f} % of the readings", millivolts(c.error_v()),
                     100 * diagnosis::nominal_coverage, 100 * c.share());
}

/// What the verdict says of a hold-out that it does not hold for. alone: its own diagnosis.
std::string consequence(const DiagnoseResult& r, const std::optional<diagnosis::Diagnosis>& alone) {
  if (r.named()) return "the findings do not describe it.";
  if (alone && alone->verdict == diagnosis::Verdict::cause)
    return "alone it says that " + diagnosis::claim(alone->findings.front().setting) + ".";
  if (alone) return "alone it has causes, which are not clear enough to name them here.";
  return "something is there that this recording does not show.";
}

/// What a hold-out says by itself, where nothing was found without it; nothing if it names no cause either. Errors
/// that are no larger than the tolerance may still have the pattern of one cause.
std::optional<diagnosis::Diagnosis> diagnosed_alone(diagnosis::Options how, const DiagnoseResult& r,
                                                    const RecordingComparison& holdout) {
  if (r.diagnosis.verdict != diagnosis::Verdict::no_mismatch) return std::nullopt;
  how.healthy = r.cell.healthy;
  diagnosis::Diagnosis d = diagnosis::diagnose(r.cell.parameters, r.cell.mechanisms, {holdout.record}, how);
  return diagnosis::names(d.verdict) ? std::optional(std::move(d)) : std::nullopt;
}

/// Returns true if the errors of a hold-out are larger than those of a right prediction.
bool are_too_large(const RecordingComparison& c) {
  std::vector<double> errors;
  for (std::size_t k = 0; k < c.interval.sigma_v.size(); ++k)
    errors.push_back((c.record.voltage_v[k] - c.extended_v[k]) / c.interval.sigma_v[k]);
  return probability_of(errors) < false_alarms;
}

void add_contradiction(const DiagnoseOptions& options, const diagnosis::Options& how, DiagnoseResult& r) {
  const diagnosis::Verdict verdict = r.diagnosis.verdict;
  if (!r.named() && !r.has_term() && verdict != diagnosis::Verdict::no_mismatch) return;  // nothing is stated of others
  const RecordingComparison* worst = nullptr;
  std::optional<diagnosis::Diagnosis> worst_alone;
  for (const RecordingComparison& c : r.holdouts) {
    if (!c.interval.coverage.is_beyond(r.diagnosis.noise_floor_v)) continue;
    auto alone = diagnosed_alone(how, r, c);
    if (!alone && !are_too_large(c)) continue;
    r.holdouts_beyond.push_back(c.record.name);
    if (worst != nullptr && c.interval.coverage.error_v() <= worst->interval.coverage.error_v()) continue;
    worst = &c;
    worst_alone = std::move(alone);
  }
  if (worst == nullptr) return;
  r.together = together_command(options, r.recordings, r.holdouts);
  std::string& statement = r.diagnosis.statement;
  if (verdict == diagnosis::Verdict::no_mismatch && statement.ends_with(diagnosis::no_action)) {
    statement.resize(statement.size() - diagnosis::no_action.size());
    statement += "No action is needed for this recording.";
  }
  statement += fmt::format(" But the prediction of the hold-out {} is off by {}: {} Diagnose both together.",
                           worst->record.name, interval_text(worst->interval.coverage), consequence(r, worst_alone));
}

/// The extended cell predicts the hold-outs worse.
void add_increase(DiagnoseResult& r) {
  if (!r.named() && !r.has_term()) return;
  if (!r.baseline_holdout || !r.extended_holdout ||
      !(r.extended_holdout->rmse_v > significant_increase * r.baseline_holdout->rmse_v))
    return;
  const std::string increase =
      fmt::format("from {:.1f} mV to {:.1f} mV", 1e3 * r.baseline_holdout->rmse_v, 1e3 * r.extended_holdout->rmse_v);
  r.warnings.push_back({"holdout_worse", "with the extended cell file the error on the hold-out recordings increases " +
                                             increase + ": do not rely on it"});
  r.diagnosis.statement += fmt::format(
      " With the extended cell file the error on the hold-out recordings increases {}: do not rely on that file.",
      increase);
  r.extended_cell.source += fmt::format("; the error on the hold-out recordings increases {}", increase);
}

/// The estimated state of charge becomes worse with the findings, and by more than its own uncertainty.
void add_soc_increase(DiagnoseResult& r) {
  if ((!r.named() && !r.has_term()) || !r.soc) return;
  const SocErrors& soc = *r.soc;
  if (!(soc.extended_rmse > significant_increase * soc.baseline_rmse && soc.extended_rmse > soc.extended_sigma)) return;
  r.warnings.push_back(
      {"soc_worse", fmt::format("with the findings the error of the estimated state of charge increases from {:.2f} % "
                                "to {:.2f} %, more than its standard deviation of {:.2f} %",
                                100 * soc.baseline_rmse, 100 * soc.extended_rmse, 100 * soc.extended_sigma)});
}

}  // namespace

double probability_of(std::span<const double> errors) {
  const Eigen::VectorXd known = identification::without_missing(
      Eigen::Map<const Eigen::VectorXd>(errors.data(), static_cast<Eigen::Index>(errors.size())));
  if (known.size() == 0) return 1;
  const auto rows = static_cast<double>(known.size());
  const double independent = std::max(1.0, rows / identification::correlation_length(known));
  // the cube root of chi square over its degrees of freedom is nearly normal (Wilson and Hilferty 1931)
  const double variance = diagnosis::numerics.statistics.wilson_hilferty / independent,
               away = (std::cbrt(known.squaredNorm() / rows) - (1 - variance)) / std::sqrt(variance);
  return measurement::normal_tail(away);
}

void judge_holdouts(const DiagnoseOptions& options, const diagnosis::Options& how, DiagnoseResult& r) {
  add_contradiction(options, how, r);
  add_increase(r);
  add_soc_increase(r);
}

}  // namespace bms::workflow
