#include "diagnosis/diagnose.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include <fmt/format.h>

#include "diagnosis/decision.hpp"
#include "diagnosis/locate.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/residual_test.hpp"
#include "diagnosis/search.hpp"

namespace bms::diagnosis {

namespace {

using model::catalogue;

/// Why nothing at all can be said.
std::optional<std::string> says_nothing(const LikelihoodModel& evidence) {
  const double capacity_ah = evidence.cell().capacity_ah;
  std::size_t moving = 0;
  double duration_s = 0, low_a = 1e9, high_a = -1e9;
  for (const PreparedRecording& r : evidence.records()) {
    duration_s += r.duration_s();
    for (const double a : r.current_a) {
      if (!std::isfinite(a)) continue;
      moving += std::abs(a) > 0.02 * capacity_ah ? 1 : 0;
      low_a = std::min(low_a, a);
      high_a = std::max(high_a, a);
    }
  }
  if (evidence.used() < 50) return fmt::format("there are {} usable voltage readings", evidence.used());
  if (duration_s < 300) return fmt::format("the recording lasts {:.0f} s", duration_s);
  if (moving < 10) return "the cell rests all the time";
  if (high_a - low_a < 0.02 * capacity_ah) return "the current does not change";
  return std::nullopt;
}

/// What is there for certain, before anything that would stand in for it: every cell's resistances follow the
/// temperature, and a file that tells how far charge and discharge lie apart tells that there is a hysteresis.
std::set<std::size_t> expected_in(const LikelihoodModel& evidence) {
  std::set<std::size_t> expected;
  if (away_k(evidence) > decision::far_k) expected.insert(mechanism_index("temperature_resistance"));
  if (evidence.cell().ocv.half_gap_v.size > 0) expected.insert(mechanism_index("ocv_hysteresis"));
  std::erase_if(expected, [&](std::size_t m) { return evidence.base().find(m) != nullptr; });
  return expected;
}

/// One mechanism after the other, as long as chance would not do it; what may come and go as it likes, which gains on
/// anything, after all that may not. singles: what was tried alone.
HypothesisFit grow(Search& search, HypothesisFit current, const std::vector<std::size_t>& testable, std::size_t most,
                   std::vector<HypothesisFit>& singles) {
  std::vector<std::size_t> steady = testable;
  std::erase(steady, mechanism_index("contact_intermittent"));
  bool bursts = false;
  while (current.hypothesis.added().size() < most) {
    std::vector<HypothesisFit> more = search.one_more(current, bursts ? testable : steady);
    if (current.hypothesis.added().empty()) singles.insert(singles.end(), more.begin(), more.end());
    std::erase_if(more, [&](const HypothesisFit& f) { return !search.carries(current, f); });
    const bool gains = !more.empty() && search.gain(current, more.front()) >= decision::detected;
    if (gains)
      current = more.front();
    else if (bursts)
      break;
    bursts = !gains;
  }
  return current;
}

/// What has stood up against everything else.
struct Standing {
  HypothesisFit best;
  std::map<std::size_t, std::vector<HypothesisFit>> rivals;     ///< with another in the place of a mechanism
  std::map<std::size_t, double> gains;                          ///< of each over the rest
  std::map<std::pair<std::size_t, std::size_t>, double> alike;  ///< signatures
};

/// What does not carry is taken away, and each one's rivals are tried in its place.
Standing stand_up(Search& search, const LikelihoodModel& evidence, const HypothesisFit& base, HypothesisFit current,
                  const std::vector<std::size_t>& testable, const std::set<std::size_t>& expected) {
  const double error_v = plain_error_v(evidence, evidence.base());
  Standing found;
  auto& [best, rivals, gains, alike] = found;
  for (int round = 0; round < 6; ++round) {
    bool changed = false;
    rivals.clear();
    gains.clear();
    std::vector<std::pair<double, HypothesisFit>> reduced;
    const std::map<std::size_t, double> sizes_v = contributions(evidence, base, current).rms_v;
    for (const std::size_t m : current.hypothesis.added()) {
      const bool alone = current.hypothesis.added().size() == 1;
      const HypothesisFit less = alone ? base : search.without_one(current, m);
      gains[m] = search.gain(less, current);
      // beside others, one that is hardly seen is none, and so are those that are larger than the error and cancel each
      // other: of these the one goes that is missed less
      const bool seen = sizes_v.at(m) >= decision::noticeable * error_v ||
                        gains[m] >= decision::noticeable_gain * search.gain(base, current);
      const bool counts = alone || (seen && sizes_v.at(m) <= decision::larger_than_error * error_v);
      if (!counts || gains[m] < decision::detected) {
        reduced.emplace_back(gains[m], less);
        continue;
      }
      std::map<std::size_t, double> likeness;
      for (HypothesisFit& rival : search.in_place_of(m, current, less, testable, gains[m], likeness)) {
        if (rival.hypothesis.find(m) != nullptr) {
          if (search.score(rival) < search.score(current) - 1 && search.carries(less, rival))
            current = rival, changed = true;  // the same from another start
          continue;
        }
        if (!search.carries(less, rival)) continue;
        if (search.score(rival) < search.score(current) - 0.5 && !expected.contains(m)) {
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
    if (!gains.contains(m)) gains[m] = search.gain(search.without_one(current, m), current);
  }
  best = std::move(current);
  return found;
}

}  // namespace

const char* name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::no_mismatch:
      return "NO_MISMATCH";
    case Verdict::cause:
      return "CAUSE";
    case Verdict::causes:
      return "CAUSES";
    case Verdict::ambiguous:
      return "AMBIGUOUS";
    case Verdict::unknown:
      return "UNKNOWN";
    case Verdict::data_fault:
      return "DATA_FAULT";
    case Verdict::not_testable:
      return "NOT_TESTABLE";
  }
  return "";
}

std::vector<MechanismSetting> later_recording(const Hypothesis& extended) {
  std::vector<MechanismSetting> later;
  for (MechanismSetting s : extended.settings) {
    if (s.index == mechanism_index("initial_soc") || s.index == mechanism_index("contact_intermittent")) continue;
    if (s.index == mechanism_index("contact_step")) s.value[1] = 0;
    later.push_back(s);
  }
  return later;
}

std::vector<double> predict(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& settings,
                            const PreparedRecording& record, std::vector<double>* soc) {
  const LikelihoodModel evidence(cell, settings, {record}, NoiseModel{});
  return evidence.voltage(evidence.base(), evidence.unchanged(), 0, soc);
}

Diagnosis diagnose(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& own,
                   std::vector<PreparedRecording> records, const Options& options) {
  Diagnosis d;
  d.cell = cell;
  for (PreparedRecording& r : records) {
    RecordingCheck trust = check_recording(r, cell);
    for (DataFault& f : trust.faults) d.faults.push_back(std::move(f));
    for (const std::string& w : trust.warnings) d.warnings.push_back(r.name.empty() ? w : r.name + ": " + w);
  }
  if (!d.faults.empty()) {
    d.verdict = Verdict::data_fault;
    d.statement = d.faults.front().text;
    for (const DataFault& f : d.faults) d.spans.insert(d.spans.end(), f.spans.begin(), f.spans.end());
    return d;
  }

  LikelihoodModel evidence = likelihood_model_of(cell, own, std::move(records));
  const NoiseModel nominal = evidence.noise();  // before any hypothesis

  std::vector<std::size_t> testable;
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const auto reason = not_testable(evidence, evidence.base(), m);
    if (reason) d.not_testable.push_back({m, *reason});
    if (evidence.base().find(m) == nullptr) testable.push_back(m);  // the screen asks again, beside what has been found
  }
  if (const auto why = says_nothing(evidence)) {
    d.verdict = Verdict::not_testable;
    d.statement = "Nothing can be said: " + *why + ".";
    d.not_testable.clear();
    for (std::size_t m = 0; m < model::mechanism_count; ++m) d.not_testable.push_back({m, *why});
    return d;
  }

