#include "benchmark/baselines.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>

#include "diagnosis/bursts.hpp"
#include "diagnosis/denoise_current.hpp"
#include "diagnosis/hypothesis.hpp"
#include "diagnosis/locate.hpp"
#include "diagnosis/noise.hpp"
#include "diagnosis/recording_check.hpp"
#include "diagnosis/screen.hpp"

namespace bms::benchmark {

namespace {

using diagnosis::Columns;
using diagnosis::Hypothesis;
using diagnosis::HypothesisFit;
using diagnosis::LikelihoodModel;
using diagnosis::NoiseModel;
using diagnosis::Verdict;
using model::catalogue;

constexpr std::size_t contact_step = model::mechanism_index("contact_step"),
                      contact_intermittent = model::mechanism_index("contact_intermittent");

/// White noise alone. At 1 V a whitened column is the column.
NoiseModel white(double deviation_v) { return {.white_v = deviation_v, .fast_v = 0, .slow_v = 0, .edge = 0}; }

/// A case as a rule sees it.
struct Question {
  explicit Question(const truth::Case& c)
      : cell(cell_of(c.cell)), recording(record_of(c.recording, c.believed_initial_soc, cell.tolerance.initial_soc)) {
    diagnosis::check_recording(recording, cell);
    noise.white_v =
        diagnosis::white_noise(recording.voltage_v, recording.current_a, 0.01 * cell.capacity_ah, cell.noise.voltage_v);
    noise.fast_v = std::max(cell.tolerance.ocv_v, 5e-4);
    noise.slow_v = 1.3 * std::max(cell.tolerance.drift_v, 5e-4);
    recording.current_a = diagnosis::denoise_current(
        recording.current_a, std::min(diagnosis::current_noise(recording.current_a), 1.5 * cell.noise.current_a));
    if (!c.holdout.time_s.empty()) holdout = record_of(c.holdout, c.holdout_initial_soc, cell.tolerance.initial_soc);
  }

  double floor_v() const {
    return std::sqrt(noise.white_v * noise.white_v + noise.fast_v * noise.fast_v + noise.slow_v * noise.slow_v);
  }
  std::vector<double> predict_holdout(const Hypothesis& h) const {
    return holdout.time_s.empty() ? std::vector<double>{}
                                  : diagnosis::predict(cell, diagnosis::later_recording(h), holdout);
  }

  std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();
  model::CellParameters<> cell;
  diagnosis::PreparedRecording recording, holdout;
  NoiseModel noise;
};

double rms(const LikelihoodModel& evidence, const Columns& error_v) {
  return std::sqrt(error_v.squaredNorm() / static_cast<double>(std::max<std::size_t>(evidence.used(), 1)));
}

/// Where the first recording's rows of a column are largest.
std::vector<model::Span> where(const Question& q, const Columns& column) {
  std::vector<double> energy(q.recording.size());
  for (std::size_t k = 0; k < energy.size(); ++k)
    energy[k] = column(static_cast<Eigen::Index>(k), 0) * column(static_cast<Eigen::Index>(k), 0);
  return diagnosis::strongest_spans(q.recording, energy);
}

std::string id_of(std::size_t mechanism) { return std::string(catalogue[mechanism].id); }

Outcome answered(const truth::Case& c, const Question& q, Outcome said, const std::vector<model::Span>& spans,
                 const std::vector<double>& holdout_v) {
  said.name = c.name;
  said.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - q.begin).count();
  compare(said, c, spans, holdout_v);
  return said;
}

}  // namespace

Outcome frozen_model(const truth::Case& c) {
  const Question q(c);
  const LikelihoodModel evidence(q.cell, {}, {q.recording}, white(1));
  const Columns error_v = evidence.raw_residual(evidence.base(), evidence.unchanged());
  const double floors = rms(evidence, error_v) / q.floor_v();
  Outcome o;
  o.verdict = floors > frozen_factor ? Verdict::unknown : Verdict::no_mismatch;
  o.figures = fmt::format("{:.2f} floors", floors);
  return answered(c, q, o, where(q, error_v), q.predict_holdout(evidence.base()));
}

