#include "benchmark/baselines.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>

#include "benchmark/cause_ids.hpp"
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

/// White noise alone. With a sigma of 1 V whitening changes nothing.
NoiseModel white(double sigma_v) { return {.white_v = sigma_v, .fast_v = 0, .slow_v = 0, .edge = 0}; }

/// A case as the rules get it.
struct PreparedCase {
  explicit PreparedCase(const truth::Case& c)
      : cell(cell_of(c.cell)), recording(record_of(c.recording, c.given_initial_soc, cell.tolerance.initial_soc)) {
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

double rms(const LikelihoodModel& likelihood, const Columns& error_v) {
  return std::sqrt(error_v.squaredNorm() / static_cast<double>(std::max<std::size_t>(likelihood.used(), 1)));
}

/// The times at which the column is largest within the first recording.
std::vector<model::Span> where(const PreparedCase& q, const Columns& column) {
  std::vector<double> energy(q.recording.size());
  for (std::size_t k = 0; k < energy.size(); ++k)
    energy[k] = column(static_cast<Eigen::Index>(k), 0) * column(static_cast<Eigen::Index>(k), 0);
  return diagnosis::strongest_spans(q.recording, energy);
}

Outcome completed(const truth::Case& c, const PreparedCase& q, Outcome o, const std::vector<model::Span>& spans,
                  const std::vector<double>& holdout_v) {
  o.name = c.name;
  o.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - q.begin).count();
  compare(o, c, spans, holdout_v);
  return o;
}

}  // namespace

Outcome frozen_model(const truth::Case& c) {
  const PreparedCase q(c);
  const LikelihoodModel likelihood(q.cell, {}, {q.recording}, white(1));
  const Columns error_v = likelihood.raw_residual(likelihood.base(), likelihood.unchanged());
  const double floors = rms(likelihood, error_v) / q.floor_v();
  Outcome o;
  o.verdict = floors > frozen_factor ? Verdict::unknown : Verdict::no_mismatch;
  o.figures = fmt::format("{:.2f} floors", floors);
  return completed(c, q, o, where(q, error_v), q.predict_holdout(likelihood.base()));
}

namespace {

/// freedom: factor on the tolerance.
Outcome refit(const truth::Case& c, double freedom) {
  const PreparedCase q(c);
  // The hold-out is part of the likelihood model without its voltage. The unknowns are then those of both recordings,
  // only the recording is fitted, and the unknowns of the hold-out itself (initial SOC, drift) stay at 0.
  std::vector<diagnosis::PreparedRecording> records{q.recording};
  if (!q.holdout.time_s.empty()) {
    records.push_back(q.holdout);
    records.back().voltage_v = std::vector<double>(q.holdout.size(), std::numeric_limits<double>::quiet_NaN());
  }
  // only the ratio of noise and tolerance counts: a tenth of the noise stands for ten times the tolerance
  const LikelihoodModel likelihood(q.cell, {}, records,
                                   {.white_v = q.noise.white_v / freedom,
                                    .fast_v = q.noise.fast_v / freedom,
                                    .slow_v = q.noise.slow_v / freedom,
                                    .edge = 1 / freedom});
  const HypothesisFit fit = likelihood.fit(likelihood.base());
  const Columns error_v = likelihood.raw_residual(fit.hypothesis, fit.calibration);
  const double floors = rms(likelihood, error_v) / q.floor_v();
  Outcome o;
  o.verdict = floors > refit_factor ? Verdict::unknown : Verdict::no_mismatch;
  o.figures = fmt::format("{:.2f} floors", floors);
  return completed(c, q, o, where(q, error_v),
                   records.size() > 1 ? likelihood.voltage(fit.hypothesis, fit.calibration, 1) : std::vector<double>{});
}

}  // namespace

Outcome base_refit(const truth::Case& c) { return refit(c, 1); }

Outcome free_refit(const truth::Case& c) { return refit(c, 10); }

