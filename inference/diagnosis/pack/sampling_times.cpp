#include "diagnosis/pack/sampling_times.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

constexpr const PackThresholds::SamplingTimes& of_times = limits.sampling_times;

/// Returns true if the current changes in row k and is constant in the two rows before and after.
bool stands_alone(const Track& track, const PackRecording& pack, std::size_t k) {
  const std::vector<double>&a = pack.current_a, &t = pack.time_s;
  const double step_a = a[k + 1] - a[k - 1], quiet_a = of_times.quiet_share * std::abs(step_a);
  const double in_row = (a[k] - a[k - 1]) / step_a;  // when in the row it was; 0: in the row after
  const auto is_even = [&](std::size_t from) {
    return std::abs(t[from + 2] - t[from] - 2 * track.step_s) < of_times.uneven * track.step_s;
  };
  return std::abs(step_a) > of_times.step_c * track.capacity_ah && std::abs(a[k - 1] - a[k - 2]) < quiet_a &&
         std::abs(a[k + 2] - a[k + 1]) < quiet_a && in_row > of_times.beginning && in_row < 1 + of_times.beginning &&
         is_even(k - 2) && is_even(k);
}

std::vector<std::size_t> lone_steps(const Track& track, const PackRecording& pack) {
  const std::vector<double>& a = pack.current_a;
  std::vector<std::size_t> rows;
  double alone = 0, all = 0;
  for (std::size_t k = 2; k + 2 < pack.rows(); ++k) {
    if (!std::isfinite(a[k - 2] + a[k - 1] + a[k] + a[k + 1] + a[k + 2])) continue;
    all += std::pow(a[k] - a[k - 1], 2);
    if (!stands_alone(track, pack, k)) continue;
    alone += std::pow(a[k + 1] - a[k - 1], 2);
    rows.push_back(k);
  }
  if (rows.size() < of_times.least_steps || alone < of_times.least_share * all) rows.clear();
  return rows;
}

/// How much of the steps a channel has seen in their rows.
class Seen {
 public:
  explicit Seen(const std::vector<double>& v) : v_(v) {}
  void add(std::size_t row) {
    const double step_v = v_[row + 1] - v_[row - 1], seen_v = v_[row] - v_[row - 1];
    if (!std::isfinite(step_v + seen_v)) return;
    product_ += step_v * seen_v;
    square_ += step_v * step_v;
  }
  double share() const { return square_ > 0 ? product_ / square_ : no_value; }

 private:
  const std::vector<double>& v_;
  double product_ = 0, square_ = 0;
};

/// By cell, without every of_times.parts-th step, from left_out on.
std::vector<double> shares_of(const PackRecording& pack, const std::vector<std::size_t>& cells,
                              const std::vector<std::size_t>& steps, std::size_t left_out) {
  std::vector<double> shares;
  for (const std::size_t c : cells) {
    Seen seen(pack.cell_v[c]);
    for (std::size_t n = 0; n < steps.size(); ++n) {
      if (n % of_times.parts != left_out) seen.add(steps[n]);
    }
    if (std::isfinite(seen.share())) shares.push_back(seen.share());
  }
  return shares;
}

/// The polarisation after a step grows on until the row after it: a share of that step is less than one of the voltage
/// that the channel misses.
double growth_after(const Track& track) {
  const auto at = model::look_up(track.cell, 0.5);
  const auto ohm_after = [&](double rows) {
    return at.r0_ohm - at.r1_ohm * std::expm1(-rows * track.step_s / (at.r1_ohm * at.c1_f));
  };
  return ohm_after(of_times.rows_after) / ohm_after(1);
}

}  // namespace

double span_of(std::vector<double> delays_s) {
  std::sort(delays_s.begin(), delays_s.end());
  const std::size_t few = delays_s.size() / (2 * limits.unexplained.cells);
  const double last = static_cast<double>(delays_s.size() - 1), used = last - 2 * static_cast<double>(few);
  return (delays_s[delays_s.size() - 1 - few] - delays_s[few]) * last / used;
}

bool steps_stand_alone(const Track& track, const PackRecording& pack) { return !lone_steps(track, pack).empty(); }

Estimated span_within_row(double linear_s, double step_s) {
  return {(linear_s + step_s) / 2, (step_s - linear_s) * sigma_of_uniform};
}

Estimated span_of_readings(const Estimated& one_step) {
  return {one_step.value / 2, std::hypot(one_step.value * sigma_of_uniform, one_step.sigma)};
}

std::optional<Estimated> sampling_span(const Track& track, const PackRecording& pack,
                                       const std::vector<std::size_t>& cells) {
  const std::vector<std::size_t> steps = lone_steps(track, pack);
  const double row_s = track.step_s * growth_after(track);
  const std::vector<double> shares = shares_of(pack, cells, steps, of_times.parts);
  if (shares.size() < limits.unexplained.cells) return std::nullopt;
  const double usual = measurement::median(shares);
  // outside, the channels are read in another row than the current, and the share is not that of a time
  if (usual < of_times.least_seen || usual > of_times.most_seen) return std::nullopt;
  double square = 0;  // jackknife
  const double span = span_of(shares), parts = static_cast<double>(of_times.parts);
  for (std::size_t part = 0; part < of_times.parts; ++part)
    square += std::pow(span_of(shares_of(pack, cells, steps, part)) - span, 2);
  return Estimated{row_s * span, row_s * std::sqrt(square * (parts - 1) / parts)};
}

std::optional<PackFinding> staggered_channels(const Track& track, const PackRecording& pack,
                                              const std::vector<std::size_t>& cells, const PackLikelihood& likelihood) {
  std::vector<double> delays, sigmas;
  const double spread = likelihood.healthy()[delay];
  for (const std::size_t c : cells) {
    const Accusation a{Cause::late, c};
    const Estimated e = likelihood.size({a}, a, likelihood.last_checkpoint());
    delays.push_back(e.value);
    // without the spread itself
    sigmas.push_back(std::sqrt(std::max(0.0, e.sigma * e.sigma - spread * spread)));
  }
  if (delays.size() < limits.unexplained.cells) return std::nullopt;
  const double sigma = measurement::median(sigmas);
  const double least_s = limits.channels.staggered_rows * track.step_s, linear_s = span_of(delays);
  if (spread < std::max(least_s, limits.channels.staggered_sigmas * sigma)) return std::nullopt;
  // a scan of the channels ends within its row: what lies further apart has another reason
  if (linear_s > track.step_s) return std::nullopt;
  PackFinding f;
  f.cause = Cause::staggered;
  const std::optional<Estimated> of_steps = sampling_span(track, pack, cells);
  const Estimated span = pack.single_readings ? span_of_readings(of_steps.value_or(Estimated{linear_s, 0}))
                                              : of_steps.value_or(span_within_row(linear_s, track.step_s));
  f.value = span.value;
  f.sigma = std::hypot(span.sigma, sigma, limits.spread[delay].scale * f.value);
  f.gain = spread / sigma;
  f.probability = 1;
  return f;
}

}  // namespace bms::diagnosis::pack