  Search search(evidence, options.progress);
  HypothesisFit base = search.settled(evidence.fit(evidence.base()));
  search.tell("calibration");

  const std::set<std::size_t> expected = expected_in(evidence);
  std::vector<HypothesisFit> singles;
  HypothesisFit grown = base;
  for (const std::size_t m : expected) {
    const std::vector<HypothesisFit> with_it = search.one_more(grown, {m});
    if (!with_it.empty() && search.gain(grown, with_it.front()) > decision::detected) grown = with_it.front();
  }
  grown = grow(search, std::move(grown), testable, options.most_mechanisms, singles);
  {
    // the first screen tells the limits
    evidence.set_noise(nominal);
    const Screen screen(evidence, base, testable);
    for (const Candidate& c : screen.candidates()) {
      if (c.limit > 0) d.limits.push_back({c.mechanism, 0, c.limit});
    }
  }

  search.tell("noise");

  auto [current, rivals, gains, alike] = stand_up(search, evidence, base, std::move(grown), testable, expected);

  // is it enough?
  evidence.set_noise(nominal);
  const HypothesisFit base_nominal = evidence.fit(base.hypothesis, base.calibration, 6);
  HypothesisFit best_nominal = evidence.fit(current.hypothesis, current.calibration, 6);
  Remainder remainder = test_residual(evidence, best_nominal);
  const auto adequacy = [&] {
    const double gained = std::max(base_nominal.cost - best_nominal.cost, 0.0);
    return gained + remainder.gain > 0 ? gained / (gained + remainder.gain) : 1;
  };
  // what explains little, and that not quite, is none
  if (!current.hypothesis.added().empty() && base_nominal.cost - best_nominal.cost < decision::faint &&
      adequacy() < decision::explained) {
    current = base;
    best_nominal = base_nominal;
    remainder = test_residual(evidence, best_nominal);
    gains.clear();
    rivals.clear();
  }
  evidence.set_noise(current.noise);
  d.base_cost = base_nominal.cost;
  d.best_cost = best_nominal.cost;
  d.remaining = remainder.gain;
  d.remaining_goes_with = remainder.family;
  d.fast_excess = remainder.fast_excess;
  d.far_out = remainder.far_out;
  d.adequacy = adequacy();
  const bool something = !current.hypothesis.added().empty();
  // what is flexible gains on anything: when it is named, what it leaves must be white
  const bool bursts = current.hypothesis.find(mechanism_index("contact_intermittent")) != nullptr;
  const bool unknown = (d.remaining > decision::much_left || d.far_out > decision::far_out) &&
                       (!something || d.adequacy < (bursts ? decision::explained_by_bursts : decision::explained) ||
                        d.fast_excess > decision::fast_excess);

