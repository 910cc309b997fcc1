#include "ammeter/ammeter.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>

#include <fmt/format.h>

#include "ammeter/ammeter_at_rest.hpp"
#include "ammeter/ammeter_by_cell.hpp"
#include "files/bad_input.hpp"
#include "measurement/silent_current.hpp"

namespace bms::ammeter {

namespace {

constexpr std::size_t fewest_readings = 30, fewest_values = 10, fewest_clipped = 20, fewest_episodes = 3;
constexpr double same_reading = 0.002;   ///< of the largest: such readings are at the end of the range
constexpr double high_reading = 0.8;     ///< of the largest: readings to compare the clipped ones with
constexpr double significant = 3;        ///< standard deviations, for a claim that something is there
constexpr double nothing_beyond = 0.05;  ///< of the largest: if less than that would show, there is no clipping
constexpr double correlated_s = 60;      ///< errors of a meter are taken as correlated for so long
constexpr double corrected_sigmas = 2;   ///< standard deviations from which an error is corrected
constexpr double steps_of_a_gap = 5;     ///< a gap around zero of fewer steps of the reading is its resolution

bool known(double a) { return std::isfinite(a); }

/// Mean and standard deviation of the mean.
Uncertain mean_of(const std::vector<double>& values) {
  double sum = 0, squares = 0;
  for (const double v : values) sum += v;
  const auto n = static_cast<double>(values.size());
  for (const double v : values) squares += (v - sum / n) * (v - sum / n);
  return {sum / n, std::sqrt(squares / std::max(1.0, n - 1) / n)};
}

/// The shape of the readings alone.
struct Readings {
  std::vector<double> sizes;  ///< sorted, without missing ones
  double largest = 0;         ///< with its sign
  double step = 0;            ///< smallest difference between two sizes
};

Readings readings_of(const measurement::Recording& r) {
  Readings all;
  for (const double a : r.current_a) {
    if (!known(a)) continue;
    all.sizes.push_back(std::abs(a));
    if (std::abs(a) > std::abs(all.largest)) all.largest = a;
  }
  std::sort(all.sizes.begin(), all.sizes.end());
  all.step = std::abs(all.largest);
  for (std::size_t k = 1; k < all.sizes.size(); ++k) {
    const double by = all.sizes[k] - all.sizes[k - 1];
    if (by > 1e-9 && by < all.step) all.step = by;
  }
  return all;
}

/// A gap between 0 and the smallest other reading that is much wider than the gaps above it.
SensorFinding dead_band_of(const Readings& all) {
  SensorFinding found;
  const auto first = std::upper_bound(all.sizes.begin(), all.sizes.end(), 1e-9);
  const auto zeros = static_cast<std::size_t>(first - all.sizes.begin());
  if (first == all.sizes.end() || zeros < fewest_readings) {
    found.why = "fewer than 30 readings of exactly 0, so no dead band";
    return found;
  }
  const double width = *first;
  const auto end = std::upper_bound(first, all.sizes.end(), 2 * width);
  const auto above = static_cast<std::size_t>(end - first);
  const auto values = static_cast<std::size_t>(
      1 + std::count_if(first + 1, end, [&](const double& a) { return a - *(&a - 1) > 1e-9; }));
  if (width < steps_of_a_gap * all.step) {
    found.why = fmt::format("none: readings from {:.3g} A on", width);
  } else if (above < fewest_readings || values < fewest_values) {
    found.why = fmt::format(
        "no reading between 0 and {:.3g} A, and too few just above to distinguish a dead band from a load "
        "that is never so small; a log with small currents would show it",
        width);
  } else {
    const double spacing = width / static_cast<double>(above);
    found.value = {width - spacing, spacing};
    found.why = "if the load is sometimes smaller than that";
  }
  return found;
}

/// Stretches of consecutive readings at the end of the range, in rows [begin, end).
std::vector<std::pair<std::size_t, std::size_t>> clipped_stretches(const measurement::Recording& r, double largest) {
  std::vector<std::pair<std::size_t, std::size_t>> stretches;
  const auto at_end = [&](std::size_t k) {
    return std::abs(r.current_a[k] - largest) <= same_reading * std::abs(largest);
  };
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (!at_end(k)) continue;
    std::size_t end = k;
    while (end < r.rows() && at_end(end)) ++end;
    stretches.emplace_back(k, end);
    k = end;
  }
  return stretches;
}

/// more_a: for each row the current beyond the reading, by the reference or by the voltage.
void find_clipping(const measurement::Recording& r, const Readings& all, const std::vector<double>& more_a,
                   Ammeter& ammeter) {
  SensorFinding& found = ammeter.clipping_a;
  const auto stretches = clipped_stretches(r, all.largest);
  std::size_t rows = 0;
  for (const auto& [begin, end] : stretches) rows += end - begin;
  if (rows < fewest_clipped || stretches.size() < fewest_episodes) {
    found.why = fmt::format("none up to {:.4g} A: fewer than {} readings in {} stretches are as large", all.largest,
                            fewest_clipped, fewest_episodes);
    return;
  }
  // Readings a little below the end show how far the voltage or the reference is off for another reason: that grows
  // with the current.
  std::vector<double> at_end, below;
  for (const auto& [begin, end] : stretches) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t k = begin; k < end; ++k) {
      if (!known(more_a[k])) continue;
      sum += more_a[k];
      ++count;
    }
    if (count > 0) at_end.push_back(sum / static_cast<double>(count));
  }
  for (std::size_t k = 0; k < r.rows(); ++k) {
    const double share = r.current_a[k] / all.largest;
    if (share > high_reading && share < 1 - 2 * same_reading && known(more_a[k])) below.push_back(more_a[k] / share);
  }
  if (at_end.size() < fewest_episodes) {
    found.why = "not visible here: no voltage and no reference while the reading is at its largest";
    return;
  }
  if (below.size() < fewest_readings) {
    found.why =
        fmt::format("not visible here: fewer than {} readings between {:.0f} and 100 % of the largest to compare with",
                    fewest_readings, 100 * high_reading);
    return;
  }
  const Uncertain high = mean_of(at_end), low = mean_of(below);
  const double beyond = high.value - low.value, std = std::hypot(high.std, low.std);
  const double claimed_a = all.largest > 0 ? beyond : -beyond;
  const double scatter_a = low.std * std::sqrt(static_cast<double>(below.size()));  // of single readings
  const double visible_a = std::max(significant * std, 2 * scatter_a);
  if (claimed_a > visible_a) {
    found.value = {all.largest, all.step};
    ammeter.missed_a = beyond;
    found.why = fmt::format("the current goes {:.3g} +- {:.2g} A beyond it on average", std::abs(beyond), std);
  } else if (visible_a > nothing_beyond * std::abs(all.largest)) {
    found.why = fmt::format(
        "not visible here: up to {:.3g} A beyond {:.4g} A would not show, because the comparison scatters as much",
        visible_a, std::abs(all.largest));
  } else {
    found.why = fmt::format("none: {} readings of {:.4g} A, and the current does not go beyond it", rows, all.largest);
  }
}

