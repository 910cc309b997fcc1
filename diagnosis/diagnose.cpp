#include "diagnosis/diagnose.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "diagnosis/decision.hpp"
#include "diagnosis/locate.hpp"
#include "diagnosis/quiet_current.hpp"
#include "diagnosis/remainder.hpp"

namespace bms::diagnosis {

namespace {

using model::catalogue;
using model::Role;

constexpr std::size_t index_of(std::string_view id) { return model::mechanism_index(id); }

/// No model is better from sample to sample than this share of what its OCV is good to.
constexpr double least_white = 0.2;

constexpr std::size_t temperature_resistance = index_of("temperature_resistance");

/// What its unknowns cost a mechanism.
double price(std::size_t mechanism, std::size_t bursts) {
  double unknowns = 0;
  for (std::size_t p = 0; p < catalogue[mechanism].parameters; ++p) unknowns += catalogue[mechanism].parameter[p].role != Role::given ? 1 : 0;
  if (catalogue[mechanism].id == "contact_step") unknowns += 4;  // its moment was sought too
  return decision::per_unknown * (unknowns - 1) + decision::per_burst * static_cast<double>(bursts);
}

double price(const Hypothesis& h) {
  double sum = 0;
  std::size_t bursts = 0;
  for (const auto& spans : h.bursts) bursts += spans.size();
  for (const std::size_t m : h.added()) sum += price(m, m == index_of("contact_intermittent") ? bursts : 0);
  return sum;
}

/// How far the cell was from the temperature that its file is for.
double away_k(const Evidence& evidence) {
  double away = 0;
  for (const Record& r : evidence.records()) {
    for (const double c : r.temperature_c) {
      if (std::isfinite(c)) away = std::max(away, std::abs(c - 25));
    }
  }
  return away;
}

/// What speaks for a mechanism before any voltage is looked at: a cell far from its file's temperature has other resistances.
double known_before(const Evidence& evidence, const Hypothesis& h) {
  if (h.find(temperature_resistance) == nullptr || h.own > 0) return 0;
  return std::clamp((away_k(evidence) - 5) * 1.5, 0.0, 15.0);
}

/// RMS of a raw residual, of the voltages that were read.
double reading_error_v(const Evidence& evidence, const Columns& raw) {
  return std::sqrt(raw.topRows(static_cast<Eigen::Index>(evidence.readings())).squaredNorm() / static_cast<double>(std::max<std::size_t>(evidence.used(), 1)));
}

/// RMS of measured less predicted by a hypothesis with the cell file's own base parameters: what an extended cell file will do.
double plain_error_v(const Evidence& evidence, const Hypothesis& h) {
  return reading_error_v(evidence, evidence.raw_residual(h, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(evidence.calibration().size()))));
}

/// With the base parameters where the fit has them, but for those that belong to a single recording.
double lasting_error_v(const Evidence& evidence, const Fit& f) {
  Eigen::VectorXd u = f.calibration;
  u.tail(u.size() - static_cast<Eigen::Index>(evidence.calibration().shared())).setZero();
  return reading_error_v(evidence, evidence.raw_residual(f.hypothesis, u));
}

class Chain {
 public:
  Chain(Evidence& evidence, const Options& options) : evidence_(evidence), options_(options), nominal_(evidence.noise()) {}

  /// -2 log posterior with the noise that the residual speaks of, at its price.
  double total(const Fit& f) const {
    double cost = 0;
    evidence_.likeliest_noise(evidence_.raw_residual(f.hypothesis, f.calibration), nominal_, cost);
    return cost + f.cost - f.residual.squaredNorm();
  }
  double score(const Fit& f) {
    const auto known = totals_.find(f.cost);
    const double sum = known != totals_.end() ? known->second : (totals_[f.cost] = total(f));
    return sum + price(f.hypothesis) - known_before(evidence_, f.hypothesis);
  }

  /// Fitted again under the noise that its own residual speaks of.
  Fit settled(Fit f) {
    for (int round = 0; round < 2; ++round) {
      double cost = 0;
      const NoiseModel noise = evidence_.likeliest_noise(evidence_.raw_residual(f.hypothesis, f.calibration), nominal_, cost);
      if (noise == f.noise) break;
      evidence_.set_noise(noise);
      f = evidence_.fit(f.hypothesis, f.calibration, 5);
    }
    return f;
  }

  /// What a hypothesis gains over a smaller one, whatever was known before.
  double gain(const Fit& less, const Fit& more) {
    return score(less) + known_before(evidence_, less.hypothesis) - score(more) - known_before(evidence_, more.hypothesis);
  }

