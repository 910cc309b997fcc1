#include "benchmark/score.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "benchmark/cause_ids.hpp"
#include "measurement/statistics.hpp"
#include "numerics/calibration_error.hpp"

namespace bms::benchmark {

namespace {

using diagnosis::Verdict;
using truth::CaseKind;

/// Effects at this strength [detection limits] and above count as detectable.
constexpr double detectable = 2;

/// Hold-out error, in noise floors, up to which a prediction counts as good; or the part of the error above the floor
/// that may remain.
constexpr double good_holdout_floors = 1.3, good_holdout_part = 0.1;

/// Returns true if the verdict names causes.
bool named(const Outcome& o) {
  return !o.found.empty() &&
         (o.verdict == Verdict::cause || o.verdict == Verdict::causes || o.verdict == Verdict::ambiguous);
}

/// Returns true if finding k is the effect `id`, is of its class, or cannot be distinguished from it.
bool finds(const Outcome& o, std::size_t k, const std::string& id) {
  return contains(o.sets[k], id) || class_of(o.found[k]) == class_of(id);
}

void count_holdout(const Outcome& o, Share& share) {
  if (o.holdout_before_v <= 0 || !o.answer.repeats_in_holdout) return;
  const double floor = o.holdout_floor_v;
  const double before = std::max(0.0, o.holdout_before_v * o.holdout_before_v - floor * floor);
  const double after = std::max(0.0, o.holdout_after_v * o.holdout_after_v - floor * floor);
  share.count(o.holdout_after_v <= good_holdout_floors * floor || after <= good_holdout_part * before);
}

/// A detectable single effect that raised an alarm. Returns the size of the largest reported set.
std::size_t count_findings(const Outcome& o, Score& s) {
  const std::string& id = o.answer.ids.front();
  s.first.count(named(o) && o.found.front() == id);
  s.first_class.count(named(o) && class_of(o.found.front()) == class_of(id));
  bool in = false;
  std::size_t size = 0;
  for (const auto& set : o.sets) {
    in = in || contains(set, id);
    size = std::max(size, set.size());
  }
  s.in_set.count(named(o) && in);
  return size;
}

/// Of a named effect: whether each cause that could be confused with it is.
void count_isolability(const Outcome& o, Score& s) {
  if (!named(o) || !o.isolability) return;
  const std::string& truth = o.answer.ids.front();
  const diagnosis::Isolability& i = *o.isolability;
  const auto of_truth = std::find_if(i.causes.begin(), i.causes.end(),
                                     [&](const auto& c) { return model::catalogue[c.mechanism].id == truth; });
  if (of_truth == i.causes.end()) return;
  const auto a = static_cast<std::size_t>(of_truth - i.causes.begin());
  std::vector<std::string> together;  // named with it, or in its place
  for (const auto& set : o.sets) {
    if (contains(set, truth) || !contains(o.found, truth)) together.insert(together.end(), set.begin(), set.end());
  }
  for (std::size_t b = 0; b < i.causes.size(); ++b) {
    const bool confused = contains(together, std::string(model::catalogue[i.causes[b].mechanism].id));
    if (b == a) continue;
    if (i.separable[a][b])
      s.distinguished.count(!confused);
    else
      s.confused.count(confused);
  }
}

void count_pair(const Outcome& o, Score& s) {
  const std::vector<std::string>& ids = o.answer.ids;
  std::size_t right = 0;
  bool wrong = false;
  for (std::size_t k = 0; k < o.found.size(); ++k) {
    const bool hit = std::any_of(ids.begin(), ids.end(), [&](const std::string& id) { return finds(o, k, id); });
    wrong = wrong || !hit;
  }
  for (const std::string& id : ids) {
    bool hit = false;
    for (std::size_t k = 0; k < o.found.size(); ++k) hit = hit || finds(o, k, id);
    right += hit ? 1 : 0;
  }
  s.pair_both.count(named(o) && right == 2);
  s.pair_one_none_wrong.count(named(o) && right >= 1 && !wrong);
}

/// Experiments that an ambiguous diagnosis has led to. Returns their number.
std::size_t count_experiments(const FollowUp& up, Score& s) {
  s.decided_at_once.count(up.decided_at_once);
  s.decided.count(up.decided);
  s.nothing_more.count(up.nothing_more);
  if (up.decided_at_once) s.right_at_once.count(up.right_at_once);
  if (up.decided) s.right.count(up.right);
  return up.rounds.size();
}

}  // namespace

Interval wilson(const Share& share) {
  if (share.of == 0) return {};
  constexpr double z2 = 1.96 * 1.96;
  const auto n = static_cast<double>(share.of);
  const double p = share.value(), middle = (p + z2 / (2 * n)) / (1 + z2 / n),
               half = std::sqrt(z2 * (p * (1 - p) / n + z2 / (4 * n * n))) / (1 + z2 / n);
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

std::string class_of(const std::string& id) {
  static constexpr std::array<std::pair<const char*, const char*>, 3> classes = {
      {{"voltage_gain", "voltage_offset"}, {"coulombic_loss", "current_offset"}, {"leakage", "current_offset"}}};
  for (const auto& [member, name] : classes) {
    if (id == member) return name;
  }
  return id;
}

bool no_alarm(const Outcome& o) { return o.verdict == Verdict::no_mismatch || o.verdict == Verdict::not_testable; }

Score score(const std::vector<Outcome>& outcomes) {
  Score s;
  std::vector<double> overlaps;
  double set_sizes = 0, wall_s = 0, experiments = 0;
  numerics::CalibrationError calibration;
  for (const Outcome& o : outcomes) {
    wall_s += o.wall_s;
    const CaseKind kind = o.answer.kind;
    const bool strong = o.answer.strength >= detectable, alarm = !no_alarm(o);
    if (kind == CaseKind::null) s.false_alarms.count(alarm);
    if (kind == CaseKind::data_fault) s.data_fault.count(o.verdict == Verdict::data_fault);
    if (kind == CaseKind::outside && strong) s.outside_unknown.count(o.verdict == Verdict::unknown);
    if (kind == CaseKind::single) s.detected_all.count(alarm);
    if (kind == CaseKind::single && strong) {
      s.detected.count(alarm);
      if (alarm) {
        set_sizes += static_cast<double>(count_findings(o, s));
        overlaps.push_back(o.overlap);
        count_isolability(o, s);
      }
      count_holdout(o, s.holdout);
    }
    if (kind == CaseKind::single && o.next) s.separated.count(o.next->separated);
    if (o.next) experiments += static_cast<double>(count_experiments(*o.next, s));
    if (kind == CaseKind::pair && o.answer.ids.size() == 2) count_pair(o, s);
    if (named(o) && (kind == CaseKind::single || kind == CaseKind::null || kind == CaseKind::outside))
      calibration.add(o.probability, kind == CaseKind::single && o.found.front() == o.answer.ids.front());
  }
  s.named = calibration.count();
  s.calibration_error = calibration.error();
  if (!overlaps.empty()) s.median_overlap = measurement::upper_median(overlaps);
  s.mean_set_size = s.in_set.of > 0 ? set_sizes / static_cast<double>(s.in_set.of) : 0;
  s.mean_experiments = s.decided.of > 0 ? experiments / static_cast<double>(s.decided.of) : 0;
  s.mean_wall_s = outcomes.empty() ? 0 : wall_s / static_cast<double>(outcomes.size());
  return s;
}

}  // namespace bms::benchmark