/// Straight line through readings over the reference, without those in the dead band and at the end of the range. The
/// standard deviations count the readings of one minute as one.
void by_reference(const measurement::Recording& r, const Readings& all, Ammeter& ammeter) {
  std::vector<double> x, y, time_s;
  double high = -INFINITY, low = INFINITY;
  const bool clipped = clipped_stretches(r, all.largest).size() >= fewest_episodes;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    const bool at_end = clipped && std::abs(r.current_a[k]) >= (1 - same_reading) * std::abs(all.largest);
    if (!known(r.current_a[k]) || !known(r.current_ref_a[k]) || at_end) continue;
    if (ammeter.dead_band_a.value && r.current_a[k] == 0) continue;
    x.push_back(r.current_ref_a[k]);
    y.push_back(r.current_a[k]);
    time_s.push_back(r.time_s[k]);
    high = std::max(high, x.back());
    low = std::min(low, x.back());
  }
  if (x.size() < fewest_readings) {
    ammeter.offset_a.why = ammeter.gain.why = "fewer than 30 readings of the reference";
    return;
  }
  Eigen::MatrixXd a(static_cast<Eigen::Index>(x.size()), 2);
  const Eigen::Map<Eigen::VectorXd> reading(y.data(), static_cast<Eigen::Index>(y.size()));
  for (Eigen::Index k = 0; k < a.rows(); ++k) a.row(k) << 1, x[static_cast<std::size_t>(k)];
  const Eigen::Matrix2d inverse = (a.transpose() * a).inverse();
  const bool spread = high - low > 0.05 * std::abs(all.largest) && inverse.allFinite();
  const Eigen::Vector2d line = spread ? Eigen::Vector2d(inverse * (a.transpose() * reading))
                                      : Eigen::Vector2d(reading.mean() - a.col(1).mean(), 1);
  // covariance with errors that are correlated within a minute
  Eigen::Matrix2d middle = Eigen::Matrix2d::Zero();
  const Eigen::VectorXd error = reading - a * line;
  for (std::size_t k = 0; k < x.size();) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    const double from_s = time_s[k];
    for (; k < x.size() && time_s[k] - from_s < correlated_s; ++k)
      sum += a.row(static_cast<Eigen::Index>(k)).transpose() * error[static_cast<Eigen::Index>(k)];
    middle += sum * sum.transpose();
  }
  if (spread) {
    const Eigen::Matrix2d covariance = inverse * middle * inverse;
    ammeter.offset_a.value = {line[0], std::sqrt(covariance(0, 0))};
    ammeter.gain.value = {line[1] - 1, std::sqrt(covariance(1, 1))};
  } else {
    ammeter.offset_a.value = {line[0], std::sqrt(middle(0, 0)) / static_cast<double>(x.size())};
    ammeter.gain.why = "the reference has one current only; readings of it under load would show it";
  }
}

