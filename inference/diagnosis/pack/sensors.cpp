#include "diagnosis/pack/sensors.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

constexpr const PackThresholds::Sensors& of_sensors = limits.sensors;

/// What the sensors show at the start, before a load has warmed the cells, and over the recording: medians.
struct SensorLevels {
  std::vector<double> at_start_k, overall_k;
};

SensorLevels levels_of(const PackRecording& pack) {
  SensorLevels levels;
  for (const std::vector<double>& sensor : pack.sensor_c) {
    levels.overall_k.push_back(measurement::median(sensor));
    std::vector<double> first = sensor;
    first.resize(std::min(first.size(), of_sensors.start_rows));
    levels.at_start_k.push_back(measurement::median(first));
  }
  return levels;
}

/// Which sensors are at fault, as a set of bits, and its logarithmic probability but for a constant.
struct FaultySet {
  std::uint64_t sensors = 0;
  double log_p = 0;
  bool has(std::size_t m) const { return ((sensors >> m) & std::uint64_t{1}) != 0; }
};

/// The course of the temperature over the pack: a level, the middle against the ends, one end against the other.
Eigen::Vector3d course_at(std::size_t sensor, std::size_t of) {
  const double place = (2 * static_cast<double>(sensor) + 1) / static_cast<double>(of) - 1;
  return {1, 1 - place * place, place};
}

/// Least squares of the levels, with the faulty ones known worse; the level is unknown, the rest of the course is
/// small.
struct CourseFit {
  double log_p = 0;    ///< of the levels, integrated over the course, but for a constant
  double rest_k2 = 0;  ///< mean square of the usual sensors' rest
};

CourseFit fit_course(std::uint64_t faulty, const std::vector<double>& x, double healthy_k) {
  Eigen::Matrix3d normal =
      Eigen::Vector3d(0, std::pow(of_sensors.middle_k, -2), std::pow(of_sensors.end_k, -2)).asDiagonal();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  CourseFit fit;
  double square = 0;
  const auto is_bad = [&](std::size_t m) { return ((faulty >> m) & std::uint64_t{1}) != 0; };
  const auto from_first = [&](std::size_t m) { return x[m] - x.front(); };
  for (std::size_t m = 0; m < x.size(); ++m) {
    const double variance = healthy_k * healthy_k + (is_bad(m) ? of_sensors.fault_k * of_sensors.fault_k : 0);
    const Eigen::Vector3d c = course_at(m, x.size());
    normal += c * c.transpose() / variance;
    right += from_first(m) * c / variance;
    square += from_first(m) * from_first(m) / variance;
    fit.log_p -= std::log(variance) / 2;
    if (is_bad(m)) fit.log_p += std::log(limits.fault_prior / static_cast<double>(x.size()));
  }
  const Eigen::Vector3d course = normal.ldlt().solve(right);
  fit.log_p -= (std::log(normal.determinant()) + square - right.dot(course)) / 2;
  double usual = 0;
  for (std::size_t m = 0; m < x.size(); ++m) {
    if (is_bad(m)) continue;
    fit.rest_k2 += std::pow(from_first(m) - course_at(m, x.size()).dot(course), 2);
    ++usual;
  }
  fit.rest_k2 /= std::max(1.0, usual - of_sensors.course_parameters);
  return fit;
}

/// All sets of at most half of the sensors, or of two; the most probable one first.
std::vector<FaultySet> faulty_sets(const std::vector<double>& x, double healthy_k) {
  const std::size_t most = std::clamp<std::size_t>(x.size() / 2, 2, of_sensors.most_faulty);
  std::vector<FaultySet> sets = {{0, fit_course(0, x, healthy_k).log_p}};
  std::vector<std::uint64_t> larger = {0};
  for (std::size_t size = 1; size <= most; ++size) {
    std::vector<std::uint64_t> smaller = std::move(larger);
    larger.clear();
    for (const std::uint64_t set : smaller) {
      for (auto m = static_cast<std::size_t>(std::bit_width(set)); m < x.size(); ++m) {
        larger.push_back(set | (std::uint64_t{1} << m));
        sets.push_back({larger.back(), fit_course(larger.back(), x, healthy_k).log_p});
      }
    }
  }
  const auto more = [](const FaultySet& a, const FaultySet& b) { return a.log_p > b.log_p; };
  std::stable_sort(sets.begin(), sets.end(), more);
  const double largest = sets.front().log_p;
  double sum = 0;
  for (const FaultySet& s : sets) sum += std::exp(s.log_p - largest);
  for (FaultySet& s : sets) s.log_p -= largest + std::log(sum);
  return sets;
}

double log_p_of(const std::vector<FaultySet>& sets, std::uint64_t sensors) {
  return std::find_if(sets.begin(), sets.end(), [&](const FaultySet& s) { return s.sensors == sensors; })->log_p;
}

/// Of the sensor m: that it is at fault.
double probability_of(const std::vector<FaultySet>& sets, std::size_t m) {
  double sum = 0;
  for (const FaultySet& s : sets) sum += s.has(m) ? std::exp(s.log_p) : 0;
  return sum;
}

/// Difference to the sensors that are not in the set, of the levels.
double apart_from_others(const std::vector<double>& x, const FaultySet& set, std::size_t m) {
  std::vector<double> others;
  for (std::size_t o = 0; o < x.size(); ++o) {
    if (o != m && !set.has(o)) others.push_back(x[o]);
  }
  return x[m] - measurement::median(others);
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
  if (sensors < of_sensors.least_sensors || sensors > of_sensors.most_sensors) return findings;
  const SensorLevels levels = levels_of(pack);
  for (const double level : levels.at_start_k) {
    if (!std::isfinite(level)) return findings;
  }
  double healthy = of_sensors.healthy_k;
  std::vector<FaultySet> sets = faulty_sets(levels.at_start_k, healthy);
  if (sensors >= of_sensors.many_sensors) {  // fewer do not show their own spread
    healthy = std::max(healthy, std::sqrt(fit_course(sets.front().sensors, levels.at_start_k, healthy).rest_k2));
    sets = faulty_sets(levels.at_start_k, healthy);
  }
  const FaultySet& best = sets.front();
  for (std::size_t m = 0; m < sensors; ++m) {
    if (!best.has(m)) continue;
    const double start_k = apart_from_others(levels.at_start_k, best, m),
                 all_k = apart_from_others(levels.overall_k, best, m);
    // an offset is there from the start; what a load warms is not
    const double offset_k = std::abs(start_k) < std::abs(all_k) ? start_k : all_k;
    const double gain = best.log_p - log_p_of(sets, best.sensors & ~(std::uint64_t{1} << m));
    if (!(std::abs(offset_k) > of_sensors.least_k) || start_k * all_k < 0 || gain < of_sensors.odds) continue;
    PackFinding f;
    f.cause = Cause::thermistor;
    f.cell = m;
    f.value = offset_k;
    f.sigma = healthy;
    f.gain = gain;
    f.probability = probability_of(sets, m);
    for (std::size_t o = 0; o < sensors; ++o) {
      const double p = best.has(o) ? 0 : probability_of(sets, o);
      if (p >= limits.listed_from) f.rivals.push_back({Cause::thermistor, o, p});
    }
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
