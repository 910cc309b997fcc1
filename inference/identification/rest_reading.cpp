#include "identification/rest_reading.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include <Eigen/Core>

#include "identification/decay_fit.hpp"
#include "measurement/spans.hpp"
#include "measurement/statistics.hpp"

namespace bms::identification {

namespace {

constexpr double printed_fraction = 0.633;  // of Eq. A3; 1 - 1/e is 0.632
constexpr double steady_part = 0.05;        // largest relative difference of samples of the same load
constexpr double load_line_s = 20;          // longest line under load
constexpr double plain_line_s = 5;          // the same where tau and R1 are not known, because the voltage then bends
constexpr double partial = 0.02;            // a last loaded sample that is smaller by this part contains the step
constexpr std::size_t fewest = 6;           // samples of a rest: three unknowns and three degrees of freedom

/// Samples of one rest. The load before it ends with sample `loaded`.
struct Rest {
  std::size_t loaded = 0, begin = 0, end = 0;  // [begin, end)
  double step_s = 0;
};

/// Value of a straight line at t = 0, and its variance for unit variance of the voltages.
struct AtZero {
  double v = 0, variance = 0;
};

AtZero line_at_zero(const Trace& trace) {
  const double n = static_cast<double>(trace.v.size());
  double t_mean = 0, v_mean = 0, tt = 0, tv = 0;
  for (std::size_t k = 0; k < trace.v.size(); ++k) {
    t_mean += trace.t_s[k] / n;
    v_mean += trace.v[k] / n;
  }
  if (trace.v.size() < 4) return {trace.v.front(), 1};  // the sample next to the step
  for (std::size_t k = 0; k < trace.v.size(); ++k) {
    tt += (trace.t_s[k] - t_mean) * (trace.t_s[k] - t_mean);
    tv += (trace.t_s[k] - t_mean) * (trace.v[k] - v_mean);
  }
  return {v_mean - tv / tt * t_mean, 1 / n + t_mean * t_mean / tt};
}

/// The first finite voltage from a sample on, in steps of +1 or -1 sample; NaN without one.
double nearest_voltage(const Data& data, std::size_t from, std::size_t count, int step) {
  for (std::size_t k = 0; k < count; ++k) {
    const double v = data.voltage_v[step > 0 ? from + k : from - k];
    if (std::isfinite(v)) return v;
  }
  return NAN;
}

PointReading points_of(const Data& data, const Rest& rest, double step_a) {
  PointReading p;
  p.a_v = nearest_voltage(data, rest.loaded, rest.loaded + 1, -1);
  p.b_v = nearest_voltage(data, rest.begin, rest.end - rest.begin, 1);
  p.c_v = nearest_voltage(data, rest.end - 1, rest.end - rest.begin, -1);
  p.d_v = p.b_v + printed_fraction * (p.c_v - p.b_v);
  p.time_constant_s = NAN;
  double before_v = p.b_v, before_s = data.time_s[rest.begin];
  for (std::size_t k = rest.begin + 1; k < rest.end; ++k) {
    const double v = data.voltage_v[k];
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

/// Current through R1 at the samples 0 .. loaded and at the step, and the derivative of the last one by tau.
struct R1Current {
  std::vector<double> current_a;
  double slope_by_tau = 0;
};

R1Current r1_current(const Data& data, const Rest& rest, double tau_s) {
  R1Current r1{{0}, 0};
  for (std::size_t k = 1; k <= rest.loaded + 1; ++k) {
    const bool at_step = k > rest.loaded;  // the part under load of the interval with the step
    const double step_s = (at_step ? rest.step_s : data.time_s[k]) - data.time_s[k - 1];
    const double current_a = data.current_a[at_step ? k - 1 : k];
    const double p = std::exp(-step_s / tau_s), before_a = r1.current_a.back();
    r1.slope_by_tau = p * r1.slope_by_tau + (before_a - current_a) * p * step_s / (tau_s * tau_s);
    r1.current_a.push_back(p * before_a + (1 - p) * current_a);
  }
  return r1;
}

/// Voltage under load at the step: the part of the RC element by r1_ohm (0: not known), the rest by a straight line.
AtZero load_at_step(const Data& data, const Rest& rest, const R1Current& r1, double r1_ohm) {
  Trace load;
  const double loaded_a = data.current_a[rest.loaded], longest_s = r1_ohm > 0 ? load_line_s : plain_line_s;
  for (std::size_t k = rest.loaded + 1; k-- > 0;) {
    // the load may have begun within the interval of its first sample
    if (std::abs(data.current_a[k] - loaded_a) > steady_part * std::abs(loaded_a) ||
        rest.step_s - data.time_s[k] > longest_s)
      break;
    if (!std::isfinite(data.voltage_v[k])) continue;
    load.t_s.push_back(data.time_s[k] - rest.step_s);
    load.v.push_back(data.voltage_v[k] - r1_ohm * r1.current_a[k]);
  }
  if (load.v.empty()) return {NAN, NAN};
  AtZero a = line_at_zero(load);
  a.v += r1_ohm * r1.current_a.back();
  return a;
}

std::optional<FittedDecay> fit_rest(const Data& data, const Rest& rest) {
  FittedDecay fitted;
  Trace all;
  for (std::size_t k = rest.begin; k < rest.end; ++k) {
    if (!std::isfinite(data.voltage_v[k])) continue;
    all.t_s.push_back(data.time_s[k] - rest.step_s);
    all.v.push_back(data.voltage_v[k]);
  }
  if (all.v.size() < fewest) return std::nullopt;
  fitted.decay = best_decay(all);
  if (!std::isfinite(fitted.decay.squares)) return std::nullopt;
  fitted.trace = without_outliers(all, fitted.decay);
  if (fitted.trace.v.size() < fewest) return std::nullopt;
  fitted.decay = best_decay(fitted.trace);
  if (!std::isfinite(fitted.decay.squares)) return std::nullopt;
  return fitted;
}

bool positive(double x) { return std::isfinite(x) && x > 0; }

/// R1 and C1 with their standard deviations.
void set_rc(const FittedDecay& fitted, const R1Current& r1, double rest_a, double variance_v2, double largest_std,
            RestReading& out) {
  const Decay& decay = fitted.decay;
  const Eigen::Matrix3d covariance = covariance_of(fitted, variance_v2);
  const double decaying_a = rest_a - r1.current_a.back();  // current through R1 that still decays
  out.r1_ohm = -decay.amplitude_v / decaying_a;
  out.c1_f = out.tau_s / out.r1_ohm;
  out.tau_std_s = std::sqrt(covariance(2, 2));
  const Eigen::Vector3d r1_by{0, out.r1_ohm / decay.amplitude_v, out.r1_ohm * r1.slope_by_tau / decaying_a};
  const Eigen::Vector3d c1_by = Eigen::Vector3d{0, 0, 1 / out.r1_ohm} - out.c1_f / out.r1_ohm * r1_by;
  out.r1_std_ohm = std::sqrt(r1_by.dot(covariance * r1_by));
  out.c1_std_f = std::sqrt(c1_by.dot(covariance * c1_by));
  out.rc_usable = positive(out.r1_ohm) && positive(out.c1_f) && out.tau_std_s < largest_std * out.tau_s;
}

std::optional<RestReading> read(const Data& data, const Rest& rest, const RestReadingOptions& options) {
  const std::optional<FittedDecay> fitted = fit_rest(data, rest);
  if (!fitted) return std::nullopt;
  const Decay& decay = fitted->decay;

  RestReading out;
  out.time_s = rest.step_s;
  out.rest_s = data.time_s[rest.end - 1] - rest.step_s;
  out.load_a = data.current_a[rest.loaded];
  std::vector<double> resting;
  for (std::size_t k = rest.begin; k < rest.end; ++k) resting.push_back(data.current_a[k]);
  const double rest_a = measurement::median(resting), step_a = rest_a - out.load_a;
  const auto n = static_cast<double>(fitted->trace.v.size());
  constexpr double unknowns = 3;  // A, B, tau
  const double variance_v2 = decay.squares / (n - unknowns);
  out.residual_v = std::sqrt(decay.squares / n);
  out.tau_s = decay.tau_s;
  out.relaxed_fraction = -std::expm1(-out.rest_s / out.tau_s);

  const R1Current r1 = r1_current(data, rest, decay.tau_s);
  set_rc(*fitted, r1, rest_a, variance_v2, options.largest_std, out);
  const FirstSamples first = first_samples(*fitted);
  const AtZero a = load_at_step(data, rest, r1, out.rc_usable ? out.r1_ohm : 0);
  const double b_v = decay.level_v + decay.amplitude_v + first.residual_v;
  out.r0_ohm = (b_v - a.v) / step_a;
  out.r0_std_ohm = std::sqrt(variance_v2 * (a.variance + 1 / static_cast<double>(first.count))) / std::abs(step_a);
  out.r0_usable = positive(out.r0_ohm);
  out.points = points_of(data, rest, step_a);
  return out;
}

void require_recording(const Data& data) {
  if (data.current_a.size() != data.size() || data.voltage_v.size() != data.size())
    throw std::invalid_argument("time, current and voltage differ in length");
  if (!(data.capacity_ah > 0)) throw std::invalid_argument("the capacity is missing, which defines what a load is");
  for (std::size_t k = 0; k < data.size(); ++k) {
    if (!std::isfinite(data.current_a[k])) throw std::invalid_argument("a current is not a finite number");
    if (k > 0 && !(data.time_s[k] > data.time_s[k - 1]))
      throw std::invalid_argument("time does not rise from sample to sample");
  }
}

/// Finds the rests of a recording that follow a steady load.
class RestSearch {
 public:
  RestSearch(const Data& data, const RestReadingOptions& options)
      : data_(data), options_(options), load_a_(options.load_c_rate * data.capacity_ah) {
    const double rest_a = options.rest_c_rate * data.capacity_ah;
    for (std::size_t k = 1; k < data.size(); ++k) any_load_ = any_load_ || loaded(k);
    const auto resting = [&](std::size_t k) { return std::abs(data.current_a[k]) < rest_a; };
    for (const measurement::Rows& rows : measurement::consecutive_rows(data.size(), resting)) {
      if (rows.begin == 0) continue;  // no load before it
      if (const auto rest = rest_after_load(rows)) rests_.push_back(*rest);
    }
  }

  bool any_load() const { return any_load_; }
  const std::vector<Rest>& rests() const { return rests_; }

 private:
  bool loaded(std::size_t k) const { return std::abs(data_.current_a[k]) >= load_a_; }
  bool same(std::size_t one, std::size_t other) const {
    return std::abs(data_.current_a[one] - data_.current_a[other]) < options_.steady * std::abs(data_.current_a[other]);
  }

  /// The rest in these rows. Before it there are two steady loaded samples, and possibly one more that contains the
  /// step: its mean current gives the instant. Empty: too short, or no steady load.
  std::optional<Rest> rest_after_load(const measurement::Rows& rows) const {
    Rest rest{rows.begin - 1, rows.begin, rows.end, data_.time_s[rows.begin - 1]};
    if (data_.time_s[rest.end - 1] - rest.step_s < options_.duration_s) return std::nullopt;
    const std::size_t last = rest.loaded;
    if (last >= 2 && loaded(last - 1) && same(last - 2, last - 1)) {
      const double part = data_.current_a[last] / data_.current_a[last - 1];
      if (!(part > 0 && part < 1 + options_.steady)) return std::nullopt;
      if (part < 1 - partial) {
        rest.step_s = data_.time_s[last - 1] + part * (data_.time_s[last] - data_.time_s[last - 1]);
        --rest.loaded;
      }
      return rest;
    }
    const bool steady = loaded(last) && last > 0 && same(last - 1, last);
    return steady ? std::optional(rest) : std::nullopt;
  }

  const Data& data_;
  const RestReadingOptions& options_;
  const double load_a_;
  bool any_load_ = false;
  std::vector<Rest> rests_;
};

/// Why a median is missing; empty if both are known.
const char* reason_of(const RestReadings& out, const RestSearch& search) {
  if (!search.any_load()) return "the current never reaches the load from which a step into a rest must start";
  if (search.rests().empty()) return "no steady load is followed by a rest that is long enough";
  if (out.rests.empty()) return "the rests contain too few measured voltages";
  if (out.r0_from == 0) return "no rest gives a positive R0, so the sign of the current may be inverted";
  if (out.rc_from == 0) return "no rest is long enough to determine the time constant, so R1 and C1 are not known";
  return "";
}

}  // namespace

RestReadings read_rests(const Data& data, const RestReadingOptions& options) {
  require_recording(data);
  const RestSearch search(data, options);
  RestReadings out;
  for (const Rest& rest : search.rests()) {
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
  if (!r0.empty()) out.r0_ohm = measurement::median(r0);
  if (!r1.empty()) {
    out.r1_ohm = measurement::median(r1);
    out.tau_s = measurement::median(tau);
    out.c1_f = measurement::median(c1);
  }
  out.reason = reason_of(out, search);
  return out;
}

}  // namespace bms::identification