namespace {

constexpr std::size_t most_mechanisms = 5;
constexpr std::size_t most_fits = 3;  // candidates of each step that are fitted: those of the largest first-order gain
constexpr int aicc_iterations = 6;
constexpr double same_aicc = 2;  // the usual reading of Akaike weights

double aicc_of(const LikelihoodModel& likelihood, const HypothesisFit& f) {
  const Hypothesis& h = f.hypothesis;
  const auto n = static_cast<double>(likelihood.used());
  auto k = static_cast<double>(likelihood.calibration().size() + h.sought().size() + 1);
  if (h.find(contact_step) != nullptr) k += 1;  // its time
  for (const auto& bursts : h.bursts) k += 2 * static_cast<double>(bursts.size());
  return n * std::log(likelihood.raw_residual(h, f.calibration).squaredNorm() / n) + 2 * k +
         2 * k * (k + 1) / (n - k - 1);
}

struct Trial {
  double aicc;
  std::size_t mechanism;
  HypothesisFit fit;
};

/// Fits of one mechanism more, the smallest AICc first.
std::vector<Trial> tried_mechanisms(const LikelihoodModel& likelihood, const HypothesisFit& current,
                                    const std::vector<std::size_t>& mechanisms) {
  const diagnosis::Screen screen(likelihood, current, mechanisms);
  std::vector<Trial> trials;
  for (const diagnosis::Candidate& candidate : screen.candidates()) {
    if (trials.size() == most_fits) break;
    Hypothesis h = with(current.hypothesis, candidate.start);
    if (!candidate.bursts.empty()) h.bursts = candidate.bursts;
    HypothesisFit fit = likelihood.fit(h, current.calibration, aicc_iterations);
    const double value = aicc_of(likelihood, fit);
    trials.push_back({value, candidate.mechanism, std::move(fit)});
  }
  std::sort(trials.begin(), trials.end(), [](const Trial& a, const Trial& b) { return a.aicc < b.aicc; });
  return trials;
}

/// Adds the best trial to the outcome, with the trials of about the same AICc as its set.
void add_finding(const std::vector<Trial>& trials, double aicc_before, Outcome& o) {
  const Trial& best = trials.front();
  double weights = std::exp((best.aicc - aicc_before) / 2);  // of the hypothesis without another mechanism
  o.found.push_back(id_of(best.mechanism));
  std::vector<std::string>& set = o.sets.emplace_back();
  for (const Trial& t : trials) {
    weights += std::exp((best.aicc - t.aicc) / 2);
    if (t.aicc - best.aicc < same_aicc) set.push_back(id_of(t.mechanism));
  }
  if (o.found.size() == 1) o.probability = 1 / weights;
  o.figures += fmt::format("{}{} {:.0f}", o.figures.empty() ? "" : " | ", o.found.back(), aicc_before - best.aicc);
}

Verdict verdict_of(const Outcome& o) {
  if (o.found.empty()) return Verdict::no_mismatch;
  if (o.found.size() > 1) return Verdict::causes;
  return o.sets.front().size() > 1 ? Verdict::ambiguous : Verdict::cause;
}

}  // namespace

Outcome aicc_forward(const truth::Case& c) {
  const PreparedCase q(c);
  const LikelihoodModel likelihood(q.cell, {}, {q.recording}, white(q.floor_v()));
  std::vector<std::size_t> all(model::mechanism_count);
  std::iota(all.begin(), all.end(), std::size_t{0});

  Outcome o;
  const HypothesisFit base = likelihood.fit(likelihood.base(), aicc_iterations);
  HypothesisFit current = base;
  double lowest = aicc_of(likelihood, base);
  while (o.found.size() < most_mechanisms) {
    std::vector<Trial> trials = tried_mechanisms(likelihood, current, all);
    if (trials.empty() || trials.front().aicc >= lowest) break;
    add_finding(trials, lowest, o);
    lowest = trials.front().aicc;
    current = std::move(trials.front().fit);
  }
  o.verdict = verdict_of(o);
  return completed(c, q, o, diagnosis::contributions(likelihood, base, current).spans,
                   q.predict_holdout(current.hypothesis));
}

namespace {

/// The signature with the largest cosine with the residual.
class NearestSignature {
 public:
  NearestSignature(const PreparedCase& q, const LikelihoodModel& likelihood)
      : q_(q),
        likelihood_(likelihood),
        base_(likelihood.base()),
        calibration_(likelihood.unchanged()),
        error_v_(likelihood.raw_residual(base_, calibration_)),
        best_(base_),
        explained_v_(error_v_) {}