/// The current beyond the reading as the reference has it.
std::vector<double> beyond_by_reference(const measurement::Recording& r, const Ammeter& ammeter) {
  std::vector<double> more(r.rows(), NAN);
  const double offset = ammeter.offset_a.value ? ammeter.offset_a.value->value : 0,
               gain = ammeter.gain.value ? ammeter.gain.value->value : 0;
  for (std::size_t k = 0; k < r.rows(); ++k) more[k] = r.current_ref_a[k] - (r.current_a[k] - offset) / (1 + gain);
  return more;
}

double mean_r0_ohm(const AmmeterByCell& found, const files::CellFile& cell) {
  double r0_ohm = 0;
  for (std::size_t k = 0; k < cell.parameters.rc.r0_ohm.size; ++k) r0_ohm += cell.parameters.rc.r0_ohm[k];
  return r0_ohm * found.r0_times / static_cast<double>(cell.parameters.rc.r0_ohm.size);
}

/// The same by the voltage: what is left of it over the ohmic resistance.
std::vector<double> beyond_by_voltage(const AmmeterByCell& found, double r0_ohm) {
  std::vector<double> more(found.error_v.size());
  for (std::size_t k = 0; k < more.size(); ++k) more[k] = found.error_v[k] / r0_ohm;
  return more;
}

void gain_by_cell(const AmmeterByCell& found, const std::optional<double>& capacity_sigma, Ammeter& ammeter) {
  const Uncertain& g = found.gain_and_capacity;
  if (!found.offset_a.value)
    ammeter.gain.why = found.offset_a.why;
  else if (!found.gain_visible)
    ammeter.gain.why =
        fmt::format("only to {:.1f} %; a log between rests near full and near empty would show it", 100 * g.std);
  else if (!capacity_sigma)
    ammeter.gain.why = fmt::format(
        "not visible here: the charge balance is off by {:+.2f} +- {:.2f} %, by the gain or by the capacity of the "
        "cell "
        "file; a capacity that another instrument measured (--capacity-sigma), or readings of a trusted meter "
        "(current_ref_a) would show it",
        100 * g.value, 100 * g.std);
  else
    ammeter.gain.value = {g.value, std::hypot(g.std, *capacity_sigma)};
}

/// What the sensor reads at the rests of the log.
void offset_at_rest(const measurement::Recording& recording, const files::CellFile& cell, Ammeter& ammeter) {
  SensorFinding at_rest = reading_at_rest(recording, cell);
  if (const auto& balance = ammeter.balance_a.value; at_rest.value && balance) {
    const double apart_a = std::abs(balance->value - at_rest.value->value);
    const bool balanced = std::abs(balance->value) <= corrected_sigmas * balance->std;
    if (balanced && apart_a > corrected_sigmas * std::hypot(balance->std, at_rest.value->std))
      at_rest = {{},
                 fmt::format("it reads {} at rest, and the voltages show that this current flows",
                             amperes(at_rest.value->value))};
  }
  if (at_rest.value && !ammeter.dead_band_a.value)
    ammeter.offset_a = std::move(at_rest);
  else if (at_rest.value)
    ammeter.offset_a.why = "at rest a dead band may hide it";
  else
    ammeter.offset_a.why = std::move(at_rest.why);
  if (!ammeter.offset_a.value && !ammeter.balance_a.value)
    ammeter.offset_a.why = ammeter.balance_a.why + "; " + ammeter.offset_a.why;
}

