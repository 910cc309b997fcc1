#include "diagnosis/pack/diagnose_pack.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "diagnosis/pack/accusations.hpp"
#include "diagnosis/pack/cell_fit.hpp"
#include "diagnosis/pack/current_kind.hpp"
#include "diagnosis/pack/isolability.hpp"
#include "diagnosis/pack/loose_wires.hpp"
#include "diagnosis/pack/pack_likelihood.hpp"
#include "diagnosis/pack/pack_texts.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "diagnosis/pack/sampling_times.hpp"
#include "diagnosis/pack/sensors.hpp"
#include "diagnosis/pack/shared_blocks.hpp"
#include "diagnosis/pack/shared_current.hpp"
#include "diagnosis/pack/unexplained.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

/// First time from which on this accusation was named and was the best one.
std::optional<double> named_after_s(const PackState& s, const PackLikelihood& likelihood,
                                    const std::vector<Accusation>& others, const Accusation& a) {
  std::optional<double> since;
  for (std::size_t c = 0; c <= likelihood.last_checkpoint(); ++c) {
    const double gain = likelihood.gain(others, a, c);
    bool best = gain >= likelihood.least_gain();
    for (const Accusation& rival : likelihood.rivals_of(a)) best = best && likelihood.gain(others, rival, c) <= gain;
    if (!best) since.reset();
    if (best && !since) since = s.fits.front().until[c].until_s - s.pack.time_s.front();
  }
  return since;
}

/// The one of two alike causes, resistance and joint, that is not named. They differ only in their course over charge
/// and time, and the model knows this course badly.
std::optional<Cause> alike_of(Cause cause) {
  if (cause == Cause::resistance) return Cause::joint;
  if (cause == Cause::joint) return Cause::resistance;
  return std::nullopt;
}

/// Size of an accusation. One that is alike is taken for exactly that of the neighbours: what it is within its healthy
/// spread is part of the sigma, and what the recording says that it is beyond shows how badly the model knows the
/// course.
Estimated size_of(const PackState& s, const PackLikelihood& likelihood, const Accusation& a) {
  const std::optional<Cause> alike = alike_of(a.cause);
  if (!alike) return likelihood.size(s.accused, a, likelihood.last_checkpoint());
  const auto p = static_cast<Eigen::Index>(parameter_of(*alike));
  const double to_named = a.cause == Cause::joint ? s.track.r0_ohm : 1 / s.track.r0_ohm;
  const double value = likelihood.size(s.accused, {*alike, a.cell}, likelihood.last_checkpoint()).value;
  const double beyond = std::max(0.0, std::abs(value) - limits.healthy_sigmas * s.healthy[p]);
  Vector healthy = s.healthy;
  healthy[p] *= limits.negligible;
  const Estimated size =
      PackLikelihood(s.fits, healthy, s.track.r0_ohm, s.track.days.back(), s.track.step_s, s.track.unseen_share)
          .size(s.accused, a, likelihood.last_checkpoint());
  return {size.value, std::hypot(size.sigma, to_named * s.healthy[p], to_named * beyond)};
}

PackFinding finding_of(const PackState& s, const PackLikelihood& likelihood, const Accusation& a) {
  std::vector<Accusation> others = s.accused;
  std::erase(others, a);
  const std::size_t now = likelihood.last_checkpoint();
  const Estimated size = size_of(s, likelihood, a);
  PackFinding f;
  f.cause = a.cause;
  f.cell = a.cell;
  f.value = size.value;
  f.sigma = size.sigma;
  f.gain = likelihood.gain(others, a, now);
  double sum = 1;
  for (const Accusation& rival : likelihood.rivals_of(a)) {
    if (std::find(others.begin(), others.end(), rival) != others.end()) continue;
    std::vector<Accusation> instead = others;
    instead.push_back(rival);
    const bool alike = rival.cell == a.cell && are_alike(a.cause, rival.cause);
    const double lead = f.gain - likelihood.gain(others, rival, now);
    double odds = std::exp(-lead);
    if (alike) odds = std::max(odds, std::exp(std::min(0.0, limits.alike_margin - lead)));
    // the data want both of two that are alike: which one it is cannot be said
    if (alike && likelihood.gain(s.accused, rival, now) >= likelihood.least_gain()) odds = std::max(odds, 1.0);
    if (!likelihood.is_possible(rival, likelihood.size(instead, rival, now))) continue;
    sum += odds;
    f.rivals.push_back({rival.cause, rival.cell, odds});
  }
  // nothing at all is one of the alternatives
  const double nothing = std::exp(likelihood.least_gain() - limits.least_odds - f.gain);
  f.probability = 1 / (sum + nothing);
  for (Rival& r : f.rivals) r.probability *= f.probability;
  std::erase_if(f.rivals, [](const Rival& r) { return r.probability < limits.listed_from; });
  if (std::find(s.late.begin(), s.late.end(), a) != s.late.end()) {
    f.rivals.clear();
    f.probability = 1;
    if (!s.track.uses_moving) {  // whole rows
      f.value = s.channels.cells[a.cell].lag_s - s.channels.usual_lag_s();
      f.sigma = s.track.step_s / 2;
    }
  }
  std::stable_sort(f.rivals.begin(), f.rivals.end(),
                   [](const Rival& x, const Rival& y) { return x.probability > y.probability; });
  f.after_s = named_after_s(s, likelihood, others, a);
  if (a.cause == Cause::capacity) {  // from 1 / capacity to capacity
    f.sigma /= (1 + f.value) * (1 + f.value);
    f.value = f.value / (1 + f.value);
  }
  return f;
}