namespace {

/// freedom: times the tolerance.
Outcome refit(const truth::Case& c, double freedom) {
  const Question q(c);
  // The hold-out is in the evidence without its voltage: the unknowns are then those of both, the fit knows the
  // recording alone, and what belongs to the hold-out itself (initial soc, wander) stays at 0.
  std::vector<diagnosis::PreparedRecording> records{q.recording};
  if (!q.holdout.time_s.empty()) {
    records.push_back(q.holdout);
    std::fill(records.back().voltage_v.begin(), records.back().voltage_v.end(),
              std::numeric_limits<double>::quiet_NaN());
  }
  // the tolerance's weight is relative: a tenth of the noise against it is the noise against ten times it
  const LikelihoodModel evidence(q.cell, {}, records,
                                 {.white_v = q.noise.white_v / freedom,
                                  .fast_v = q.noise.fast_v / freedom,
                                  .slow_v = q.noise.slow_v / freedom,
                                  .edge = 1 / freedom});
  const HypothesisFit fit = evidence.fit(evidence.base());
  const Columns error_v = evidence.raw_residual(fit.hypothesis, fit.calibration);
  const double floors = rms(evidence, error_v) / q.floor_v();
  Outcome o;
  o.verdict = floors > refit_factor ? Verdict::unknown : Verdict::no_mismatch;
  o.figures = fmt::format("{:.2f} floors", floors);
  return answered(c, q, o, where(q, error_v),
                  records.size() > 1 ? evidence.voltage(fit.hypothesis, fit.calibration, 1) : std::vector<double>{});
}

}  // namespace

Outcome base_refit(const truth::Case& c) { return refit(c, 1); }

Outcome free_refit(const truth::Case& c) { return refit(c, 10); }

Outcome aicc_forward(const truth::Case& c) {
  constexpr std::size_t most_mechanisms = 5,
                        most_fits = 3;  // fits: of each step, those of the largest first-order gain
  constexpr int iterations = 6;
  constexpr double same = 2;  // AICc, the usual reading of Akaike weights

  const Question q(c);
  const LikelihoodModel evidence(q.cell, {}, {q.recording}, white(q.floor_v()));
  const auto n = static_cast<double>(evidence.used());
  const auto aicc = [&](const HypothesisFit& f) {
    const Hypothesis& h = f.hypothesis;
    auto k = static_cast<double>(evidence.calibration().size() + h.sought().size() + 1);
    if (h.find(contact_step) != nullptr) k += 1;  // its moment
    for (const auto& bursts : h.bursts) k += 2 * static_cast<double>(bursts.size());
    return n * std::log(evidence.raw_residual(h, f.calibration).squaredNorm() / n) + 2 * k +
           2 * k * (k + 1) / (n - k - 1);
  };
  std::vector<std::size_t> all(model::mechanism_count);
  std::iota(all.begin(), all.end(), std::size_t{0});

  Outcome o;
  const HypothesisFit base = evidence.fit(evidence.base(), iterations);
  HypothesisFit current = base;
  double lowest = aicc(base);
  while (o.found.size() < most_mechanisms) {
    const diagnosis::Screen screen(evidence, current, all);
    struct Tried {
      double aicc;
      std::size_t mechanism;
      HypothesisFit fit;
    };
    std::vector<Tried> tried;
    for (const diagnosis::Candidate& candidate : screen.candidates()) {
      if (tried.size() == most_fits) break;
      Hypothesis h = with(current.hypothesis, candidate.start);
      if (!candidate.bursts.empty()) h.bursts = candidate.bursts;
      HypothesisFit fit = evidence.fit(h, current.calibration, iterations);
      const double value = aicc(fit);
      tried.push_back({value, candidate.mechanism, std::move(fit)});
    }
    std::sort(tried.begin(), tried.end(), [](const Tried& a, const Tried& b) { return a.aicc < b.aicc; });
    if (tried.empty() || tried.front().aicc >= lowest) break;
    double weights = std::exp((tried.front().aicc - lowest) / 2);  // of what was there before
    o.found.push_back(id_of(tried.front().mechanism));
    std::vector<std::string>& set = o.sets.emplace_back();
    for (const Tried& t : tried) {
      weights += std::exp((tried.front().aicc - t.aicc) / 2);
      if (t.aicc - tried.front().aicc < same) set.push_back(id_of(t.mechanism));
    }
    if (o.found.size() == 1) o.probability = 1 / weights;
    o.figures +=
        fmt::format("{}{} {:.0f}", o.figures.empty() ? "" : " | ", o.found.back(), lowest - tried.front().aicc);
    lowest = tried.front().aicc;
    current = std::move(tried.front().fit);
  }
  if (o.found.empty())
    o.verdict = Verdict::no_mismatch;
  else if (o.found.size() > 1)
    o.verdict = Verdict::causes;
  else
    o.verdict = o.sets.front().size() > 1 ? Verdict::ambiguous : Verdict::cause;
  return answered(c, q, o, diagnosis::contributions(evidence, base, current).spans,
                  q.predict_holdout(current.hypothesis));
}

