#include "benchmark/score.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace bms::benchmark {

namespace {

bool contains(const std::vector<std::string>& list, const std::string& id) {
  return std::find(list.begin(), list.end(), id) != list.end();
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
  if (id == "voltage_gain") return "voltage_offset";
  if (id == "coulombic_loss" || id == "leakage") return "current_offset";
  return id;
}

Score score(const std::vector<Outcome>& outcomes) {
  using diagnosis::Verdict;
  Score s;
  std::vector<double> overlaps;
  double set_sizes = 0, wall_s = 0;
  struct Bin {
    double said = 0, right = 0, count = 0;
  };
  std::array<Bin, 5> bins{};
  for (const Outcome& o : outcomes) {
    wall_s += o.wall_s;
    const bool quiet = o.verdict == Verdict::no_mismatch || o.verdict == Verdict::not_testable;
    const auto& ids = o.answer.ids;
    if (o.answer.kind == "null") s.false_alarms.count(!quiet);
    if (o.answer.kind == "data_fault") s.data_fault.count(o.verdict == Verdict::data_fault);
    if (o.answer.kind == "outside" && o.answer.strength >= 2) s.outside_unknown.count(o.verdict == Verdict::unknown);
    const bool named = !o.found.empty() &&
                       (o.verdict == Verdict::cause || o.verdict == Verdict::causes || o.verdict == Verdict::ambiguous);
    if (o.answer.kind == "single") {
      s.detected_all.count(!quiet);
      if (o.answer.strength >= 2) {
        s.detected.count(!quiet);
        if (!quiet) {
          s.first.count(named && o.found.front() == ids.front());
          s.first_class.count(named && class_of(o.found.front()) == class_of(ids.front()));
          bool in = false;
          std::size_t size = 0;
          for (const auto& set : o.sets) {
            in = in || contains(set, ids.front());
            size = std::max(size, set.size());
          }
          s.in_set.count(named && in);
          set_sizes += static_cast<double>(size);
        }
        if (!quiet) overlaps.push_back(o.overlap);
        if (o.holdout_before_v > 0 && ids.front() != "contact_intermittent") {
          const double floor = o.holdout_floor_v,
                       before = std::max(0.0, o.holdout_before_v * o.holdout_before_v - floor * floor),
                       after = std::max(0.0, o.holdout_after_v * o.holdout_after_v - floor * floor);
          s.holdout.count(o.holdout_after_v <= 1.3 * floor || after <= 0.1 * before);
        }
      }
    }
    if (o.answer.kind == "single" && o.next) s.separated.count(o.next->separated);
    if (o.answer.kind == "pair" && ids.size() == 2) {
      std::size_t right = 0;
      bool wrong = false;
      for (std::size_t k = 0; k < o.found.size(); ++k) {
        bool hit = false;
        for (const std::string& id : ids) hit = hit || contains(o.sets[k], id) || class_of(o.found[k]) == class_of(id);
        wrong = wrong || !hit;
      }
      for (const std::string& id : ids) {
        bool hit = false;
        for (std::size_t k = 0; k < o.found.size(); ++k)
          hit = hit || contains(o.sets[k], id) || class_of(o.found[k]) == class_of(id);
        right += hit ? 1 : 0;
      }
      s.pair_both.count(named && right == 2);
      s.pair_one_none_wrong.count(named && right >= 1 && !wrong);
    }
    if (named && (o.answer.kind == "single" || o.answer.kind == "null" || o.answer.kind == "outside")) {
      Bin& b = bins[static_cast<std::size_t>(std::min(o.probability * 5, 4.0))];
      b.said += o.probability;
      b.right += o.answer.kind == "single" && o.found.front() == ids.front() ? 1 : 0;
      b.count += 1;
      ++s.named;
    }
  }
  double all = 0;
  for (const Bin& b : bins) all += b.count;
  for (const Bin& b : bins) {
    if (b.count > 0) s.calibration_error += std::abs(b.said - b.right) / all;
  }
  if (!overlaps.empty()) {
    std::sort(overlaps.begin(), overlaps.end());
    s.median_overlap = overlaps[overlaps.size() / 2];
  }
  s.mean_set_size = s.in_set.of > 0 ? set_sizes / static_cast<double>(s.in_set.of) : 0;
  s.mean_wall_s = outcomes.empty() ? 0 : wall_s / static_cast<double>(outcomes.size());
  return s;
}

}  // namespace bms::benchmark
