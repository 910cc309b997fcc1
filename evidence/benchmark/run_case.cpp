#include "benchmark/run_case.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "benchmark/cause_ids.hpp"

namespace bms::benchmark {

namespace {

double rmse(const std::vector<double>& predicted, const std::vector<double>& measured) {
  double sum = 0;
  for (std::size_t k = 0; k < predicted.size(); ++k) sum += (predicted[k] - measured[k]) * (predicted[k] - measured[k]);
  return std::sqrt(sum / static_cast<double>(predicted.size()));
}

double overlap(const std::vector<model::Span>& spans, double start_s, double end_s) {
  double inside = 0, covered = 0;
  for (const model::Span& s : spans) {
    covered += s.end_s - s.start_s;
    inside += std::max(0.0, std::min(s.end_s, end_s) - std::max(s.start_s, start_s));
  }
  const double all = covered + (end_s - start_s) - inside;
  return all > 0 ? inside / all : 0;
}

/// The figures behind the decision.
std::string figures_of(const diagnosis::Diagnosis& d) {
  std::string figures =
      fmt::format("base {:.0f} best {:.0f} remaining {:.0f} ({}) adequacy {:.2f} fast {:.2f} far {:.4f}", d.base_cost,
                  d.best_cost, d.remaining, d.remaining_goes_with, d.adequacy, d.fast_excess, d.far_out);
  if (d.law)
    figures += fmt::format(" law {} {:.2f}->{:.2f} mV x{:g}{}", d.law->law, 1e3 * d.law->left_out_before_v,
                           1e3 * d.law->left_out_after_v, d.law->times_tolerance, d.law->cell ? " term" : "");
  if (d.law && d.law->mechanism) {
    for (const double v : d.law->mechanism->value) figures += v == 0 ? "" : fmt::format(" {:.3g}", v);
  }
  for (const diagnosis::LawEvidence& e : d.law ? d.law->laws : std::vector<diagnosis::LawEvidence>{})
    figures += fmt::format(" {} by {} {:.0f}", e.law, e.depends_on, e.gain);
  for (const diagnosis::Finding& f : d.findings) {
    figures += fmt::format(" | {} {:.0f}", id_of(f.setting.index), f.gain);
    for (std::size_t p = 0; p < model::catalogue[f.setting.index].parameters; ++p)
      figures += fmt::format(" {:.3g}", f.setting.value[p]);
  }
  if (d.findings.empty() && !d.candidates.empty())
    figures += fmt::format(" | nearest {} {:.1f}", id_of(d.candidates.front().ids.front()), d.candidates.front().gain);
  return figures;
}

}  // namespace

model::CellParameters<> cell_of(const truth::CalibratedCell& c) {
  model::CellParameters<> p;
  p.capacity_ah = c.capacity_ah;
  constexpr double most_a = 2'000;  // that a cell file accepts: a cell of 280 Ah would have more
  p.limits = {2.0, 3.65, std::min(2 * c.capacity_ah, most_a), std::min(10 * c.capacity_ah, most_a), -20, 60};
  for (const double soc : c.ocv_soc) p.ocv.soc.push_back(soc);
  for (const double v : c.ocv_b0_v) p.ocv.b0_v.push_back(v);
  for (const double v : c.ocv_b1_v) p.ocv.b1_v.push_back(v);
  for (std::size_t k = 0; k < c.rc_soc.size(); ++k) {
    p.rc.soc.push_back(c.rc_soc[k]);
    p.rc.r0_ohm.push_back(c.r0_ohm[k]);
    p.rc.r1_ohm.push_back(c.r1_ohm[k]);
    p.rc.c1_f.push_back(c.c1_f[k]);
  }
  p.noise = {0.001, 0.003, 60, 0.002, 0.005, 0.002 * c.capacity_ah, 5e-4 * c.capacity_ah, 3'600, 0.2 * c.capacity_ah};
  p.tolerance = {c.ocv_tolerance_v, c.resistance_tolerance, c.initial_soc_tolerance, c.drift_tolerance_v};
  return p;
}

diagnosis::PreparedRecording record_of(const truth::Series& s, double initial_soc, double sigma) {
  return {"", s.time_s, s.current_a, s.voltage_v, s.temperature_c, initial_soc, sigma, true, {}};
}

void compare(Outcome& o, const truth::Case& c, const std::vector<model::Span>& spans,
             const std::vector<double>& holdout_v) {
  if (!holdout_v.empty()) {
    const model::CellParameters<> cell = cell_of(c.cell);
    o.holdout_before_v =
        rmse(diagnosis::predict(cell, {}, record_of(c.holdout, c.holdout_initial_soc, cell.tolerance.initial_soc)),
             c.holdout.voltage_v);
    o.holdout_after_v = rmse(holdout_v, c.holdout.voltage_v);
  }
  o.overlap = overlap(spans, c.answer.start_s, c.answer.end_s);
  o.holdout_floor_v = std::sqrt(std::pow(c.answer.noise_floor_v, 2) + std::pow(c.cell.ocv_tolerance_v, 2) +
                                std::pow(c.cell.drift_tolerance_v, 2));
  o.answer = c.answer;
}

Outcome run_case(const truth::Case& c, bool with_experiments) {
  const model::CellParameters<> cell = cell_of(c.cell);
  const diagnosis::PreparedRecording recording =
      record_of(c.recording, c.given_initial_soc, cell.tolerance.initial_soc);
  const auto begin = std::chrono::steady_clock::now();
  const diagnosis::Diagnosis d = diagnosis::diagnose(cell, {}, {recording});
  Outcome o;
  o.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  o.name = c.name;
  o.verdict = d.verdict;
  o.sets = sets_of(d);
  for (const auto& set : o.sets) o.found.push_back(set.front());
  o.probability = d.findings.empty() ? 0 : d.findings.front().probability;
  o.figures = figures_of(d);
  if (d.law) o.law = d.law->law;
  o.has_term = d.law && d.law->cell;
  o.isolability = d.isolability;

  std::vector<double> holdout_v;
  if (!c.holdout.time_s.empty()) {
    // as the tool: without causes that were not named
    std::vector<diagnosis::MechanismSetting> added;
    if (diagnosis::names(d.verdict)) added = diagnosis::later_recording(d.extended, c.holdout_initial_soc);
    if (o.has_term) added = diagnosis::with_term({}, *d.law);
    holdout_v =
        diagnosis::predict(d.cell, added, record_of(c.holdout, c.holdout_initial_soc, cell.tolerance.initial_soc));
  }
  compare(o, c, d.spans, holdout_v);
  if (with_experiments) o.next = follow_up(c, cell, recording, d);
  return o;
}

}  // namespace bms::benchmark