/// Takes the errors of the current sensor out of current and state of charge, before cells are compared.
std::optional<PackFinding> correct_current(PackState& s, const model::CellParameters<>& cell, PackDiagnosis& d) {
  std::string& text = d.current_sensor;
  set_neighbours(s.track, s.pack, usual_cells(s.pack), s.channels.are_mostly_held());
  SharedState shared = shared_state_of(s.track, s.pack);
  text = shared.not_tested;
  if (!text.empty()) return std::nullopt;
  text = fmt::format("Offset of the current sensor: {:.0f} ± {:.0f} mA.", 1e3 * shared.offset_a,
                     1e3 * shared.offset_sigma_a);
  s.pack.soc = std::move(shared.soc);
  for (double& a : s.pack.current_a) a = (1 - shared.gain) * a - shared.offset_a;
  s.track = track_of(cell, s.pack, shared.resistance_factor, shared.polarisation);
  s.track.soc_sigma = std::move(shared.soc_sigma);
  d.another_cell = shared.ocv_apart_v > limits.shared.another_cell * s.track.ocv_tolerance_v;
  return std::move(shared.finding);
}

/// The cell without accusations whose fit is in the middle.
std::size_t typical_cell(const PackState& s) {
  const std::vector<std::size_t> reference = reference_of(s);
  return reference[reference.size() / 2];
}

}  // namespace

PackDiagnosis diagnose_pack(const model::CellParameters<>& cell, PackRecording& pack, const PackOptions& options) {
  find_current_kind(pack, cell.capacity_ah);
  PackState s{.options = options,
              .pack = pack,
              .track = track_of(cell, pack),
              .channels = {},
              .bad_sensors = {},
              .fits = {},
              .noise = {},
              .own_noise = {},
              .late = {},
              .accused = {},
              .staggered = {}};
  PackDiagnosis d;
  d.cells = pack.cells();
  d.duration_s = pack.time_s.back() - pack.time_s.front();
  const std::vector<PackFinding> of_voltmeter = check_pack_voltage(pack, s.track);
  s.progress(0, "channels");
  const std::vector<LooseWire> loose = take_loose_wires(pack, limits.channels.step_c * s.track.capacity_ah);
  s.channels = check_channels(s.track, pack);
  for (const std::size_t c : s.channels.late(s.track.step_s)) s.late.push_back({Cause::late, c});
  s.accused = s.late;
  s.bad_sensors = check_thermistors(pack);
  const std::optional<PackFinding> of_current = correct_current(s, cell, d);
  fit_and_accuse(s);
  const PackLikelihood likelihood = likelihood_of(s);
  add_findings(s.channels, d.findings);
  add_loose_wires(loose, pack.rows(), d.findings);
  if (s.track.uses_moving) s.staggered = staggered(s, likelihood);
  if (s.staggered) d.findings.push_back(*s.staggered);
  if (of_current) d.findings.push_back(*of_current);
  for (const Accusation& a : s.accused) d.findings.push_back(finding_of(s, likelihood, a));
  d.findings.insert(d.findings.end(), s.bad_sensors.begin(), s.bad_sensors.end());
  d.findings.insert(d.findings.end(), of_voltmeter.begin(), of_voltmeter.end());
  std::vector<std::size_t> explained;
  for (const Accusation& a : s.accused) explained.push_back(a.cell);
  d.unexplained = unexplained_cells(pack, s.fits, explained, d.noise_v);
  d.is_finite = std::all_of(s.fits.begin(), s.fits.end(),
                            [](const CellFit& fit) { return std::isfinite(fit.cost) && fit.theta.allFinite(); });
  const Matrix& information = s.fits[typical_cell(s)].all().of_parameters;
  d.isolability = isolability_of(information, s.healthy, s.track.r0_ohm, s.track.unseen_share);
  d.detection_limits = detection_limits_of(information, s.healthy, s.track.r0_ohm, likelihood);
  d.not_visible = without_limit(d.detection_limits);
  d.reference = reference_of(s);
  d.channels = s.channels;
  return d;
}

}  // namespace bms::diagnosis::pack