  /// A candidate added to what is there and fitted from its estimate; shapes far apart are tried from two sides.
  Fit fit_with(const Fit& around, const Candidate& c, double hopeless) {
    Hypothesis h = with(around.hypothesis, c.start);
    if (!c.bursts.empty()) h.bursts = c.bursts;
    Fit best = evidence_.fit(h, around.calibration, usual_iterations, hopeless);
    if (const auto farther = far_start(h, around.calibration)) {
      Fit other = evidence_.fit(*farther, around.calibration, usual_iterations, hopeless);
      if (other.cost < best.cost) best = std::move(other);
    }
    if (catalogue[c.mechanism].id == "contact_step") best = refined_onset(best);
    tell(catalogue[c.mechanism].id);
    return best;
  }

  /// Where a knee of the OCV is passed, an effect on the charge is not linear: the best of some strengths far from the estimate.
  std::optional<Hypothesis> far_start(Hypothesis h, const Eigen::VectorXd& u) {
    MechanismSetting& s = h.settings.back();
    const std::string_view id = catalogue[s.index].id;
    std::vector<std::vector<double>> tries;
    if (id == "capacity_change") tries = {{-0.1}, {0.04}, {0.08}, {0.14}, {0.2}, {0.28}};
    else if (id == "current_gain") tries = {{-0.12}, {-0.06}, {0.06}, {0.12}};
    else if (id == "initial_soc") tries = {{-0.15}, {-0.08}, {-0.04}, {0.04}, {0.08}, {0.15}};
    else if (id == "ocv_shape") tries = {{-0.06, -0.06}, {-0.03, -0.03}, {0.03, 0.03}, {0.06, 0.06}, {0.06, -0.06}, {-0.06, 0.06}};
    if (tries.empty()) return std::nullopt;
    const std::vector<double> near(s.value.begin(), s.value.end());
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

  /// The moment of a contact's step, to the sample.
  Fit refined_onset(Fit best) {
    const Record& r = evidence_.records().front();
    const auto setting = [](Fit& f) -> MechanismSetting& { return *std::find_if(f.hypothesis.settings.begin(), f.hypothesis.settings.end(), [](const MechanismSetting& s) { return s.index == index_of("contact_step"); }); };
    double reach_s = r.duration_s() / 40;
    Eigen::VectorXd residual;
    while (reach_s > 1.5 * r.duration_s() / static_cast<double>(r.size())) {
      const double middle_s = setting(best).value[1];
      for (const double step : {-1.0, -0.5, 0.5, 1.0}) {
        Hypothesis h = best.hypothesis;
        for (MechanismSetting& s : h.settings) {
          // a step at either end is no step
          if (s.index == index_of("contact_step")) s.value[1] = std::clamp(middle_s + step * reach_s, r.time_s.front() + 0.04 * r.duration_s(), r.time_s.back() - 0.04 * r.duration_s());
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

  static bool alike(const NoiseModel& a, const NoiseModel& b) {
    const auto near = [](double x, double y) { return x < 1.25 * y && y < 1.25 * x; };
    return near(a.white_v, b.white_v) && near(a.fast_v, b.fast_v) && near(a.slow_v, b.slow_v) && near(a.edge, b.edge);
  }

  /// The best of adding one mechanism to what is there.
  std::vector<Fit> one_more(const Fit& around, const std::vector<std::size_t>& over) {
    // by the nominal noise, which asks for everything to be explained, and by that of what is left, which asks for the large first
    std::vector<Fit> fits;
    std::set<std::size_t> tried;
    for (const NoiseModel& noise : {nominal_, around.noise}) {
      if (!fits.empty() && alike(noise, nominal_)) break;
      evidence_.set_noise(noise);
      const Fit from = noise == around.noise ? around : evidence_.fit(around.hypothesis, around.calibration, 5);
      const Screen screen(evidence_, from, over);
      std::vector<Candidate> worth;
      for (const Candidate& c : screen.candidates()) {
        if (worth.size() >= decision::most_fits || c.gain < decision::worth_a_fit) break;
        if (tried.insert(c.mechanism).second || noise != nominal_) worth.push_back(c);
      }
      const std::vector<Fit> here = fitted(from, worth, std::numeric_limits<double>::infinity());
      fits.insert(fits.end(), here.begin(), here.end());
    }
    std::stable_sort(fits.begin(), fits.end(), [&](const Fit& a, const Fit& b) { return score(a) < score(b); });
    return fits;
  }

  /// What could stand in the place of mechanism m of the best hypothesis, and m itself from another start; less: without m.
  /// likeness: of each to m.
  std::vector<Fit> in_place_of(std::size_t m, const Fit& best, const Fit& less, const std::vector<std::size_t>& over, double gain_of_m, std::map<std::size_t, double>& likeness) {
    // they must stand up to the noise that the best leaves
    evidence_.set_noise(best.noise);
    const Fit from = evidence_.fit(less.hypothesis, less.calibration, 5);
    const Screen screen(evidence_, from, over);
    const auto& all = screen.candidates();
    std::vector<Candidate> worth;
    for (std::size_t a = 0; a < all.size(); ++a) {
      if (all[a].mechanism == m) {
        for (std::size_t b = 0; b < all.size(); ++b) likeness[all[b].mechanism] = screen.alike(a, b);
      }
      if (worth.size() < decision::most_rivals && all[a].gain >= std::max(decision::worth_a_fit, 0.1 * gain_of_m)) worth.push_back(all[a]);
    }
    return fitted(from, worth, best.cost + decision::hopeless);
  }

  /// The candidates fitted; the foremost again with the noise that they leave, which is smaller when much has been explained.
  std::vector<Fit> fitted(const Fit& around, const std::vector<Candidate>& candidates, double hopeless) {
    std::vector<Fit> fits;
    if (!around.hypothesis.added().empty()) evidence_.linearise(around.hypothesis, around.calibration);
    for (const Candidate& c : candidates) {
      fits.push_back(fit_with(around, c, hopeless));
    }
    std::stable_sort(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) { return a.cost < b.cost; });
    for (std::size_t k = 0; k < fits.size() && k < 3; ++k) {
      if (fits[k].cost < hopeless) fits[k] = settled(fits[k]);
    }
    return fits;
  }

  /// Whether a cell file with it would do as well as with what was there: what only helps together with the start and the wander that
  /// this recording needed is no cause. A first one may: of two that hide each other, one alone makes it worse.
  bool carries(const Fit& before, const Fit& f) const {
    if (f.hypothesis.added().size() < 2) return true;
    const double was_v = std::min(lasting_error_v(evidence_, before), plain_error_v(evidence_, evidence_.base()));
    return lasting_error_v(evidence_, f) <= decision::may_grow * was_v + 3e-4;
  }

  /// The rest of a fit, fitted again from where it was.
  Fit without_one(const Fit& f, std::size_t m) {
    evidence_.set_noise(f.noise);
    return settled(evidence_.fit(without(f.hypothesis, m), f.calibration, 8));
  }

  void tell(std::string_view what) {
    ++steps_;
    if (options_.progress) options_.progress(1 - std::exp(-static_cast<double>(steps_) / 20), std::string(what));
  }

 private:
  Evidence& evidence_;
  const Options& options_;
  NoiseModel nominal_;
  static constexpr int usual_iterations = 12;
  std::map<double, double> totals_;  ///< by the fit's cost, which no two different fits share
  int steps_ = 0;
};

}  // namespace

const char* name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::no_mismatch: return "NO_MISMATCH";
    case Verdict::cause: return "CAUSE";
    case Verdict::causes: return "CAUSES";
    case Verdict::ambiguous: return "AMBIGUOUS";
    case Verdict::unknown: return "UNKNOWN";
    case Verdict::data_fault: return "DATA_FAULT";
    case Verdict::not_testable: return "NOT_TESTABLE";
  }
  return "";
}

std::vector<MechanismSetting> later_recording(const Hypothesis& extended) {
  std::vector<MechanismSetting> later;
  for (MechanismSetting s : extended.settings) {
    if (s.index == index_of("initial_soc") || s.index == index_of("contact_intermittent")) continue;
    if (s.index == index_of("contact_step")) s.value[1] = 0;
    later.push_back(s);
  }
  return later;
}

std::vector<double> predict(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& settings, const Record& record, std::vector<double>* soc) {
  const Evidence evidence(cell, settings, {record}, NoiseModel{});
  return evidence.voltage(evidence.base(), Eigen::VectorXd::Zero(static_cast<Eigen::Index>(evidence.calibration().size())), 0, soc);
}

Diagnosis diagnose(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& own, std::vector<Record> records, const Options& options) {
  Diagnosis d;
  d.cell = cell;
  for (Record& r : records) {
    Trust trust = examine(r, cell);
    for (DataFault& f : trust.faults) d.faults.push_back(std::move(f));
    for (const std::string& w : trust.warnings) d.warnings.push_back(r.name.empty() ? w : r.name + ": " + w);
  }
  if (!d.faults.empty()) {
    d.verdict = Verdict::data_fault;
    d.statement = d.faults.front().text;
    for (const DataFault& f : d.faults) d.spans.insert(d.spans.end(), f.spans.begin(), f.spans.end());
    return d;
  }

  // noise before any hypothesis
  std::vector<double> white;
  for (const Record& r : records) white.push_back(white_noise(r.voltage_v, r.current_a, 0.01 * cell.capacity_ah, cell.noise.voltage_v));
  NoiseModel noise;
  noise.white_v = std::max(*std::max_element(white.begin(), white.end()), least_white * cell.tolerance.ocv_v);
  noise.fast_v = std::max(cell.tolerance.ocv_v, 5e-4);
  noise.slow_v = 1.3 * std::max(cell.tolerance.drift_v, 5e-4);
  for (Record& r : records) r.current_a = quiet_current(r.current_a, std::min(current_noise(r.current_a), 1.5 * cell.noise.current_a));
  Evidence evidence(cell, own, std::move(records), noise);

  std::vector<std::size_t> testable;
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const auto reason = not_testable(evidence, evidence.base(), m);
    if (reason) d.not_testable.push_back({m, *reason});
    if (evidence.base().find(m) == nullptr) testable.push_back(m);  // the screen asks again, beside what has been found
  }
  std::size_t moving = 0;
  double duration_s = 0;
  for (const Record& r : evidence.records()) {
    duration_s += r.duration_s();
    for (const double a : r.current_a) moving += std::isfinite(a) && std::abs(a) > 0.02 * cell.capacity_ah ? 1 : 0;
  }
  const auto cannot = [&](std::string why) {
    d.verdict = Verdict::not_testable;
    d.statement = "Nothing can be said: " + std::move(why) + ".";
    d.not_testable.clear();
    for (std::size_t m = 0; m < model::mechanism_count; ++m) d.not_testable.push_back({m, d.statement.substr(23, d.statement.size() - 24)});
    return d;
  };
  if (evidence.used() < 50) return cannot(fmt::format("there are {} usable voltage readings", evidence.used()));
  if (duration_s < 300) return cannot(fmt::format("the recording lasts {:.0f} s", duration_s));
  if (moving < 10) return cannot("the cell rests all the time");
  double low_a = 1e9, high_a = -1e9;
  for (const Record& r : evidence.records()) {
    for (const double a : r.current_a) {
      if (std::isfinite(a)) low_a = std::min(low_a, a), high_a = std::max(high_a, a);
    }
  }
  if (high_a - low_a < 0.02 * cell.capacity_ah) return cannot("the current does not change");