  const Hypothesis& base() const { return base_; }
  const Columns& error_v() const { return error_v_; }
  const Hypothesis& best() const { return best_; }
  const Columns& explained_v() const { return explained_v_; }
  double cosine() const { return cosine_; }

  void try_all() {
    for (std::size_t m = 0; m < model::mechanism_count; ++m) {
      if (not_testable(likelihood_, base_, m)) continue;
      for (const diagnosis::MechanismSetting& setting : settings_of(m)) {
        const Hypothesis h = hypothesis_of(m, setting);
        for (std::size_t p = 0; p < catalogue[m].parameters; ++p) {
          if (catalogue[m].parameter[p].role == model::Role::strength) try_strength(h, catalogue[m].parameter[p], p);
        }
      }
    }
  }

 private:
  /// Shapes of the grid of the diagnosis; for a contact step 20 times.
  std::vector<diagnosis::MechanismSetting> settings_of(std::size_t mechanism) const {
    std::vector<diagnosis::MechanismSetting> settings = probe_settings(likelihood_, mechanism);
    constexpr std::size_t times = 20;
    for (std::size_t k = 1; mechanism == contact_step && k < times; ++k) {
      settings.push_back(settings.front());
      settings.back().value[1] = q_.recording.time_s[k * q_.recording.size() / times];
    }
    return settings;
  }

  Hypothesis hypothesis_of(std::size_t mechanism, const diagnosis::MechanismSetting& setting) const {
    Hypothesis h = with(base_, setting);
    if (mechanism == contact_intermittent) {
      double ohm = 0;
      h.bursts = {find_bursts(q_.recording, std::vector<double>(error_v_.data(), error_v_.data() + error_v_.size()),
                              likelihood_.whitener(0), ohm)};
    }
    return h;
  }

  /// Each strength parameter has its own signature: the derivative of the voltage by it.
  void try_strength(const Hypothesis& h, const model::Parameter& parameter, std::size_t index) {
    const std::vector<diagnosis::ParameterRef> by{{h.settings.size() - 1, index}};
    const Columns signature = likelihood_.derivatives(h, calibration_, by);
    const double along = signature.col(0).dot(error_v_.col(0)), length = signature.norm();
    if (!(length > 0) || (along < 0 && parameter.low >= 0)) return;
    const double cosine = std::abs(along) / (length * error_v_.norm());
    if (cosine <= cosine_) return;
    const double capacity_ah = q_.cell.capacity_ah;
    const double strength =
        std::clamp(along / (length * length), parameter.lower(capacity_ah), parameter.upper(capacity_ah));
    cosine_ = cosine;
    best_ = h;
    best_.settings.back().value[index] = strength;
    explained_v_ = strength * signature;
  }

  const PreparedCase& q_;
  const LikelihoodModel& likelihood_;
  Hypothesis base_;
  Eigen::VectorXd calibration_;
  Columns error_v_;
  Hypothesis best_;
  Columns explained_v_;
  double cosine_ = 0;
};

}  // namespace

Outcome nearest_signature(const truth::Case& c) {
  const PreparedCase q(c);
  const LikelihoodModel likelihood(q.cell, {}, {q.recording}, white(1));
  NearestSignature nearest(q, likelihood);
  const double floors = rms(likelihood, nearest.error_v()) / q.floor_v();
  Outcome o;
  o.figures = fmt::format("{:.2f} floors", floors);
  if (floors <= frozen_factor) {
    o.verdict = Verdict::no_mismatch;
    return completed(c, q, o, {}, q.predict_holdout(nearest.base()));
  }
  nearest.try_all();
  o.verdict = nearest.cosine() > 0 ? Verdict::cause : Verdict::unknown;
  if (nearest.cosine() > 0) {
    o.found = {id_of(nearest.best().settings.back().index)};
    o.sets = {o.found};
    o.probability = nearest.cosine();
    o.figures += fmt::format(" | {} {:.2f}", o.found.front(), nearest.cosine());
  }
  return completed(c, q, o, where(q, nearest.explained_v()), q.predict_holdout(nearest.best()));
}

}  // namespace bms::benchmark