  // findings
  d.extended = current.hypothesis;
  d.covariance = current.covariance;
  d.noise = nominal;
  const Contributions parts = contributions(evidence, base, current);
  d.explained_share = parts.explained_share;
  d.unexplained_rmse_v = parts.remaining_rmse_v;
  d.unexplained_share = 1 - parts.explained_share;
  d.noise_floor_v =
      std::sqrt(nominal.white_v * nominal.white_v + nominal.fast_v * nominal.fast_v + nominal.slow_v * nominal.slow_v);
  std::vector<std::vector<std::size_t>> sets;
  for (const std::size_t m : current.hypothesis.added()) {
    Finding f;
    f.setting = *current.hypothesis.find(m);
    f.gain = gains[m];
    f.at_bound.assign(catalogue[m].parameters, 0);
    const std::vector<ParameterRef> sought = current.hypothesis.sought();
    for (std::size_t j = 0; j < sought.size(); ++j) {
      if (current.hypothesis.settings[sought[j].setting].index == m)
        f.at_bound[sought[j].parameter] = current.at_bound[j];
    }
    double sum = 1;
    struct Near {
      double behind;
      std::size_t mechanism;
      const HypothesisFit* fit;
    };
    std::vector<Near> near;
    for (const HypothesisFit& rival : rivals[m]) {
      const double behind = search.score(rival) - search.score(current);
      std::size_t other = m;
      for (const std::size_t a : rival.hypothesis.added()) {
        if (current.hypothesis.find(a) == nullptr) other = a;
      }
      sum += std::exp(-behind / (2 * decision::temper));
      // what goes through the same few numbers of a recording differs by how well its equation fits, not by what was
      // seen
      if (behind < decision::same || (alike[{m, other}] > decision::inseparable && behind < decision::same_inseparable))
        near.push_back({behind, other, &rival});
    }
    std::sort(near.begin(), near.end(), [](const Near& a, const Near& b) {
      return std::pair(a.behind, a.mechanism) < std::pair(b.behind, b.mechanism);
    });
    for (const Near& n : near) {
      if (std::find(f.equivalent_to.begin(), f.equivalent_to.end(), n.mechanism) != f.equivalent_to.end()) continue;
      f.equivalent_to.push_back(n.mechanism);
      f.rivals.push_back({n.fit->hypothesis, n.fit->covariance});
    }
    f.probability = decision::surely / sum;
    f.rms_contribution_v = parts.rms_v.contains(m) ? parts.rms_v.at(m) : 0;
    d.findings.push_back(std::move(f));
  }
  std::stable_sort(d.findings.begin(), d.findings.end(),
                   [](const Finding& a, const Finding& b) { return a.gain > b.gain; });