  Chain chain(evidence, options);
  Fit base = chain.settled(evidence.fit(evidence.base()));
  chain.tell("calibration");

  // one mechanism after the other, as long as chance would not do it
  std::vector<Fit> singles;
  Fit current = base;
  const auto grow = [&] {
    while (current.hypothesis.added().size() < options.most_mechanisms) {
      std::vector<Fit> more = chain.one_more(current, testable);
      if (current.hypothesis.added().empty()) singles = more;
      std::erase_if(more, [&](const Fit& f) { return !chain.carries(current, f); });
      if (more.empty() || chain.gain(current, more.front()) < decision::detected) break;
      current = more.front();
    }
  };
  // what is there for certain comes before anything that would stand in for it: every cell's resistances follow the temperature, and a
  // file that tells how far charge and discharge lie apart tells that there is a hysteresis
  std::set<std::size_t> expected;
  if (away_k(evidence) > decision::far_k) expected.insert(temperature_resistance);
  if (cell.ocv.half_gap_v.size > 0) expected.insert(index_of("ocv_hysteresis"));
  std::erase_if(expected, [&](std::size_t m) { return evidence.base().find(m) != nullptr; });
  for (const std::size_t m : expected) {
    const std::vector<Fit> with_it = chain.one_more(current, {m});
    if (!with_it.empty() && chain.gain(current, with_it.front()) > decision::detected) current = with_it.front();
  }
  grow();
  {
    // the first screen tells the limits
    evidence.set_noise(noise);
    const Screen screen(evidence, base, testable);
    for (const Candidate& c : screen.candidates()) {
      if (c.limit > 0) d.limits.push_back({c.mechanism, 0, c.limit});
    }
  }