Outcome nearest_signature(const truth::Case& c) {
  const Question q(c);
  const LikelihoodModel evidence(q.cell, {}, {q.recording}, white(1));
  const Hypothesis base = evidence.base();
  const Eigen::VectorXd u = evidence.unchanged();
  const Columns error_v = evidence.raw_residual(base, u);
  const double floors = rms(evidence, error_v) / q.floor_v();
  Outcome o;
  o.figures = fmt::format("{:.2f} floors", floors);
  if (floors <= frozen_factor) {
    o.verdict = Verdict::no_mismatch;
    return answered(c, q, o, {}, q.predict_holdout(base));
  }

  Hypothesis best = base;
  Columns explained_v = error_v;
  double best_cosine = 0;
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    if (not_testable(evidence, base, m)) continue;
    std::vector<diagnosis::MechanismSetting> settings = probe_settings(evidence, m);
    constexpr std::size_t moments = 20;
    for (std::size_t k = 1; m == contact_step && k < moments; ++k) {
      settings.push_back(settings.front());
      settings.back().value[1] = q.recording.time_s[k * q.recording.size() / moments];
    }
    for (const diagnosis::MechanismSetting& setting : settings) {
      Hypothesis h = with(base, setting);
      if (m == contact_intermittent) {
        double ohm = 0;
        h.bursts = {find_bursts(q.recording, std::vector<double>(error_v.data(), error_v.data() + error_v.size()),
                                evidence.whitener(0), ohm)};
      }
      // one strength, one signature
      for (std::size_t p = 0; p < catalogue[m].parameters; ++p) {
        const model::Parameter& parameter = catalogue[m].parameter[p];
        if (parameter.role != model::Role::strength) continue;
        const std::vector<diagnosis::ParameterRef> by{{h.settings.size() - 1, p}};
        const Columns signature = evidence.derivatives(h, u, by);
        const double along = signature.col(0).dot(error_v.col(0)), length = signature.norm();
        if (!(length > 0) || (along < 0 && parameter.low >= 0)) continue;
        const double cosine = std::abs(along) / (length * error_v.norm());
        if (cosine <= best_cosine) continue;
        const double strength = std::clamp(along / (length * length), parameter.lower(q.cell.capacity_ah),
                                           parameter.upper(q.cell.capacity_ah));
        best_cosine = cosine;
        best = h;
        best.settings.back().value[p] = strength;
        explained_v = strength * signature;
      }
    }
  }
  o.verdict = best_cosine > 0 ? Verdict::cause : Verdict::unknown;
  if (best_cosine > 0) {
    o.found = {id_of(best.settings.back().index)};
    o.sets = {o.found};
    o.probability = best_cosine;
    o.figures += fmt::format(" | {} {:.2f}", o.found.front(), best_cosine);
  }
  return answered(c, q, o, where(q, explained_v), q.predict_holdout(best));
}

}  // namespace bms::benchmark