/// The charge balance is missing if charge is missing in the count.
void without_lost_charge(Ammeter& ammeter) {
  if (!ammeter.silent.empty()) {
    ammeter.balance_a = {{}, "not visible here: the reading is 0 under load, and that charge is missing in the count"};
    ammeter.gain = ammeter.balance_a;
    return;
  }
  const double known_to_a = ammeter.balance_a.value ? ammeter.balance_a.value->std : 0;
  if (ammeter.clipping_a.value) {
    ammeter.balance_a = {{},
                         "not visible here: the readings are clipped, and the charge beyond is missing in the count"};
    ammeter.gain = ammeter.balance_a;
  } else if (ammeter.dead_band_a.value && ammeter.dead_band_a.value->value > known_to_a) {
    ammeter.balance_a = {{}, "not visible here: the charge of currents in the dead band may be missing in the count"};
    ammeter.gain = ammeter.balance_a;
  }
}

}  // namespace

Ammeter examine_ammeter(const measurement::Recording& recording, const files::CellFile& cell,
                        const std::optional<double>& capacity_sigma, const measurement::Recording* open_contactors) {
  Ammeter ammeter;
  const Readings all = readings_of(recording);
  if (all.sizes.size() < fewest_readings)
    throw files::BadInput(recording.path, 1, "fewer than 30 readings of the current, expected a log of some hours");
  ammeter.largest_reading_a = std::abs(all.largest);
  ammeter.dead_band_a = dead_band_of(all);
  ammeter.by_reference = std::count_if(recording.current_ref_a.begin(), recording.current_ref_a.end(), known) > 0;
  if (ammeter.by_reference) {
    by_reference(recording, all, ammeter);
    find_clipping(recording, all, beyond_by_reference(recording, ammeter), ammeter);
    return ammeter;
  }
  const AmmeterByCell found = ammeter_by_cell(recording, cell);
  ammeter.residual_v = found.residual_v;
  ammeter.balance_a = found.offset_a;
  gain_by_cell(found, capacity_sigma, ammeter);
  if (found.error_v.empty())
    ammeter.clipping_a.why = found.offset_a.why;
  else
    find_clipping(recording, all, beyond_by_voltage(found, mean_r0_ohm(found, cell)), ammeter);
  ammeter.silent = measurement::silent_current_text(measurement::silent_currents(recording), recording.time_s.front());
  without_lost_charge(ammeter);
  if (open_contactors == nullptr) {
    offset_at_rest(recording, cell, ammeter);
  } else {
    ammeter.offset_a = reading_without_current(*open_contactors);
    ammeter.open_contactors = ammeter.offset_a.value.has_value();
  }
  return ammeter;
}

Balance balance_of(const Ammeter& ammeter) {
  const auto& balance = ammeter.balance_a.value;
  const auto& offset = ammeter.offset_a.value;
  if (!balance) return Balance::missing;
  if (std::abs(balance->value) <= corrected_sigmas * balance->std) return Balance::balanced;
  if (!offset) return Balance::undecided;
  const double apart_a = std::abs(balance->value - offset->value);
  const bool alike = apart_a <= corrected_sigmas * std::hypot(balance->std, offset->std);
  if (alike) return std::abs(offset->value) > corrected_sigmas * offset->std ? Balance::by_sensor : Balance::undecided;
  // a load at rest is read as well, so a reading at rest that is not zero shows nothing about the cell
  const bool zero = std::abs(offset->value) <= corrected_sigmas * offset->std;
  return ammeter.open_contactors || zero ? Balance::by_cell : Balance::undecided;
}

std::string amperes(double a) {
  return std::abs(a) < 1 ? fmt::format("{:.0f} mA", 1e3 * a) : fmt::format("{:.2f} A", a);
}

AmmeterCorrection correction_of(const Ammeter& ammeter) {
  const Balance balance = balance_of(ammeter);
  // with open contactors the sensor's own error is known, whatever the cell does
  if (balance == Balance::undecided || (balance == Balance::by_cell && !ammeter.open_contactors)) return {};
  const auto larger = [](const SensorFinding& f) {
    return f.value && std::abs(f.value->value) > corrected_sigmas * f.value->std ? f.value->value : 0;
  };
  const double gain = larger(ammeter.gain), offset_a = larger(ammeter.offset_a);
  return {1 / (1 + gain) - 1, -offset_a / (1 + gain)};
}

}  // namespace bms::ammeter