  const NoiseModel nominal = noise;
  chain.tell("noise");

  // take away what does not carry, try each one's rivals
  const double error_v = plain_error_v(evidence, evidence.base());
  std::map<std::size_t, std::vector<Fit>> rivals;
  std::map<std::size_t, double> gains;
  std::map<std::pair<std::size_t, std::size_t>, double> alike;
  for (int round = 0; round < 6; ++round) {
    bool changed = false;
    rivals.clear();
    gains.clear();
    std::vector<std::pair<double, Fit>> reduced;
    // causes that are larger than the error and cancel each other are none
    const std::map<std::size_t, double> sizes_v = contributions(evidence, base, current).rms_v;
    for (const std::size_t m : current.hypothesis.added()) {
      const Fit less = current.hypothesis.added().size() == 1 ? base : chain.without_one(current, m);
      gains[m] = chain.gain(less, current);
      const bool one_of_several = current.hypothesis.added().size() > 1;
      const bool cancels = one_of_several && sizes_v.at(m) > decision::larger_than_error * error_v;
      if (one_of_several && sizes_v.at(m) < decision::noticeable * error_v) gains[m] = std::min(gains[m], decision::detected - 1);
      if (cancels) gains[m] = std::min(gains[m], decision::detected - sizes_v.at(m) / error_v);
      if (gains[m] < decision::detected) {
        reduced.emplace_back(gains[m], less);
        continue;
      }
      std::map<std::size_t, double> likeness;
      for (Fit& rival : chain.in_place_of(m, current, less, testable, gains[m], likeness)) {
        if (rival.hypothesis.find(m) != nullptr) {
          if (chain.score(rival) < chain.score(current) - 1 && chain.carries(less, rival)) current = rival, changed = true;  // the same from another start
          continue;
        }
        if (!chain.carries(less, rival)) continue;
        if (chain.score(rival) < chain.score(current) - 0.5 && !expected.contains(m)) {
          current = rival;
          changed = true;
        }
        rivals[m].push_back(std::move(rival));
      }
      for (const auto& [other, value] : likeness) alike[{m, other}] = value;
      if (changed) break;
    }
    if (!changed && !reduced.empty()) {
      std::sort(reduced.begin(), reduced.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
      current = reduced.front().second;
      changed = true;
    }
    if (!changed) break;
  }

  for (const std::size_t m : current.hypothesis.added()) {
    if (!gains.contains(m)) gains[m] = chain.gain(chain.without_one(current, m), current);
  }

  // is it enough?
  evidence.set_noise(nominal);
  const Fit base_nominal = evidence.fit(base.hypothesis, base.calibration, 6), best_nominal = evidence.fit(current.hypothesis, current.calibration, 6);
  const Remainder remainder = what_remains(evidence, best_nominal);
  evidence.set_noise(current.noise);
  d.base_cost = base_nominal.cost;
  d.best_cost = best_nominal.cost;
  const double gained = base_nominal.cost - best_nominal.cost;
  d.remaining = remainder.gain;
  d.remaining_goes_with = remainder.family;
  d.fast_excess = remainder.fast_excess;
  d.far_out = remainder.far_out;
  d.adequacy = gained + d.remaining > 0 ? std::max(gained, 0.0) / (std::max(gained, 0.0) + d.remaining) : 1;
  const bool something = !current.hypothesis.added().empty();
  // what is flexible gains on anything: when it is named, what it leaves must be white
  const bool bursts = current.hypothesis.find(index_of("contact_intermittent")) != nullptr;
  const bool unknown = (d.remaining > decision::much_left || d.far_out > decision::far_out) &&
                       (!something || d.adequacy < (bursts ? decision::explained_by_bursts : decision::explained) || d.fast_excess > decision::fast_excess);

  // findings
  d.extended = current.hypothesis;
  d.covariance = current.covariance;
  d.noise = nominal;
  const Contributions parts = contributions(evidence, base, current);
  d.explained_share = parts.explained_share;
  d.unexplained_rmse_v = parts.remaining_rmse_v;
  d.unexplained_share = 1 - parts.explained_share;
  d.noise_floor_v = std::sqrt(nominal.white_v * nominal.white_v + nominal.fast_v * nominal.fast_v + nominal.slow_v * nominal.slow_v);
  std::vector<std::vector<std::size_t>> sets;
  for (const std::size_t m : current.hypothesis.added()) {
    Finding f;
    f.setting = *current.hypothesis.find(m);
    f.gain = gains[m];
    f.at_bound.assign(catalogue[m].parameters, 0);
    const std::vector<Sought> sought = current.hypothesis.sought();
    for (std::size_t j = 0; j < sought.size(); ++j) {
      if (current.hypothesis.settings[sought[j].setting].index == m) f.at_bound[sought[j].parameter] = current.at_bound[j];
    }
    double sum = 1;
    struct Near {
      double behind;
      std::size_t mechanism;
      const Fit* fit;
    };
    std::vector<Near> near;
    for (const Fit& rival : rivals[m]) {
      const double behind = chain.score(rival) - chain.score(current);
      std::size_t other = m;
      for (const std::size_t a : rival.hypothesis.added()) {
        if (current.hypothesis.find(a) == nullptr) other = a;
      }
      sum += std::exp(-behind / (2 * decision::temper));
      // what goes through the same few numbers of a recording differs by how well its equation fits, not by what was seen
      if (behind < decision::same || (alike[{m, other}] > decision::inseparable && behind < decision::same_inseparable)) near.push_back({behind, other, &rival});
    }
    std::sort(near.begin(), near.end(), [](const Near& a, const Near& b) { return std::pair(a.behind, a.mechanism) < std::pair(b.behind, b.mechanism); });
    for (const Near& n : near) {
      if (std::find(f.equivalent_to.begin(), f.equivalent_to.end(), n.mechanism) != f.equivalent_to.end()) continue;
      f.equivalent_to.push_back(n.mechanism);
      f.rivals.push_back({n.fit->hypothesis, n.fit->covariance});
    }
    f.probability = decision::surely / sum;
    f.rms_contribution_v = parts.rms_v.contains(m) ? parts.rms_v.at(m) : 0;
    d.findings.push_back(std::move(f));
  }
  std::stable_sort(d.findings.begin(), d.findings.end(), [](const Finding& a, const Finding& b) { return a.gain > b.gain; });

  const auto rank = [&](const Fit& f) {
    for (const Ranked& r : d.candidates) {
      if (r.ids == f.hypothesis.added()) return;  // the same from another start
    }
    Ranked r{f.hypothesis.added(), 0, chain.score(base) - chain.score(f), 0};
    r.explained_share = contributions(evidence, base, f).explained_share;
    d.candidates.push_back(r);
  };
  if (something) {
    rank(current);
    for (auto& [m, fits] : rivals) {
      std::stable_sort(fits.begin(), fits.end(), [&](const Fit& a, const Fit& b) { return chain.score(a) < chain.score(b); });
      for (const Fit& f : fits) rank(f);
    }
  } else {
    for (const Fit& f : singles) rank(f);
  }
  std::stable_sort(d.candidates.begin(), d.candidates.end(), [](const Ranked& a, const Ranked& b) { return a.gain > b.gain; });
  double total = something ? 0 : 1;
  for (const Ranked& r : d.candidates) total += std::exp((r.gain - (something ? d.candidates.front().gain : decision::detected)) / (2 * decision::temper));
  for (Ranked& r : d.candidates) r.probability = decision::surely * std::exp((r.gain - (something ? d.candidates.front().gain : decision::detected)) / (2 * decision::temper)) / total;

  d.spans = unknown || !something ? remainder.spans : parts.spans;
  d.regimes = regimes(evidence, current, unknown || !something ? remainder.energy : parts.energy);
  for (std::size_t r = 0; r < evidence.records().size(); ++r) {
    RecordView view;
    view.base_v = evidence.voltage(evidence.base(), Eigen::VectorXd::Zero(base.calibration.size()), r);
    view.extended_v = evidence.voltage(current.hypothesis, current.calibration, r, &view.soc);
    d.views.push_back(std::move(view));
  }

  if (unknown) d.verdict = Verdict::unknown;
  else if (!something) d.verdict = Verdict::no_mismatch;
  else if (d.findings.size() > 1) d.verdict = Verdict::causes;
  else d.verdict = d.findings.front().equivalent_to.empty() ? Verdict::cause : Verdict::ambiguous;
  if (d.verdict == Verdict::no_mismatch) d.spans.clear(), d.regimes.clear(), d.unexplained_share = 0;
  if (names(d.verdict)) d.cell = evidence.calibration().applied(cell, {current.calibration.data(), current.calibration.data() + current.calibration.size()});
  if (options.progress) options.progress(1, "done");
  return d;
}

}  // namespace bms::diagnosis
