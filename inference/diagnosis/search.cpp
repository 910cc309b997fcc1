#include "diagnosis/search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "diagnosis/refit.hpp"
#include "diagnosis/thresholds.hpp"
#include "numerics/in_parallel.hpp"

namespace bms::diagnosis {

namespace {

using model::catalogue;
using model::Role;

constexpr const Thresholds::Decision& search_limits = thresholds.decision;
constexpr const Thresholds::Screening& candidate_limits = thresholds.screening;
constexpr const Numerics::Search& search_numerics = numerics.search;

double price(const Hypothesis& h) {
  double sum = 0;
  std::size_t bursts = 0;
  for (const auto& spans : h.bursts) bursts += spans.size();
  for (const std::size_t m : h.added()) {
    const bool in_bursts = knowledge_of(m).signature == Signature::contact_bursts;
    sum += price_of_unknowns(m) + search_limits.per_burst * static_cast<double>(in_bursts ? bursts : 0);
  }
  return sum;
}

/// Gain of the mechanisms that a hypothesis adds before any voltage is looked at; 0 if the cell file has some of its
/// own.
double known_beforehand(const RecordingFacts& facts, const Hypothesis& h) {
  if (h.own > 0) return 0;
  double sum = 0;
  for (const std::size_t m : h.added()) sum += knowledge_of(m).prior_gain(facts);
  return sum;
}

/// RMS of a raw residual, of the voltages that were read.
double reading_error_v(const LikelihoodModel& likelihood, const Columns& raw) {
  return std::sqrt(raw.topRows(static_cast<Eigen::Index>(likelihood.readings())).squaredNorm() /
                   static_cast<double>(std::max<std::size_t>(likelihood.used(), 1)));
}

/// With the base parameters of the fit, except those that belong to a single recording.
double lasting_error_v(const LikelihoodModel& likelihood, const HypothesisFit& f) {
  Eigen::VectorXd u = f.calibration;
  u.tail(u.size() - static_cast<Eigen::Index>(likelihood.calibration().shared())).setZero();
  return reading_error_v(likelihood, likelihood.raw_residual(f.hypothesis, u));
}

bool alike(const NoiseModel& a, const NoiseModel& b) {
  const auto near = [](double x, double y) {
    return x < thresholds.noise.same_amplitude * y && y < thresholds.noise.same_amplitude * x;
  };
  return std::all_of(amplitudes.begin(), amplitudes.end(),
                     [&](const auto amplitude) { return near(a.*amplitude, b.*amplitude); });
}

double& onset_of(Hypothesis& h) {
  return std::find_if(
             h.settings.begin(), h.settings.end(),
             [](const MechanismSetting& s) { return knowledge_of(s.index).signature == Signature::contact_change; })
      ->value[contact_onset];
}

}  // namespace

double price_of_unknowns(std::size_t mechanism) {
  double unknowns = 0;
  for (std::size_t p = 0; p < catalogue[mechanism].parameters; ++p) {
    const model::Parameter& parameter = catalogue[mechanism].parameter[p];
    unknowns += parameter.role != Role::given && parameter.spread == 0 ? 1 : 0;
  }
  unknowns += knowledge_of(mechanism).searched_unknowns;
  return search_limits.per_unknown * (unknowns - 1);
}

double plain_error_v(const LikelihoodModel& likelihood, const Hypothesis& h) {
  return reading_error_v(likelihood, likelihood.raw_residual(h, likelihood.unchanged()));
}

double fitted_error_v(const LikelihoodModel& likelihood, const HypothesisFit& f) {
  return reading_error_v(likelihood, likelihood.raw_residual(f.hypothesis, f.calibration));
}

double Search::score(const HypothesisFit& f) {
  const auto known = totals_.find(f.cost);
  const double sum =
      known != totals_.end() ? known->second : (totals_[f.cost] = posterior_cost(likelihood_, nominal_, f));
  return sum + price(f.hypothesis) - known_beforehand(likelihood_.facts(), f.hypothesis);
}

void Search::learn_totals(const std::vector<HypothesisFit>& fits) {
  std::vector<double> totals(fits.size());
  numerics::in_parallel(fits.size(), [&](std::size_t k) {
    const auto known = totals_.find(fits[k].cost);
    totals[k] = known != totals_.end() ? known->second : posterior_cost(likelihood_, nominal_, fits[k]);
  });
  for (std::size_t k = 0; k < fits.size(); ++k) totals_[fits[k].cost] = totals[k];
}

HypothesisFit Search::converged(const HypothesisFit& f) {
  HypothesisFit best = best_so_far(fitted_on(likelihood_, nominal_, f));
  likelihood_.set_noise(best.noise);
  return best;
}

HypothesisFit Search::with_own_noise(HypothesisFit f) { return own_noise_fit(likelihood_, nominal_, std::move(f)); }

double Search::gain(const HypothesisFit& less, const HypothesisFit& more) {
  const RecordingFacts& facts = likelihood_.facts();
  return score(less) + known_beforehand(facts, less.hypothesis) - score(more) -
         known_beforehand(facts, more.hypothesis);
}

Search::Start Search::cheapest_start(const Hypothesis& h, const HypothesisFit& around, const Foremost& foremost) const {
  Start best{h, around.calibration};
  if (foremost.fit == nullptr) return best;
  const Eigen::VectorXd& u = foremost.fit->calibration;
  double least = likelihood_.residual(h, around.calibration).squaredNorm() + around.calibration.squaredNorm();
  const auto try_from = [&](const Hypothesis& start) {
    Eigen::VectorXd residual = likelihood_.residual(start, u);
    const double cost = residual.squaredNorm() + u.squaredNorm();
    if (cost < least) {
      least = cost;
      best = {start, u};
    }
    return residual;
  };
  const Eigen::VectorXd effect = foremost.without - try_from(h), taken_over = foremost.without - foremost.fit->residual;
  Hypothesis as_large = h;
  MechanismSetting& s = as_large.settings.back();
  for (std::size_t p = 0; p < catalogue[s.index].parameters; ++p) {
    if (catalogue[s.index].parameter[p].role == Role::strength)
      s.value[p] *= taken_over.dot(effect) / effect.squaredNorm();
  }
  if (std::isfinite(s.value[0])) try_from(as_large);
  return best;
}

HypothesisFit Search::best_so_far(HypothesisFit f) {
  std::vector<std::size_t> key = f.hypothesis.added();
  std::sort(key.begin(), key.end());
  const auto known = best_.find(key);
  if (known != best_.end() && score(known->second) <= score(f)) return known->second;
  return best_[key] = std::move(f);
}

HypothesisFit Search::fit_with(const HypothesisFit& around, const Candidate& c, const Foremost& foremost) {
  // the same mechanisms from another start count only if they are better
  const double hopeless = c.mechanism == foremost.mechanism ? foremost.fit->cost : foremost.cost;
  Hypothesis h = with(around.hypothesis, c.start);
  if (!c.bursts.empty()) h.bursts = c.bursts;
  std::vector<Start> starts = {cheapest_start(h, around, foremost)};
  for (const MechanismSetting& form : c.other_forms)
    starts.push_back({with(around.hypothesis, form), around.calibration});
  if (const auto joint = joint_start(h)) starts.push_back({*joint, around.calibration});
  for (const Eigen::VectorXd& u : far_bases(around)) {
    if (const auto farther = far_start(h, u)) starts.push_back({farther->hypothesis, u});
  }
  std::vector<HypothesisFit> fits(starts.size());
  numerics::in_parallel(starts.size(), [&](std::size_t k) {
    fits[k] = likelihood_.fit(starts[k].hypothesis, starts[k].calibration, numerics.fit.iterations, hopeless);
  });
  HypothesisFit best = *std::min_element(
      fits.begin(), fits.end(), [](const HypothesisFit& x, const HypothesisFit& y) { return x.cost < y.cost; });
  if (knowledge_of(c.mechanism).signature == Signature::contact_change) best = refined_onset(best);
  report(catalogue[c.mechanism].id);
  return best;
}

std::array<Eigen::VectorXd, 2> Search::far_bases(const HypothesisFit& around) const {
  return {around.calibration, likelihood_.unchanged()};
}

std::optional<Hypothesis> Search::joint_start(Hypothesis h) const {
  std::vector<MechanismSetting> added(h.settings.begin() + static_cast<std::ptrdiff_t>(h.own), h.settings.end());
  if (!knowledge_of(added.back().index).joint_start(added, likelihood_.cell())) return std::nullopt;
  std::copy(added.begin(), added.end(), h.settings.begin() + static_cast<std::ptrdiff_t>(h.own));
  return h;
}

std::optional<Search::FarStart> Search::far_start(const Hypothesis& h, const Eigen::VectorXd& u) const {
  const std::vector<std::vector<double>> starts =
      knowledge_of(h.settings.back().index).far_starts(h.settings.back(), likelihood_.facts());
  if (starts.empty()) return std::nullopt;
  const auto at = [&h](const std::vector<double>& start) {
    Hypothesis there = h;
    std::copy(start.begin(), start.end(), there.settings.back().value.begin());
    return there;
  };
  std::vector<double> costs(starts.size() + 1);
  numerics::in_parallel(costs.size(), [&](std::size_t k) {
    costs[k] = likelihood_.residual(k < starts.size() ? at(starts[k]) : h, u).squaredNorm();
  });
  const auto least = std::min_element(costs.begin(), costs.end() - 1);
  if (!(*least < costs.back())) return std::nullopt;
  return FarStart{at(starts[static_cast<std::size_t>(least - costs.begin())]), *least};
}

std::vector<char> Search::far_better(const HypothesisFit& around, const std::vector<Candidate>& candidates) const {
  const auto bases = far_bases(around);
  std::vector<double> without(bases.size());
  numerics::in_parallel(bases.size(), [&](std::size_t b) {
    without[b] = likelihood_.residual(around.hypothesis, bases[b]).squaredNorm();
  });
  std::vector<char> better(candidates.size(), 0);
  numerics::in_parallel(candidates.size(), [&](std::size_t k) {
    const bool promising = candidates[k].gain >= candidate_limits.worth_a_fit;
    // a start that the recording states elsewhere is a reading, which no signature outranks
    const bool stated = candidates[k].mechanism == model::mechanism_index_of<model::InitialSoc> &&
                        likelihood_.facts().start_shift.has_value();
    if (promising && (!stated || k < candidate_limits.fits)) return;  // the best are fitted from far starts as well
    if (!promising && joint_start(with(around.hypothesis, candidates[k].start))) better[k] = 1;
    for (std::size_t b = 0; b < bases.size() && better[k] == 0; ++b) {
      const auto far = far_start(with(around.hypothesis, candidates[k].start), bases[b]);
      if (far && far->cost < without[b] - candidate_limits.worth_a_fit) better[k] = 1;
    }
  });
  return better;
}

HypothesisFit Search::refined_onset(HypothesisFit best) const {
  const PreparedRecording& r = likelihood_.records().front();
  const double margin_s = search_numerics.onset_margin * r.duration_s(),
               least_s = search_numerics.onset_rows * r.duration_s() / static_cast<double>(r.size());
  for (double reach_s = r.duration_s() / search_numerics.onset_reach; reach_s > least_s; reach_s /= 2) {
    const double middle_s = onset_of(best.hypothesis);
    std::array<Hypothesis, search_numerics.onset_steps.size()> moved;
    std::array<Eigen::VectorXd, search_numerics.onset_steps.size()> residuals;
    numerics::in_parallel(moved.size(), [&](std::size_t k) {
      moved[k] = best.hypothesis;
      // a step at either end of the recording is not a step
      onset_of(moved[k]) = std::clamp(middle_s + search_numerics.onset_steps[k] * reach_s, r.time_s.front() + margin_s,
                                      r.time_s.back() - margin_s);
      residuals[k] = likelihood_.residual(moved[k], best.calibration);
    });
    for (std::size_t k = 0; k < moved.size(); ++k) {
      const double cost = residuals[k].squaredNorm() + (best.cost - best.residual.squaredNorm());
      if (!(cost < best.cost)) continue;
      best.cost = cost;
      best.residual = residuals[k];
      best.hypothesis = moved[k];
    }
  }
  return likelihood_.fit(best.hypothesis, best.calibration, numerics.fit.onset_iterations);
}

std::vector<HypothesisFit> Search::one_more(const HypothesisFit& around, const std::vector<std::size_t>& over) {
  // the nominal noise makes every feature significant; that of the current residual, the large effects alone
  std::vector<HypothesisFit> fits;
  std::set<std::size_t> tried;
  for (const NoiseModel& noise : {nominal_, around.noise}) {
    if (stopped() || (!fits.empty() && alike(noise, nominal_))) break;
    likelihood_.set_noise(noise);
    const HypothesisFit from =
        noise == around.noise ? around
                              : likelihood_.fit(around.hypothesis, around.calibration, numerics.fit.refit_iterations);
    const Screen screen(likelihood_, from, over);
    const std::vector<char> far = far_better(from, screen.candidates());
    std::vector<Candidate> worth;
    for (std::size_t k = 0; k < far.size(); ++k) {
      const Candidate& c = screen.candidates()[k];
      const bool promising = c.gain >= candidate_limits.worth_a_fit;
      if (far[k] == 0 && (!promising || worth.size() >= candidate_limits.fits)) continue;
      if (tried.insert(c.mechanism).second || noise != nominal_) worth.push_back(c);
    }
    const std::vector<HypothesisFit> here = fitted(from, worth, {});
    fits.insert(fits.end(), here.begin(), here.end());
  }
  learn_totals(fits);
  for (HypothesisFit& f : fits) f = best_so_far(std::move(f));
  std::stable_sort(fits.begin(), fits.end(),
                   [&](const HypothesisFit& a, const HypothesisFit& b) { return score(a) < score(b); });
  return fits;
}

std::vector<HypothesisFit> Search::in_place_of(const Replacement& r, const std::vector<std::size_t>& over,
                                               std::map<std::size_t, double>& likeness) {
  // rivals must be as good with the noise that the best leaves
  likelihood_.set_noise(r.best.noise);
  const HypothesisFit from =
      likelihood_.fit(r.without.hypothesis, r.without.calibration, numerics.fit.refit_iterations);
  const Screen screen(likelihood_, from, over);
  const std::vector<Candidate>& all = screen.candidates();
  std::vector<Candidate> worth;
  for (std::size_t a = 0; a < all.size(); ++a) {
    if (all[a].mechanism == r.mechanism) {
      for (std::size_t b = 0; b < all.size(); ++b) likeness[all[b].mechanism] = screen.alike(a, b);
    }
    if (worth.size() < candidate_limits.rivals &&
        all[a].gain >= std::max(candidate_limits.worth_a_fit, candidate_limits.rival_share * r.gain))
      worth.push_back(all[a]);
  }
  std::vector<HypothesisFit> rivals =
      fitted(from, worth,
             {r.best.cost + search_limits.hopeless, &r.best, r.mechanism,
              likelihood_.residual(without(r.best.hypothesis, r.mechanism), r.best.calibration)});
  for (HypothesisFit& f : rivals) f = best_so_far(std::move(f));
  return rivals;
}

std::vector<HypothesisFit> Search::replaced(const HypothesisFit& best, std::size_t mechanism,
                                            const std::vector<std::size_t>& by) {
  if (by.empty()) return {};
  likelihood_.set_noise(best.noise);
  const HypothesisFit from =
      likelihood_.fit(without(best.hypothesis, mechanism), best.calibration, numerics.fit.reduced_iterations);
  const Screen screen(likelihood_, from, by);
  std::vector<HypothesisFit> fits =
      fitted(from, screen.candidates(),
             {std::numeric_limits<double>::infinity(), &best, mechanism,
              likelihood_.residual(without(best.hypothesis, mechanism), best.calibration)});
  learn_totals(fits);
  return fits;
}

std::vector<HypothesisFit> Search::fitted(const HypothesisFit& around, const std::vector<Candidate>& candidates,
                                          const Foremost& best) {
  std::vector<HypothesisFit> fits(candidates.size());
  // the fits share a linearisation, as several run at once
  if (!around.hypothesis.added().empty())
    likelihood_.linearise(around.hypothesis, around.calibration);
  else if (!likelihood_.has_linearisation())
    likelihood_.linearise(likelihood_.base(), likelihood_.unchanged());
  numerics::in_parallel(candidates.size(), [&](std::size_t k) {
    if (!stopped()) fits[k] = fit_with(around, candidates[k], best);
  });
  std::erase_if(fits, [](const HypothesisFit& f) { return f.residual.size() == 0; });
  std::stable_sort(fits.begin(), fits.end(),
                   [](const HypothesisFit& a, const HypothesisFit& b) { return a.cost < b.cost; });
  std::size_t foremost = 0;
  while (foremost < std::min(fits.size(), search_numerics.fits_with_own_noise) && fits[foremost].cost < best.cost)
    ++foremost;
  numerics::in_parallel(foremost, [&](std::size_t k) {
    LikelihoodModel own = likelihood_;
    fits[k] = own_noise_fit(own, nominal_, std::move(fits[k]));
    if (best.fit != nullptr) fits[k] = fitted_on(own, nominal_, std::move(fits[k]));  // as the best was
  });
  if (foremost > 0) likelihood_.set_noise(fits[foremost - 1].noise);
  return fits;
}

bool Search::improves_lasting_error(const HypothesisFit& before, const HypothesisFit& f) const {
  if (f.hypothesis.added().size() < 2) return true;
  const double was_v = std::min(lasting_error_v(likelihood_, before), plain_error_v(likelihood_, likelihood_.base()));
  return lasting_error_v(likelihood_, f) <= search_limits.error_may_grow * was_v + search_limits.error_may_grow_v;
}

HypothesisFit Search::without_one(const HypothesisFit& f, std::size_t mechanism) {
  likelihood_.set_noise(f.noise);
  HypothesisFit rest = best_so_far(fitted_without(likelihood_, nominal_, f, mechanism));
  likelihood_.set_noise(rest.noise);
  return rest;
}

std::map<std::size_t, HypothesisFit> Search::without_each(const HypothesisFit& f) {
  const std::vector<std::size_t> added = f.hypothesis.added();
  std::vector<HypothesisFit> fits(added.size());
  likelihood_.set_noise(f.noise);
  likelihood_.linearise(f.hypothesis, f.calibration);
  numerics::in_parallel(added.size(), [&](std::size_t k) {
    LikelihoodModel own = likelihood_;
    fits[k] = fitted_without(own, nominal_, f, added[k]);
  });
  learn_totals(fits);
  std::map<std::size_t, HypothesisFit> by_mechanism;
  for (std::size_t k = 0; k < added.size(); ++k) by_mechanism[added[k]] = best_so_far(std::move(fits[k]));
  return by_mechanism;
}

void Search::report(std::string_view what) {
  const std::lock_guard one_at_a_time(reporting_);
  ++steps_;
  if (progress_)
    progress_(1 - std::exp(-static_cast<double>(steps_) / search_numerics.progress_steps), std::string(what));
}

}  // namespace bms::diagnosis
