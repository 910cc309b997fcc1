#include "diagnosis/likeliest_noise.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "diagnosis/numerics.hpp"

namespace bms::diagnosis {

namespace {

/// Returns true if two noise models differ by no more than what rounding leaves of a step there and back.
bool is_same(const NoiseModel& a, const NoiseModel& b) {
  return std::all_of(amplitudes.begin(), amplitudes.end(), [&](const auto amplitude) {
    return std::abs(a.*amplitude - b.*amplitude) <= numerics.noise.same_amplitude * a.*amplitude;
  });
}

/// Steps of a coordinate search over a noise model's amplitudes: each up and down by a factor, not below the nominal
/// one.
class NoiseSteps {
 public:
  NoiseSteps(const NoiseModel& nominal, bool with_checks) : nominal_(nominal), tried_{nominal} {
    for (const auto member : amplitudes) {
      const bool of_checks = member == &NoiseModel::current_check || member == &NoiseModel::voltage_check;
      if (!of_checks || with_checks) members_.push_back(member);
    }
  }
  std::size_t count() const { return 2 * members_.size(); }

  struct Step {
    std::size_t at;
    NoiseModel noise;
  };
  /// Those from step `first` on that are not tried yet.
  std::vector<Step> untried(const NoiseModel& from, double factor, std::size_t first) const {
    std::vector<Step> steps;
    for (std::size_t at = first; at < count(); ++at) {
      const auto member = members_[at / 2];
      NoiseModel n = from;
      n.*member = std::max(from.*member * (at % 2 == 0 ? factor : 1 / factor), nominal_.*member);
      const auto same = [&](const NoiseModel& t) { return is_same(t, n); };
      if (std::none_of(tried_.begin(), tried_.end(), same) &&
          std::none_of(steps.begin(), steps.end(), [&](const Step& s) { return same(s.noise); }))
        steps.push_back({at, n});
    }
    return steps;
  }
  void mark_tried(const NoiseModel& noise) { tried_.push_back(noise); }

 private:
  const NoiseModel& nominal_;
  std::vector<double NoiseModel::*> members_;
  std::vector<NoiseModel> tried_;  // the cost falls from best to best: what was tried is never better
};

}  // namespace

LikeliestNoise search_noise(const NoiseModel& nominal, bool with_checks, const CostsOfNoise& costs_of) {
  LikeliestNoise best{nominal, costs_of({&nominal, 1}).front()};
  NoiseSteps search(nominal, with_checks);
  for (const double factor : numerics.noise.amplitude_factors) {
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t first = 0; first < search.count();) {
        // all that are left at once; after a better one the rest is computed again from there
        const std::vector<NoiseSteps::Step> steps = search.untried(best.noise, factor, first);
        std::vector<NoiseModel> noises;
        for (const NoiseSteps::Step& s : steps) noises.push_back(s.noise);
        const std::vector<double> costs = costs_of(noises);
        first = search.count();
        for (std::size_t k = 0; k < steps.size(); ++k) {
          search.mark_tried(steps[k].noise);
          if (!(costs[k] < best.cost)) continue;  // also ends where a cost is NaN
          best = {steps[k].noise, costs[k]};
          moved = true;
          first = steps[k].at + 1;
          break;
        }
      }
    }
  }
  return best;
}

}  // namespace bms::diagnosis
