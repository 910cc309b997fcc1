#include "identification/rest_reading.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

#include <Eigen/Dense>

namespace bms::identification {

namespace {

constexpr double steady_part = 0.05;  // a loaded sample that differs by less from the last belongs to the same load
constexpr double load_line_s = 20;    // length of the line under load, where the current was steady for so long
constexpr double plain_line_s = 5;    // the same where tau and R1 are not known, and what bends is in the line
constexpr double partial = 0.02;      // a last loaded sample smaller by more than this part holds the step
constexpr std::size_t fewest = 6;     // samples of a rest: three unknowns, and as many again to judge them by

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
}

/// Samples of one rest; the load before it ends with sample `loaded`.
struct Rest {
  std::size_t loaded = 0, begin = 0, end = 0;  // [begin, end)
  double step_s = 0;
};

struct Trace {
  std::vector<double> t_s, v;  // t from the step
};

struct Decay {
  double level_v = 0, amplitude_v = 0, tau_s = 0;  // A, B
  double squares = INFINITY;
};

/// A and B for a given tau.
Decay decay_of(const Trace& trace, double tau_s) {
  double s1 = 0, se = 0, see = 0, sv = 0, sev = 0;
  const double v0 = trace.v.front();  // voltages differ by millivolts: keep their digits
  for (std::size_t k = 0; k < trace.v.size(); ++k) {
    const double e = std::exp(-trace.t_s[k] / tau_s), v = trace.v[k] - v0;
    s1 += 1, se += e, see += e * e, sv += v, sev += e * v;
  }
  Decay d{0, 0, tau_s, INFINITY};
  const double determinant = s1 * see - se * se;
  if (!(determinant > 1e-12 * s1 * see)) return d;
  d.amplitude_v = (s1 * sev - se * sv) / determinant;
  d.level_v = v0 + (sv - d.amplitude_v * se) / s1;
  d.squares = 0;
  for (std::size_t k = 0; k < trace.v.size(); ++k) {
    const double left = d.level_v + d.amplitude_v * std::exp(-trace.t_s[k] / tau_s) - trace.v[k];
    d.squares += left * left;
  }
  return d;
}

/// Best tau: a grid, because a long flat tail makes second minima, then golden section between its neighbours.
Decay best_decay(const Trace& trace) {
  const double least = std::max(trace.t_s.back() / static_cast<double>(trace.t_s.size()) / 3, 1e-3),
               most = 10 * trace.t_s.back();
  constexpr int taus = 40;
  const double ratio = std::pow(most / least, 1.0 / taus);
  Decay best;
  for (int k = 0; k <= taus; ++k) {
    const Decay d = decay_of(trace, least * std::pow(ratio, k));
    if (d.squares < best.squares) best = d;
  }
  if (!std::isfinite(best.squares)) return best;
  double low = std::log(best.tau_s / ratio), high = std::log(best.tau_s * ratio);
  for (int k = 0; k < 40; ++k) {
    const double part = (std::numbers::phi - 1) * (high - low);
    const Decay left = decay_of(trace, std::exp(high - part)), right = decay_of(trace, std::exp(low + part));
    (left.squares < right.squares ? high : low) = left.squares < right.squares ? low + part : high - part;
    if (left.squares < best.squares) best = left;
    if (right.squares < best.squares) best = right;
  }
  return best;
}

/// The trace without samples further than five (robust) standard deviations from the fit: a loose contact, a lost bit.
Trace without_outliers(const Trace& trace, const Decay& decay) {
  std::vector<double> left;
  for (std::size_t k = 0; k < trace.v.size(); ++k)
    left.push_back(std::abs(decay.level_v + decay.amplitude_v * std::exp(-trace.t_s[k] / decay.tau_s) - trace.v[k]));
  const double bound = std::max(5 * 1.4826 * median(left), 1e-9);
  Trace kept;
  for (std::size_t k = 0; k < trace.v.size(); ++k) {
    if (left[k] > bound) continue;
    kept.t_s.push_back(trace.t_s[k]);
    kept.v.push_back(trace.v[k]);
  }
  return kept;
}

/// Straight line through v(t), its value at t = 0 and the variance of that with unit variance of v.
struct AtZero {
  double v = 0, variance = 0;
};

AtZero line_at_zero(const Trace& trace) {
  const double n = static_cast<double>(trace.v.size());
  double t_mean = 0, v_mean = 0, tt = 0, tv = 0;
  for (std::size_t k = 0; k < trace.v.size(); ++k) t_mean += trace.t_s[k] / n, v_mean += trace.v[k] / n;
  if (trace.v.size() < 4) return {trace.v.front(), 1};  // the one next to the step
  for (std::size_t k = 0; k < trace.v.size(); ++k) {
    tt += (trace.t_s[k] - t_mean) * (trace.t_s[k] - t_mean);
    tv += (trace.t_s[k] - t_mean) * (trace.v[k] - v_mean);
  }
  return {v_mean - tv / tt * t_mean, 1 / n + t_mean * t_mean / tt};
}

/// Median of the finite voltages of [from, to).
double median_voltage(const Data& data, std::size_t from, std::size_t to) {
  std::vector<double> v;
  for (std::size_t k = from; k < to; ++k) {
    if (std::isfinite(data.voltage_v[k])) v.push_back(data.voltage_v[k]);
  }
  return v.empty() ? NAN : median(v);
}

PointReading points_of(const Data& data, const Rest& rest, double step_a) {
  PointReading p;
  // neighbours that belong to the same point: 1 % of the rest, on the side of the step where the point lies
  const double near_s = 0.01 * (data.time_s[rest.end - 1] - rest.step_s);
  const auto within = [&](std::size_t k, std::size_t centre) {
    return std::abs(data.time_s[k] - data.time_s[centre]) <= near_s;
  };
  std::size_t a = rest.loaded, b = rest.begin + 1, c = rest.end - 1;
  while (a > 0 && within(a - 1, rest.loaded) &&
         std::abs(data.current_a[a - 1] - data.current_a[rest.loaded]) <
             steady_part * std::abs(data.current_a[rest.loaded]))
    --a;
  while (b < rest.end && within(b, rest.begin)) ++b;
  while (c > rest.begin && within(c - 1, rest.end - 1)) --c;
  p.a_v = median_voltage(data, a, rest.loaded + 1);
  p.b_v = median_voltage(data, rest.begin, b);
  p.c_v = median_voltage(data, c, rest.end);
  p.d_v = p.b_v + (1 - 1 / std::numbers::e) * (p.c_v - p.b_v);
  p.time_constant_s = NAN;
  double before_v = p.b_v, before_s = data.time_s[rest.begin];
  for (std::size_t k = rest.begin + 1; k < rest.end; ++k) {
    const double v = median_voltage(data, std::max(rest.begin, k - 2), std::min(k + 3, rest.end));
    if (!std::isfinite(v)) continue;
    if ((v - p.d_v) * (p.c_v - p.b_v) >= 0) {
      const double part = v == before_v ? 1 : std::clamp((p.d_v - before_v) / (v - before_v), 0.0, 1.0);
      p.time_constant_s = before_s + part * (data.time_s[k] - before_s) - data.time_s[rest.begin];
      break;
    }
    before_v = v;
    before_s = data.time_s[k];
  }
  p.r0_ohm = (p.b_v - p.a_v) / step_a;
  p.r1_ohm = (p.c_v - p.b_v) / step_a;
  p.c1_f = p.time_constant_s / p.r1_ohm;
  return p;
}

/// The current as the RC element feels it at the samples 0 .. loaded, then at the step; and the last one's derivative
/// by tau.
struct Felt {
  std::vector<double> current_a;
  double slope_by_tau = 0;
};

Felt felt_current(const Data& data, const Rest& rest, double tau_s) {
  Felt felt{{0}, 0};
  for (std::size_t k = 1; k <= rest.loaded + 1; ++k) {
    const bool at_step = k > rest.loaded;  // the load's part of the interval that holds the step
    const double step_s = (at_step ? rest.step_s : data.time_s[k]) - data.time_s[k - 1],
                 current_a = data.current_a[at_step ? k - 1 : k];
    const double p = std::exp(-step_s / tau_s), before_a = felt.current_a.back();
    felt.slope_by_tau = p * felt.slope_by_tau + (before_a - current_a) * p * step_s / (tau_s * tau_s);
    felt.current_a.push_back(p * before_a + (1 - p) * current_a);
  }
  return felt;
}

/// Voltage under load at the step: the RC element's part by r1_ohm (0: not known), the rest of it a straight line.
AtZero load_at_step(const Data& data, const Rest& rest, const Felt& felt, double r1_ohm) {
  Trace load;
  const double loaded_a = data.current_a[rest.loaded], longest_s = r1_ohm > 0 ? load_line_s : plain_line_s;
  for (std::size_t k = rest.loaded + 1; k-- > 0;) {
    // the first sample of a load may have lain under it for part of its interval only
    if (std::abs(data.current_a[k] - loaded_a) > steady_part * std::abs(loaded_a) ||
        rest.step_s - data.time_s[k] > longest_s)
      break;
    if (!std::isfinite(data.voltage_v[k])) continue;
    load.t_s.push_back(data.time_s[k] - rest.step_s);
    load.v.push_back(data.voltage_v[k] - r1_ohm * felt.current_a[k]);
  }
  if (load.v.empty()) return {NAN, NAN};
  AtZero a = line_at_zero(load);
  a.v += r1_ohm * felt.current_a.back();
  return a;
}

std::optional<RestReading> read(const Data& data, const Rest& rest, const RestReadingOptions& options) {
  Trace trace;
  for (std::size_t k = rest.begin; k < rest.end; ++k) {
    if (!std::isfinite(data.voltage_v[k])) continue;
    trace.t_s.push_back(data.time_s[k] - rest.step_s);
    trace.v.push_back(data.voltage_v[k]);
  }
  if (trace.v.size() < fewest) return std::nullopt;
  Decay decay = best_decay(trace);
  if (!std::isfinite(decay.squares)) return std::nullopt;
  const Trace kept = without_outliers(trace, decay);
  if (kept.v.size() < fewest) return std::nullopt;
  decay = best_decay(kept);
  if (!std::isfinite(decay.squares)) return std::nullopt;

  RestReading out;
  out.time_s = rest.step_s;
  out.rest_s = data.time_s[rest.end - 1] - rest.step_s;
  out.load_a = data.current_a[rest.loaded];
  std::vector<double> resting;
  for (std::size_t k = rest.begin; k < rest.end; ++k) resting.push_back(data.current_a[k]);
  const double rest_a = median(resting), step_a = rest_a - out.load_a;
  const std::size_t n = kept.v.size();
  const double variance_v2 = decay.squares / static_cast<double>(n - 3);
  out.residual_v = std::sqrt(decay.squares / static_cast<double>(n));
  out.tau_s = decay.tau_s;
  out.relaxed_fraction = -std::expm1(-out.rest_s / out.tau_s);

  // Covariance of A, B, tau, and of the first samples' level among them.
  Eigen::MatrixXd slope(static_cast<Eigen::Index>(n), 3);
  for (std::size_t k = 0; k < n; ++k) {
    const double e = std::exp(-kept.t_s[k] / decay.tau_s);
    slope.row(static_cast<Eigen::Index>(k)) << 1, e, decay.amplitude_v * e * kept.t_s[k] / (decay.tau_s * decay.tau_s);
  }
  const Eigen::Vector3d size = slope.colwise().norm().cwiseMax(1e-300);
  slope *= size.cwiseInverse().asDiagonal();
  const Eigen::Matrix3d normal = slope.transpose() * slope;
  const Eigen::Matrix3d inverse = normal.completeOrthogonalDecomposition().pseudoInverse();
  const Eigen::Matrix3d covariance =
      variance_v2 * (size.cwiseInverse().asDiagonal() * inverse * size.cwiseInverse().asDiagonal());

  std::size_t first = 0;
  double first_left_v = 0;  // what the fit leaves in the first samples: a faster relaxation, if there is one
  while (first < n && (first < 5 || kept.t_s[first] < kept.t_s[0] + 0.02 * decay.tau_s)) {
    first_left_v += kept.v[first] - decay.level_v - decay.amplitude_v * std::exp(-kept.t_s[first] / decay.tau_s);
    ++first;
  }
  first_left_v /= static_cast<double>(first);
  const Felt felt = felt_current(data, rest, decay.tau_s);
  const double lasting_a = rest_a - felt.current_a.back();  // what the element has still to forget
  out.r1_ohm = -decay.amplitude_v / lasting_a;
  out.c1_f = out.tau_s / out.r1_ohm;
  out.tau_std_s = std::sqrt(covariance(2, 2));
  const Eigen::Vector3d r1_by{0, out.r1_ohm / decay.amplitude_v, out.r1_ohm * felt.slope_by_tau / lasting_a};
  const Eigen::Vector3d c1_by = Eigen::Vector3d{0, 0, 1 / out.r1_ohm} - out.c1_f / out.r1_ohm * r1_by;
  out.r1_std_ohm = std::sqrt(r1_by.dot(covariance * r1_by));
  out.c1_std_f = std::sqrt(c1_by.dot(covariance * c1_by));
  const auto positive = [](double x) { return std::isfinite(x) && x > 0; };
  out.rc_usable = positive(out.r1_ohm) && positive(out.c1_f) && out.tau_std_s < options.largest_std * out.tau_s;

  const AtZero a = load_at_step(data, rest, felt, out.rc_usable ? out.r1_ohm : 0);
  const double b_v = decay.level_v + decay.amplitude_v + first_left_v;
  out.r0_ohm = (b_v - a.v) / step_a;
  out.r0_std_ohm = std::sqrt(variance_v2 * (a.variance + 1 / static_cast<double>(first))) / std::abs(step_a);
  out.r0_usable = positive(out.r0_ohm);
  out.points = points_of(data, rest, step_a);
  return out;
}

}  // namespace

