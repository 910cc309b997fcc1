#include "diagnosis/search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "diagnosis/decision.hpp"

namespace bms::diagnosis {

namespace {

using model::catalogue;
using model::Role;

constexpr int usual_iterations = 12;
constexpr std::size_t temperature_resistance = mechanism_index("temperature_resistance");

/// What its unknowns cost a mechanism; what is known of most cells is none.
double price(std::size_t mechanism, std::size_t bursts) {
  double unknowns = 0;
  for (std::size_t p = 0; p < catalogue[mechanism].parameters; ++p)
    unknowns +=
        catalogue[mechanism].parameter[p].role != Role::given && catalogue[mechanism].parameter[p].spread == 0 ? 1 : 0;
  if (catalogue[mechanism].id == "contact_step") unknowns += 4;  // its moment was sought too
  return decision::per_unknown * (unknowns - 1) + decision::per_burst * static_cast<double>(bursts);
}

double price(const Hypothesis& h) {
  double sum = 0;
  std::size_t bursts = 0;
  for (const auto& spans : h.bursts) bursts += spans.size();
  for (const std::size_t m : h.added()) sum += price(m, m == mechanism_index("contact_intermittent") ? bursts : 0);
  return sum;
}

/// What speaks for a mechanism before any voltage is looked at: a cell far from its file's temperature has other
/// resistances.
double known_before(double away_k, const Hypothesis& h) {
  if (h.find(temperature_resistance) == nullptr || h.own > 0) return 0;
  return std::clamp((away_k - 5) * 1.5, 0.0, 15.0);
}

/// RMS of a raw residual, of the voltages that were read.
double reading_error_v(const LikelihoodModel& evidence, const Columns& raw) {
  return std::sqrt(raw.topRows(static_cast<Eigen::Index>(evidence.readings())).squaredNorm() /
                   static_cast<double>(std::max<std::size_t>(evidence.used(), 1)));
}

/// With the base parameters where a fit has them, but for those that belong to a single recording.
double lasting_error_v(const LikelihoodModel& evidence, const HypothesisFit& f) {
  Eigen::VectorXd u = f.calibration;
  u.tail(u.size() - static_cast<Eigen::Index>(evidence.calibration().shared())).setZero();
  return reading_error_v(evidence, evidence.raw_residual(f.hypothesis, u));
}

}  // namespace

double away_k(const LikelihoodModel& evidence) {
  double away = 0;
  for (const PreparedRecording& r : evidence.records()) {
    for (const double c : r.temperature_c) {
      if (std::isfinite(c)) away = std::max(away, std::abs(c - 25));
    }
  }
  return away;
}

double plain_error_v(const LikelihoodModel& evidence, const Hypothesis& h) {
  return reading_error_v(evidence, evidence.raw_residual(h, evidence.unchanged()));
}

double Search::total(const HypothesisFit& f) const {
  double cost = 0;
  evidence_.likeliest_noise(evidence_.raw_residual(f.hypothesis, f.calibration), nominal_, cost);
  return cost + f.cost - f.residual.squaredNorm();
}

double Search::score(const HypothesisFit& f) {
  const auto known = totals_.find(f.cost);
  const double sum = known != totals_.end() ? known->second : (totals_[f.cost] = total(f));
  return sum + price(f.hypothesis) - known_before(away_k_, f.hypothesis);
}

HypothesisFit Search::settled(HypothesisFit f) {
  for (int round = 0; round < 2; ++round) {
    double cost = 0;
    const NoiseModel noise =
        evidence_.likeliest_noise(evidence_.raw_residual(f.hypothesis, f.calibration), nominal_, cost);
    if (noise == f.noise) break;
    evidence_.set_noise(noise);
    f = evidence_.fit(f.hypothesis, f.calibration, 5);
  }
  return f;
}

double Search::gain(const HypothesisFit& less, const HypothesisFit& more) {
  return score(less) + known_before(away_k_, less.hypothesis) - score(more) - known_before(away_k_, more.hypothesis);
}

HypothesisFit Search::fit_with(const HypothesisFit& around, const Candidate& c, double hopeless) {
  Hypothesis h = with(around.hypothesis, c.start);
  if (!c.bursts.empty()) h.bursts = c.bursts;
  HypothesisFit best = evidence_.fit(h, around.calibration, usual_iterations, hopeless);
  for (const Eigen::VectorXd& u : far_bases(around)) {
    const auto farther = far_start(h, u);
    if (!farther) continue;
    HypothesisFit other = evidence_.fit(*farther, u, usual_iterations, hopeless);
    if (other.cost < best.cost) best = std::move(other);
  }
  if (catalogue[c.mechanism].id == "contact_step") best = refined_onset(best);
  tell(catalogue[c.mechanism].id);
  return best;
}

std::array<Eigen::VectorXd, 2> Search::far_bases(const HypothesisFit& around) const {
  return {around.calibration, evidence_.unchanged()};
}

std::optional<Hypothesis> Search::far_start(Hypothesis h, const Eigen::VectorXd& u) {
  MechanismSetting& s = h.settings.back();
  const std::string_view id = catalogue[s.index].id;
  std::vector<std::vector<double>> tries;
  if (id == "capacity_change")
    tries = {{-0.1}, {0.04}, {0.08}, {0.14}, {0.2}, {0.28}};
  else if (id == "current_gain")
    tries = {{-0.12}, {-0.06}, {0.06}, {0.12}};
  else if (id == "initial_soc")
    tries = {{-0.15}, {-0.08}, {-0.04}, {0.04}, {0.08}, {0.15}};
  else if (id == "ocv_shape")
    tries = {{-0.06, -0.06}, {-0.03, -0.03}, {0.03, 0.03}, {0.06, 0.06}, {0.06, -0.06}, {-0.06, 0.06}};
  else if (id == "current_offset" || id == "leakage") {
    double hours = 0;
    for (const PreparedRecording& r : evidence_.records()) hours += r.duration_s() / 3'600;
    const double per_soc_a = evidence_.cell().capacity_ah / std::max(hours, 0.1),
                 most_a = catalogue[s.index].parameter[0].upper(evidence_.cell().capacity_ah);
    for (const double soc : {-0.12, -0.06, -0.03, 0.03, 0.06, 0.12}) {
      if (std::abs(soc) * per_soc_a < most_a && (soc > 0 || catalogue[s.index].parameter[0].low < 0))
        tries.push_back({soc * per_soc_a});
    }
  } else if (id == "slow_polarisation") {
    for (const double tau_s : {200.0, 600.0}) {
      for (const double lag_s : {120.0, 300.0}) tries.push_back({s.value[0], tau_s, s.value[2], lag_s});
    }
  }
  if (tries.empty()) return std::nullopt;
  double least = evidence_.residual(h, u).squaredNorm();
  std::optional<Hypothesis> best;
  for (const auto& t : tries) {
    for (std::size_t p = 0; p < t.size(); ++p) s.value[p] = t[p];
    const double cost = evidence_.residual(h, u).squaredNorm();
    if (cost >= least) continue;
    least = cost;
    best = h;
  }
  return best;
}

bool Search::far_better(const HypothesisFit& around, const Candidate& c) {
  for (const Eigen::VectorXd& u : far_bases(around)) {
    const auto far = far_start(with(around.hypothesis, c.start), u);
    if (far && evidence_.residual(*far, u).squaredNorm() <
                   evidence_.residual(around.hypothesis, u).squaredNorm() - decision::worth_a_fit)
      return true;
  }
  return false;
}

HypothesisFit Search::refined_onset(HypothesisFit best) {
  const PreparedRecording& r = evidence_.records().front();
  const auto setting = [](HypothesisFit& f) -> MechanismSetting& {
    return *std::find_if(f.hypothesis.settings.begin(), f.hypothesis.settings.end(),
                         [](const MechanismSetting& s) { return s.index == mechanism_index("contact_step"); });
  };
  double reach_s = r.duration_s() / 40;
  Eigen::VectorXd residual;
  while (reach_s > 1.5 * r.duration_s() / static_cast<double>(r.size())) {
    const double middle_s = setting(best).value[1];
    for (const double step : {-1.0, -0.5, 0.5, 1.0}) {
      Hypothesis h = best.hypothesis;
      for (MechanismSetting& s : h.settings) {
        // a step at either end is no step
        if (s.index == mechanism_index("contact_step"))
          s.value[1] = std::clamp(middle_s + step * reach_s, r.time_s.front() + 0.04 * r.duration_s(),
                                  r.time_s.back() - 0.04 * r.duration_s());
      }
      residual = evidence_.residual(h, best.calibration);
      const double cost = residual.squaredNorm() + (best.cost - best.residual.squaredNorm());
      if (cost < best.cost) {
        best.cost = cost;
        best.residual = residual;
        best.hypothesis = h;
      }
    }
    reach_s /= 2;
  }
  return evidence_.fit(best.hypothesis, best.calibration, 4);
}

bool Search::alike(const NoiseModel& a, const NoiseModel& b) {
  const auto near = [](double x, double y) { return x < 1.25 * y && y < 1.25 * x; };
  return near(a.white_v, b.white_v) && near(a.fast_v, b.fast_v) && near(a.slow_v, b.slow_v) && near(a.edge, b.edge);
}

std::vector<HypothesisFit> Search::one_more(const HypothesisFit& around, const std::vector<std::size_t>& over) {
  // by the nominal noise, which asks for everything to be explained, and by that of what is left, which asks for the
  // large first
  std::vector<HypothesisFit> fits;
  std::set<std::size_t> tried;
  for (const NoiseModel& noise : {nominal_, around.noise}) {
    if (!fits.empty() && alike(noise, nominal_)) break;
    evidence_.set_noise(noise);
    const HypothesisFit from = noise == around.noise ? around : evidence_.fit(around.hypothesis, around.calibration, 5);
    const Screen screen(evidence_, from, over);
    std::vector<Candidate> worth;
    for (const Candidate& c : screen.candidates()) {
      if (c.gain < decision::worth_a_fit ? !far_better(from, c) : worth.size() >= decision::most_fits) continue;
      if (tried.insert(c.mechanism).second || noise != nominal_) worth.push_back(c);
    }
    const std::vector<HypothesisFit> here = fitted(from, worth, std::numeric_limits<double>::infinity());
    fits.insert(fits.end(), here.begin(), here.end());
  }
  std::stable_sort(fits.begin(), fits.end(),
                   [&](const HypothesisFit& a, const HypothesisFit& b) { return score(a) < score(b); });
  return fits;
}

std::vector<HypothesisFit> Search::in_place_of(std::size_t m, const HypothesisFit& best, const HypothesisFit& less,
                                               const std::vector<std::size_t>& over, double gain_of_m,
                                               std::map<std::size_t, double>& likeness) {
  // they must stand up to the noise that the best leaves
  evidence_.set_noise(best.noise);
  const HypothesisFit from = evidence_.fit(less.hypothesis, less.calibration, 5);
  const Screen screen(evidence_, from, over);
  const auto& all = screen.candidates();
  std::vector<Candidate> worth;
  for (std::size_t a = 0; a < all.size(); ++a) {
    if (all[a].mechanism == m) {
      for (std::size_t b = 0; b < all.size(); ++b) likeness[all[b].mechanism] = screen.alike(a, b);
    }
    if (worth.size() < decision::most_rivals && all[a].gain >= std::max(decision::worth_a_fit, 0.1 * gain_of_m))
      worth.push_back(all[a]);
  }
  return fitted(from, worth, best.cost + decision::hopeless);
}

std::vector<HypothesisFit> Search::fitted(const HypothesisFit& around, const std::vector<Candidate>& candidates,
                                          double hopeless) {
  std::vector<HypothesisFit> fits;
  if (!around.hypothesis.added().empty()) evidence_.linearise(around.hypothesis, around.calibration);
  for (const Candidate& c : candidates) {
    fits.push_back(fit_with(around, c, hopeless));
  }
  std::stable_sort(fits.begin(), fits.end(),
                   [](const HypothesisFit& a, const HypothesisFit& b) { return a.cost < b.cost; });
  for (std::size_t k = 0; k < fits.size() && k < 3; ++k) {
    if (fits[k].cost < hopeless) fits[k] = settled(fits[k]);
  }
  return fits;
}

bool Search::carries(const HypothesisFit& before, const HypothesisFit& f) const {
  if (f.hypothesis.added().size() < 2) return true;
  const double was_v = std::min(lasting_error_v(evidence_, before), plain_error_v(evidence_, evidence_.base()));
  return lasting_error_v(evidence_, f) <= decision::may_grow * was_v + 3e-4;
}

HypothesisFit Search::without_one(const HypothesisFit& f, std::size_t m) {
  evidence_.set_noise(f.noise);
  return settled(evidence_.fit(without(f.hypothesis, m), f.calibration, 8));
}

void Search::tell(std::string_view what) {
  ++steps_;
  if (progress_) progress_(1 - std::exp(-static_cast<double>(steps_) / 20), std::string(what));
}

}  // namespace bms::diagnosis