  const auto rank = [&](const HypothesisFit& f) {
    for (const Ranked& r : d.candidates) {
      if (r.ids == f.hypothesis.added()) return;  // the same from another start
    }
    Ranked r{f.hypothesis.added(), 0, search.score(base) - search.score(f), 0};
    r.explained_share = contributions(evidence, base, f).explained_share;
    d.candidates.push_back(r);
  };
  if (something) {
    rank(current);
    for (auto& [m, fits] : rivals) {
      std::stable_sort(fits.begin(), fits.end(), [&](const HypothesisFit& a, const HypothesisFit& b) {
        return search.score(a) < search.score(b);
      });
      for (const HypothesisFit& f : fits) rank(f);
    }
  } else {
    for (const HypothesisFit& f : singles) rank(f);
  }
  std::stable_sort(d.candidates.begin(), d.candidates.end(),
                   [](const Ranked& a, const Ranked& b) { return a.gain > b.gain; });
  double total = something ? 0 : 1;
  for (const Ranked& r : d.candidates)
    total += std::exp((r.gain - (something ? d.candidates.front().gain : decision::detected)) / (2 * decision::temper));
  for (Ranked& r : d.candidates)
    r.probability =
        decision::surely *
        std::exp((r.gain - (something ? d.candidates.front().gain : decision::detected)) / (2 * decision::temper)) /
        total;

  d.spans = unknown || !something ? remainder.spans : parts.spans;
  d.regimes = regimes(evidence, current, unknown || !something ? remainder.energy : parts.energy);
  for (std::size_t r = 0; r < evidence.records().size(); ++r) {
    RecordingView view;
    view.base_v = evidence.voltage(evidence.base(), evidence.unchanged(), r);
    view.extended_v = evidence.voltage(current.hypothesis, current.calibration, r, &view.soc);
    d.views.push_back(std::move(view));
  }

  if (unknown)
    d.verdict = Verdict::unknown;
  else if (!something)
    d.verdict = Verdict::no_mismatch;
  else if (d.findings.size() > 1)
    d.verdict = Verdict::causes;
  else
    d.verdict = d.findings.front().equivalent_to.empty() ? Verdict::cause : Verdict::ambiguous;
  if (d.verdict == Verdict::no_mismatch) d.spans.clear(), d.regimes.clear(), d.unexplained_share = 0;
  if (names(d.verdict))
    d.cell = evidence.calibration().applied(
        cell, {current.calibration.data(), current.calibration.data() + current.calibration.size()});
  if (options.progress) options.progress(1, "done");
  return d;
}

}  // namespace bms::diagnosis
