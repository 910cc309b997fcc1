#include "diagnosis/residual_test.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "diagnosis/locate.hpp"
#include "diagnosis/residual_projection.hpp"

namespace bms::diagnosis {

namespace {

/// Weight of x at the knots of an even grid over low..high.
void hat(Eigen::Ref<Columns> row, Eigen::Index first, Eigen::Index knots, double low, double high, double x,
         double value) {
  const double at = std::clamp((x - low) / std::max(high - low, 1e-12) * static_cast<double>(knots - 1), 0.0,
                               static_cast<double>(knots - 1) - 1e-9);
  const auto k = static_cast<Eigen::Index>(at);
  row(0, first + k) += value * (1 - (at - static_cast<double>(k)));
  row(0, first + k + 1) += value * (at - static_cast<double>(k));
}

constexpr double free_v = 0.02;          // prior deviation of a generic voltage
constexpr double sought_frequency = 14;  // what the best of some hundred frequencies gains on noise

/// A stretch of columns that is asked by itself.
struct Family {
  const char* goes_with;
  Eigen::Index first, count;
};

/// What a reading that only follows in leaps of this size is off.
constexpr std::array leaps_v = {0.002, 0.004, 0.008, 0.016, 0.032};

/// Power of a channel at a frequency, taken at even steps.
double power_at(const std::vector<double>& time_s, const std::vector<double>& value, double frequency_hz) {
  double re = 0, im = 0;
  for (std::size_t k = 0; k < value.size(); ++k) {
    if (!std::isfinite(value[k])) continue;
    const double turn = 2 * std::numbers::pi * frequency_hz * time_s[k];
    re += value[k] * std::cos(turn);
    im += value[k] * std::sin(turn);
  }
  return re * re + im * im;
}

/// Frequencies at which something from outside would show: not those of a profile that repeats itself, where a small
/// error of the model repeats as well.
std::vector<double> strange_frequencies(const PreparedRecording& r) {
  constexpr std::size_t count = 160, around = 6;
  const double lowest_hz = 4 / r.duration_s(),
               highest_hz = std::min(0.02, 0.1 / (r.duration_s() / static_cast<double>(r.size())));
  std::vector<double> hz, power;
  if (!(highest_hz > 2 * lowest_hz)) return {};
  std::vector<double> rest(r.current_a);
  double mean = 0;
  for (double& a : rest) mean += std::isfinite(a) ? a / static_cast<double>(rest.size()) : 0;
  for (double& a : rest) a -= mean;
  // half a line's width apart at the low end, wider where that would be thousands
  for (double f = lowest_hz; f < highest_hz && hz.size() < 4 * count; f += std::max(0.5 / r.duration_s(), f / count))
    hz.push_back(f);
  for (const double f : hz) power.push_back(power_at(r.time_s, rest, f));
  std::vector<double> strange, near;
  for (std::size_t k = 0; k < hz.size(); ++k) {
    near.assign(power.begin() + static_cast<std::ptrdiff_t>(k - std::min(k, around)),
                power.begin() + static_cast<std::ptrdiff_t>(std::min(hz.size(), k + around + 1)));
    std::nth_element(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(near.size() / 2), near.end());
    if (power[k] <= 3 * near[near.size() / 2]) strange.push_back(hz[k]);
  }
  return strange;
}

}  // namespace

Remainder test_residual(const LikelihoodModel& evidence, const HypothesisFit& fit) {
  const auto rows = static_cast<Eigen::Index>(evidence.samples());
  const double c_rate_a = evidence.cell().capacity_ah;
  constexpr Eigen::Index time_knots = 30, soc_knots = 8, fine_knots = 24, volt_knots = 30, memory = 6, soc_current = 4,
                         time_current = 6;
  constexpr Eigen::Index per_record = time_knots + time_current, leaps = leaps_v.size();
  const Eigen::Index shared = 2 * soc_knots + fine_knots + volt_knots + memory + soc_current + 1 + leaps;
  const Eigen::Index generic = shared + per_record * static_cast<Eigen::Index>(evidence.records().size());
  Columns raw = Columns::Zero(rows, generic);
  double largest_a = 1e-9;
  for (const PreparedRecording& r : evidence.records()) {
    for (const double a : r.current_a) {
      if (std::isfinite(a)) largest_a = std::max(largest_a, std::abs(a));
    }
  }
  Eigen::Index row = 0;
  for (std::size_t n = 0; n < evidence.records().size(); ++n) {
    const PreparedRecording& r = evidence.records()[n];
    std::vector<double> soc;
    const std::vector<double> volts = evidence.voltage(fit.hypothesis, fit.calibration, n, &soc);
    const auto [lowest, highest] = std::minmax_element(soc.begin(), soc.end());
    const auto [lowest_v, highest_v] = std::minmax_element(volts.begin(), volts.end());
    std::array<double, memory> slow{};
    constexpr std::array<double, memory> tau_s = {4, 15, 60, 250, 1'000, 4'000};
    double known_a = 0, heading = 0, heat = 0;
    std::array<double, leaps_v.size()> held_v;
    held_v.fill(volts.front());
    for (std::size_t k = 0; k < r.size(); ++k, ++row) {
      const double dt_s = k > 0 ? r.time_s[k] - r.time_s[k - 1] : 0;
      if (std::isfinite(r.current_a[k])) known_a = r.current_a[k];
      const double c = known_a / largest_a, moved = known_a * dt_s / (3'600 * c_rate_a);
      heading += (1 - std::exp(-std::abs(moved) / 0.02)) * ((moved > 0 ? 1 : -1) - heading);
      heat += (1 - std::exp(-dt_s / 1'500)) * (c * c - heat);
      auto here = raw.middleRows(row, 1);
      Eigen::Index at = 0;
      hat(here, at, soc_knots, *lowest, *highest, soc[k], free_v);
      hat(here, at + soc_knots, soc_knots, *lowest, *highest, soc[k], free_v * heading);
      at += 2 * soc_knots;
      hat(here, at, fine_knots, *lowest, *highest, soc[k], free_v / 4);
      at += fine_knots;
      hat(here, at, volt_knots, *lowest_v, *highest_v, volts[k], free_v / 4);
      at += volt_knots;
      for (std::size_t t = 0; t < memory; ++t) {
        slow[t] += (1 - std::exp(-dt_s / tau_s[t])) * (c - slow[t]);
        here(0, at++) = free_v * slow[t];
      }
      hat(here, at, soc_current, *lowest, *highest, soc[k], free_v * c);
      at += soc_current;
      here(0, at++) = free_v * heat;
      for (std::size_t l = 0; l < leaps_v.size(); ++l) {
        if (std::abs(volts[k] - held_v[l]) >= leaps_v[l]) held_v[l] = volts[k];
        here(0, at++) = held_v[l] - volts[k];
      }
      at += static_cast<Eigen::Index>(n) * per_record;
      hat(here, at, time_knots, r.time_s.front(), r.time_s.back(), r.time_s[k], free_v);
      hat(here, at + time_knots, time_current, r.time_s.front(), r.time_s.back(), r.time_s[k], free_v * c);
    }
  }
  Columns white = raw;
  evidence.whiten(white);

  const LeftOver left(evidence, fit);
  const auto [gram, toward] = left.of(white);

  std::vector<Family> families;
  Eigen::Index at = 0;
  const auto family = [&](const char* goes_with, Eigen::Index count) {
    families.push_back({goes_with, at, count});
    at += count;
  };
  family("the state of charge and the direction", 2 * soc_knots);
  family("the state of charge", fine_knots);
  family("the voltage itself", volt_knots);
  family("the load before", memory);
  family("the load at a state of charge", soc_current);
  family("the heat of the load", 1);
  family("how far the voltage has moved: a reading that follows in leaps", leaps);
  for (std::size_t n = 0; n < evidence.records().size(); ++n) {
    family("the time", time_knots);
    family("the load at a time", time_current);
  }

  Remainder found;
  Eigen::VectorXd seen_v = Eigen::VectorXd::Zero(rows);
  for (const Family& f : families) {
    const Eigen::MatrixXd own_gram = gram.block(f.first, f.first, f.count, f.count);
    Eigen::MatrixXd regular = own_gram;
    regular.diagonal().array() += 1;
    const Eigen::LDLT<Eigen::MatrixXd> solver(regular);
    const Eigen::VectorXd x = solver.solve(toward.segment(f.first, f.count));
    // what the columns gain on noise alone: the trace of what they can follow
    const double freedom = solver.solve(own_gram).trace(),
                 gain = toward.segment(f.first, f.count).dot(x) - 1.6 * freedom;
    if (gain <= found.gain) continue;
    found.gain = gain;
    found.family = f.goes_with;
    seen_v = raw.middleCols(f.first, f.count) * x;
  }

  // a sine
  const PreparedRecording& first_record = evidence.records().front();
  const auto first_rows = static_cast<Eigen::Index>(first_record.size());
  for (const double hz : strange_frequencies(first_record)) {
    Columns wave = Columns::Zero(rows, 2);
    for (Eigen::Index k = 0; k < first_rows; ++k) {
      const double turn = 2 * std::numbers::pi * hz * first_record.time_s[static_cast<std::size_t>(k)];
      wave(k, 0) = std::cos(turn);
      wave(k, 1) = std::sin(turn);
    }
    Columns white_wave = wave;
    evidence.whiten(white_wave);
    const auto [g, b] = left.of(white_wave);
    const Eigen::Vector2d x = (g + 1e-6 * g.diagonal().maxCoeff() * Eigen::Matrix2d::Identity()).ldlt().solve(b);
    const double gain = b.dot(x) - sought_frequency;
    if (gain <= found.gain) continue;
    found.gain = gain;
    found.family = "a period of its own";
    seen_v = wave * x;
  }

  std::vector<double> squares;
  for (Eigen::Index k = 0; k < rows; ++k) {
    if (fit.residual[k] != 0) squares.push_back(fit.residual[k] * fit.residual[k]);
  }
  if (squares.size() > 100) {
    // winsorised at 4 deviations: a few bad samples are no excess
    double sum = 0;
    for (const double s : squares) sum += std::min(s, 16.0);
    found.fast_excess = sum / static_cast<double>(squares.size()) - 1;
    const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
    std::nth_element(squares.begin(), middle, squares.end());
    // median of a chi-square of one degree of freedom; what lies within the tolerance is not far out
    const double variance = std::max(*middle / 0.4549, 1.0);
    found.far_out = static_cast<double>(
                        std::count_if(squares.begin(), squares.end(), [&](double s) { return s > 16 * variance; })) /
                    static_cast<double>(squares.size());
  }
  row = 0;
  for (const PreparedRecording& r : evidence.records()) {
    std::vector<double>& e = found.energy.emplace_back(r.size());
    for (std::size_t k = 0; k < r.size(); ++k, ++row) e[k] = seen_v[row] * seen_v[row];
  }
  found.spans = strongest_spans(evidence.records().front(), found.energy.front());
  return found;
}

}  // namespace bms::diagnosis
