#include "diagnosis/pack/sensors.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

constexpr const PackThresholds::Sensors& of_sensors = limits.sensors;

/// Log density of a centred normal variable.
double log_normal(double x, double sigma) { return -std::log(sigma) - x * x / (2 * sigma * sigma); }

/// By row: median of all sensors. With three of them, a faulty one does not move it.
std::vector<double> median_of_sensors(const PackRecording& pack) {
  std::vector<double> medians, values;
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    values.clear();
    for (const auto& sensor : pack.sensor_c) values.push_back(sensor[k]);
    medians.push_back(measurement::median(values));
  }
  return medians;
}

/// Means over blocks of rows in which all cells have a reading.
struct Block {
  double apart_v = 0, current_a = 0, sum_v = 0, rows = 0;
};

std::vector<Block> blocks_of(const PackRecording& pack) {
  std::vector<Block> blocks(1);
  double since_s = pack.time_s.front();
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    double sum_v = 0;
    for (const auto& v : pack.cell_v) sum_v += v[k];
    if (!std::isfinite(sum_v + pack.pack_v[k] + pack.current_a[k])) continue;
    if (pack.time_s[k] - since_s > 60 * 1.0 && blocks.back().rows > 0) {
      blocks.emplace_back();
      since_s = pack.time_s[k];
    }
    Block& b = blocks.back();
    b.apart_v += pack.pack_v[k] - sum_v;
    b.current_a += pack.current_a[k];
    b.sum_v += sum_v;
    ++b.rows;
  }
  if (blocks.back().rows == 0) blocks.pop_back();
  for (Block& b : blocks) {
    b.apart_v /= b.rows;
    b.current_a /= b.rows;
    b.sum_v /= b.rows;
  }
  return blocks;
}

}  // namespace

std::vector<PackFinding> check_thermistors(const PackRecording& pack) {
  std::vector<PackFinding> findings;
  const std::size_t sensors = pack.sensor_c.size();
  if (sensors < of_sensors.least_sensors) return findings;
  std::vector<double> apart(sensors), at_start(sensors);
  const std::vector<double> middle_c = median_of_sensors(pack);
  for (std::size_t m = 0; m < sensors; ++m) {
    std::vector<double> differences;
    for (std::size_t k = 0; k < pack.rows(); ++k) differences.push_back(pack.sensor_c[m][k] - middle_c[k]);
    apart[m] = measurement::median(differences);
    differences.resize(std::min(differences.size(), of_sensors.start_rows));
    at_start[m] = measurement::median(differences);
  }
  for (std::size_t m = 0; m < sensors; ++m) {
    std::vector<double> of_others;
    for (std::size_t o = 0; o < sensors; ++o) {
      if (o != m) of_others.push_back(std::abs(apart[o]));
    }
    const double spread = measurement::median(of_others) / abs_median_of_normal;
    const double healthy = std::max(of_sensors.healthy_k, spread);
    // an offset is there from the start; what a load warms is not
    const double offset_k = std::abs(at_start[m]) < std::abs(apart[m]) ? at_start[m] : apart[m];
    const double odds = log_normal(offset_k, std::hypot(healthy, of_sensors.fault_k)) - log_normal(offset_k, healthy);
    if (!(std::abs(offset_k) > of_sensors.least_k) || at_start[m] * apart[m] < 0 ||
        odds < of_sensors.odds + std::log(static_cast<double>(sensors)))
      continue;
    PackFinding f;
    f.cause = Cause::thermistor;
    f.cell = m;
    f.value = offset_k;
    f.sigma = healthy;
    f.gain = odds;
    f.probability = 1 - std::exp(-(odds - std::log(static_cast<double>(sensors) / limits.fault_prior)));
    findings.push_back(std::move(f));
  }
  return findings;
}

std::vector<double> warmer_than_mean(const PackRecording& pack, std::size_t cell,
                                     const std::vector<PackFinding>& bad_sensors) {
  std::vector<std::size_t> good;
  for (std::size_t m = 0; m < pack.sensor_c.size(); ++m) {
    const bool bad =
        std::any_of(bad_sensors.begin(), bad_sensors.end(), [&](const PackFinding& f) { return f.cell == m; });
    if (!bad) good.push_back(m);
  }
  if (good.size() < 2) return {};
  // each sensor is in the middle of its share of the cells; straight lines between them
  const auto place_of = [&](std::size_t n, std::size_t of) {
    return (static_cast<double>(n) + 0.5) / static_cast<double>(of);
  };
  const double place = place_of(cell, pack.cells());
  std::size_t next = 1;
  while (next + 1 < good.size() && place_of(good[next], pack.sensor_c.size()) < place) ++next;
  const double from = place_of(good[next - 1], pack.sensor_c.size()), to = place_of(good[next], pack.sensor_c.size()),
               share = std::clamp((place - from) / (to - from), 0.0, 1.0);
  std::vector<double> warmer(pack.rows(), 0.0);
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    double mean = 0;
    for (const std::size_t m : good) mean += pack.sensor_c[m][k] / static_cast<double>(good.size());
    const double here = (1 - share) * pack.sensor_c[good[next - 1]][k] + share * pack.sensor_c[good[next]][k];
    if (std::isfinite(here + mean)) warmer[k] = here - mean;
  }
  return warmer;
}

std::vector<PackFinding> check_pack_voltage(const PackRecording& pack, const Track& track) {
  std::vector<PackFinding> findings;
  if (pack.pack_v.empty()) return findings;
  const std::vector<Block> blocks = blocks_of(pack);
  if (blocks.size() < limits.unexplained.cells) return findings;
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  double sum_v = 0;
  for (const Block& b : blocks) {
    const Eigen::Vector2d column(1, b.current_a);
    normal += column * column.transpose();
    right += b.apart_v * column;
    sum_v += b.sum_v / static_cast<double>(blocks.size());
  }
  normal(1, 1) += std::numeric_limits<double>::epsilon();
  const Eigen::Vector2d fit = normal.ldlt().solve(right);
  double square = 0;
  for (const Block& b : blocks) square += std::pow(b.apart_v - fit[0] - fit[1] * b.current_a, 2);
  const double variance = square / static_cast<double>(blocks.size());
  const Eigen::Matrix2d covariance = normal.inverse() * variance;
  const double cells = static_cast<double>(pack.cells());
  const auto add = [&](Cause cause, double value, double sigma, double healthy, double scale) {
    const double all = std::hypot(sigma, healthy);
    if (std::abs(value) < of_sensors.pack_sigmas * all) return;
    PackFinding f;
    f.cause = cause;
    f.value = value / scale;
    f.sigma = all / scale;
    f.gain = value * value / (2 * all * all);
    f.probability = 1 - std::exp(-f.gain) / limits.fault_prior;
    findings.push_back(std::move(f));
  };
  const double healthy_v = std::hypot(of_sensors.pack_gain * sum_v, of_sensors.parallel_v * cells);
  add(Cause::pack_voltage, fit[0], std::sqrt(covariance(0, 0)), healthy_v, sum_v);
  if (fit[1] > 0)
    add(Cause::joint, fit[1], std::sqrt(covariance(1, 1)), of_sensors.pack_joint_share * cells * track.r0_ohm, 1);
  return findings;
}

}  // namespace bms::diagnosis::pack