RestReadings read_rests(const Data& data, const RestReadingOptions& options) {
  if (data.current_a.size() != data.size() || data.voltage_v.size() != data.size())
    throw std::invalid_argument("time, current and voltage differ in length");
  if (!(data.capacity_ah > 0)) throw std::invalid_argument("a load is judged by the capacity, which is not given");
  for (std::size_t k = 0; k < data.size(); ++k) {
    if (!std::isfinite(data.current_a[k])) throw std::invalid_argument("a current is not a finite number");
    if (k > 0 && !(data.time_s[k] > data.time_s[k - 1]))
      throw std::invalid_argument("time does not rise from sample to sample");
  }
  const double load_a = options.load_c_rate * data.capacity_ah, quiet_a = options.rest_c_rate * data.capacity_ah;
  const auto loaded = [&](std::size_t k) { return std::abs(data.current_a[k]) >= load_a; };
  const auto quiet = [&](std::size_t k) { return std::abs(data.current_a[k]) < quiet_a; };

  RestReadings out;
  bool any_load = false;
  std::size_t long_enough = 0;
  for (std::size_t k = 1; k < data.size(); ++k) {
    any_load = any_load || loaded(k);
    if (!quiet(k) || quiet(k - 1)) continue;
    Rest rest{k - 1, k, k, data.time_s[k - 1]};
    while (rest.end < data.size() && quiet(rest.end)) ++rest.end;
    if (data.time_s[rest.end - 1] - rest.step_s < options.duration_s) continue;
    // Two steady loaded samples, then the rest, or one between that holds the step: its mean tells where.
    const auto same = [&](std::size_t one, std::size_t other) {
      return std::abs(data.current_a[one] - data.current_a[other]) < options.steady * std::abs(data.current_a[other]);
    };
    const std::size_t last = rest.loaded;
    if (last >= 2 && loaded(last - 1) && same(last - 2, last - 1)) {
      const double part = data.current_a[last] / data.current_a[last - 1];
      if (!(part > 0 && part < 1 + options.steady)) continue;
      if (part < 1 - partial) {
        rest.step_s = data.time_s[last - 1] + part * (data.time_s[last] - data.time_s[last - 1]);
        --rest.loaded;
      }
    } else if (!loaded(last) || last == 0 || !same(last - 1, last)) {
      continue;
    }
    ++long_enough;
    if (const auto reading = read(data, rest, options)) out.rests.push_back(*reading);
  }

  std::vector<double> r0, r1, tau, c1;
  for (const RestReading& r : out.rests) {
    if (r.r0_usable) r0.push_back(r.r0_ohm);
    if (!r.rc_usable) continue;
    r1.push_back(r.r1_ohm);
    tau.push_back(r.tau_s);
    c1.push_back(r.c1_f);
  }
  out.r0_from = r0.size();
  out.rc_from = r1.size();
  if (!r0.empty()) out.r0_ohm = median(r0);
  if (!r1.empty()) out.r1_ohm = median(r1), out.tau_s = median(tau), out.c1_f = median(c1);
  if (!any_load)
    out.reason = "the current never reaches the load that a step into a rest must start from";
  else if (long_enough == 0)
    out.reason = "no steady load is followed by a rest that is long enough";
  else if (out.rests.empty())
    out.reason = "the rests hold too few measured voltages";
  else if (r0.empty())
    out.reason = "no rest gives a positive R0: is the sign of the current right?";
  else if (r1.empty())
    out.reason = "no rest is long enough to tell the time constant: R1 and C1 are not known";
  return out;
}

}  // namespace bms::identification
