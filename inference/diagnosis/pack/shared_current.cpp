#include "diagnosis/pack/shared_current.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>

#include "diagnosis/noise.hpp"
#include "diagnosis/pack/damped_fit.hpp"
#include "diagnosis/pack/noise_search.hpp"
#include "diagnosis/pack/pack_likelihood.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "diagnosis/pack/shared_blocks.hpp"
#include "diagnosis/pack/shared_model.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

using namespace shared;

constexpr const PackThresholds::Shared& of_shared = limits.shared;

/// The linear model around u, white.
struct Around {
  Unknowns u = Unknowns::Zero();
  NoiseModel noise;
  Eigen::Matrix<double, unknowns, unknowns> information;
  Unknowns with_data;
  double cost = std::numeric_limits<double>::infinity();  ///< -2 log posterior but for a constant
  std::vector<double> residual_v;
  RowNoise rows;
  Columns white;  ///< by block: the unknowns, and last the residual
};

Around around(const Problem& p, const Unknowns& u, const Unknowns& prior, const NoiseModel& noise) {
  const std::size_t blocks = p.blocks.count();
  const Course course = course_of(p, u);
  const double walk2 = of_shared.soc_walk * of_shared.soc_walk, beyond2 = beyond_waves(p);
  const std::vector<double> soc = p.blocks.means(course.soc), v_rc_v = p.blocks.means(course.v_rc_v);
  Around a;
  a.u = u;
  a.noise = noise;
  a.rows = RowNoise(blocks);
  Columns columns(static_cast<Eigen::Index>(blocks), unknowns + 1);
  for (std::size_t k = 0; k < blocks; ++k) {
    set_row(p, u, k, soc[k], v_rc_v[k], columns);
    const double hours = (p.blocks.time_s[k] - p.pack.time_s.front()) / 3'600;
    const double axis2 = of_shared.soc_axis * of_shared.soc_axis + walk2 * hours + beyond2,
                 slope_v = columns(static_cast<Eigen::Index>(k), start);
    a.rows.slow_v2[k] = axis2 * slope_v * slope_v;
    a.residual_v.push_back(columns(static_cast<Eigen::Index>(k), unknowns));
  }
  const Whitener whitener(noise, p.blocks.time_s, a.rows, std::vector<char>(blocks, 1));
  whitener.whiten(columns);
  const auto of_unknowns = columns.leftCols<unknowns>();
  a.information = of_unknowns.transpose() * of_unknowns;
  a.with_data = of_unknowns.transpose() * columns.col(unknowns) + a.information * u;
  a.cost =
      columns.col(unknowns).squaredNorm() + whitener.log_determinant() + (u.array() / prior.array()).square().sum();
  a.white = std::move(columns);
  return a;
}

using Normal = Eigen::Matrix<double, unknowns, unknowns>;

Normal normal_of(const Around& a, const Unknowns& prior) {
  Normal normal = a.information;
  normal.diagonal() += prior.array().square().inverse().matrix();
  return normal;
}

Around fit_from(const Problem& p, const Unknowns& from, const Unknowns& prior, const NoiseModel& noise) {
  const auto improved = [&](const Around& best, const Unknowns& u) {
    return if_less(best, around(p, u, prior, noise));
  };
  const auto normal = [&](const Around& fit) { return normal_of(fit, prior); };
  const auto target = [&](const Around& fit) -> Unknowns { return normal(fit).ldlt().solve(fit.with_data); };
  return damped_fit(around(p, from, prior, noise), &Around::u, of_shared.iterations, improved, normal, target);
}

/// A coarse search over start and offset: the OCV bends, and a fit may end where another one is better.
Unknowns starting_point(const Problem& p) {
  const Blocks& b = p.blocks;
  const std::vector<double> charge = p.blocks.means(p.charge);
  const std::size_t every = std::max<std::size_t>(1, charge.size() / limits.fit.starting_rows);
  Unknowns best = Unknowns::Zero();
  double least = std::numeric_limits<double>::infinity();
  // a step of the search moves the charge at the end by little
  const double hours_all = (p.pack.time_s.back() - p.pack.time_s.front()) / 3'600, most_c = of_shared.most_offset_c,
               step_c = most_c / std::ceil(most_c * hours_all / of_shared.search_soc);
  for (double offset_c = -most_c; offset_c <= most_c + step_c / 2; offset_c += step_c) {
    for (double z = -of_shared.most_start; z <= of_shared.most_start + of_shared.start_step / 2;
         z += of_shared.start_step) {
      Eigen::Matrix2d normal = Eigen::Matrix2d::Identity() * std::numeric_limits<double>::epsilon();
      Eigen::Vector2d right = Eigen::Vector2d::Zero();
      double square = 0;
      std::uint8_t interval = 0;
      for (std::size_t k = every - 1; k < charge.size(); k += every) {
        const double hours = (b.time_s[k] - p.pack.time_s.front()) / 3'600;
        const double soc = p.track.soc.front() + z + charge[k] - offset_c * hours;
        const double y = b.voltage_v[k] - model::look_up(p.track.cell, soc, interval).ocv_v;
        const Eigen::Vector2d column(1, b.current_a[k] - offset_c * p.track.capacity_ah);
        normal += column * column.transpose();
        right += y * column;
        square += y * y;
      }
      const double rest = square - right.dot(normal.ldlt().solve(right));
      if (rest >= least) continue;
      least = rest;
      best[start] = z;
      best[sensor_offset] = offset_c * p.track.capacity_ah;
    }
  }
  return best;
}

NoiseModel noise_of(const Problem& p, const Around& a) {
  const std::vector<char> usable(a.residual_v.size(), 1);
  return search_noise(a.noise, p.blocks.time_s, [&](const NoiseModel& noise) {
    const Whitener whitener(noise, p.blocks.time_s, a.rows, usable);
    std::vector<double> r = a.residual_v;
    whitener.whiten(0, r);
    double square = 0;
    for (const double v : r) square += v * v;
    return square + whitener.log_determinant();
  });
}

/// The best fit of all errors that the file's OCV may have; -2 log evidence decides, as their priors differ.
Around best_fit(Problem& p) {
  Around best;
  double least = std::numeric_limits<double>::infinity(), best_factor = 1;
  const Unknowns coarse = starting_point(p);
  for (std::size_t n = 0; n < of_shared.ocv_factors.size(); n += 2) {
    const double factor = of_shared.ocv_factors[n];
    Unknowns wide = healthy_of(p, factor);
    wide[sensor_offset] = of_shared.fault_offset_c * p.track.capacity_ah;
    const NoiseModel noise{.white_v = of_shared.white_v, .fast_v = of_shared.fast_v, .slow_v = of_shared.slow_v};
    for (const Unknowns& from : {Unknowns(Unknowns::Zero()), coarse}) {
      const Around first = fit_from(p, from, wide, noise);
      Around found = fit_from(p, first.u, wide, noise_of(p, first));
      const Normal normal = normal_of(found, wide);
      const double evidence =
          found.cost + normal.ldlt().vectorD().array().abs().log().sum() + 2 * wide.array().log().sum();
      if (evidence >= least) continue;
      least = evidence;
      best = std::move(found);
      best_factor = factor;
    }
  }
  p.healthy = healthy_of(p, best_factor);
  return best;
}

/// RMS over the blocks of what the OCV of these cells differs from that of the file.
double ocv_apart_v(const Problem& p, const Unknowns& u) {
  measurement::MeanSquare apart;
  for (const double soc : p.blocks.means(course_of(p, u).soc)) {
    double v = u[level];
    for (Eigen::Index w = 0; w < PackThresholds::Shared::ocv_waves; ++w)
      v += u[wave_1 + w] * std::cos(std::numbers::pi * static_cast<double>(w + 1) * soc);
    apart.add(v);
  }
  return apart.root();
}

/// By row, after the fit; empty if the count does not walk.
std::vector<double> soc_sigma_of(const Problem& p, const Around& a, const Unknowns& prior) {
  std::vector<double> sigma;
  if (!(p.pack.count_walk > 0)) return sigma;
  const Normal covariance = normal_of(a, prior).ldlt().solve(Normal::Identity());
  for (std::size_t k = 0; k < p.pack.rows(); ++k) {
    const double hours = (p.pack.time_s[k] - p.pack.time_s.front()) / 3'600;
    Unknowns row = Unknowns::Zero();
    row[start] = 1;
    row[sensor_offset] = -hours / p.track.capacity_ah;
    for (Eigen::Index w = 0; w < PackThresholds::Shared::charge_waves; ++w)
      row[charge_wave_1 + w] = charge_wave(w, hours / p.hours());
    sigma.push_back(std::sqrt(std::max(0.0, row.dot(covariance * row)) + beyond_waves(p)));
  }
  return sigma;
}

/// By row, on the resistances of the cell file.
std::vector<double> factor_of(const Problem& p, const Unknowns& u, const std::vector<double>& soc) {
  std::vector<double> factor;
  const std::vector<double> warmer_k = warmer_than_at_start(p.pack);
  for (std::size_t k = 0; k < soc.size(); ++k) {
    double f = 1 + u[all_resistance] + u[warmth] * warmer_k[k];
    for (Eigen::Index w = 0; w < PackThresholds::Shared::resistance_waves; ++w)
      f += u[resistance_wave_1 + w] * std::cos(std::numbers::pi * static_cast<double>(w + 1) * soc[k]);
    factor.push_back(std::max(of_shared.least_factor, f));
  }
  return factor;
}

struct Hypothesis {
  Eigen::Index unknown;
  Cause cause;
  double fault, least;
  double gain = 0;  ///< log likelihood ratio to a healthy sensor
};

/// Log probability of the data if this unknown has a fault of that size: the mean over how wrong the file's OCV is.
double evidence_of(const Around& a, const Problem& p, Eigen::Index unknown, double fault) {
  std::vector<double> logs;
  for (const double factor : of_shared.ocv_factors) {
    Unknowns prior = healthy_of(p, factor);
    prior[unknown] = std::hypot(prior[unknown], fault);
    logs.push_back(log_marginal(a.information, a.with_data, prior));
  }
  const double most = *std::max_element(logs.begin(), logs.end());
  double sum = 0;
  for (const double l : logs) sum += std::exp(l - most);
  return most + std::log(sum / static_cast<double>(logs.size()));
}

double gain_of(const Around& a, const Problem& p, Eigen::Index unknown, double fault) {
  return evidence_of(a, p, unknown, fault) - evidence_of(a, p, unknown, 0);
}

PackFinding finding_for(const Around& a, const Unknowns& healthy, const Hypothesis& h) {
  Unknowns prior = healthy;
  prior[h.unknown] = std::hypot(prior[h.unknown], h.fault);
  Unknowns unit = Unknowns::Zero();
  unit[h.unknown] = 1;
  const Unknowns column = normal_of(a, prior).ldlt().solve(unit);
  PackFinding f;
  f.cause = h.cause;
  f.value = column.dot(a.with_data);
  f.sigma = std::hypot(std::sqrt(std::max(0.0, column[h.unknown])), healthy[h.unknown]);
  f.gain = h.gain;
  return f;
}

std::optional<PackFinding> judge(const Problem& p, const Around& a) {
  const double q = p.track.capacity_ah;
  std::array<Hypothesis, 3> list = {{
      {sensor_offset, Cause::current_offset, of_shared.fault_offset_c * q, of_shared.least_offset_c * q, 0},
      {sensor_gain, Cause::current_gain, of_shared.fault_gain, of_shared.least_gain, 0},
      {all_capacity, Cause::all_capacity, of_shared.fault_capacity, of_shared.least_capacity, 0},
  }};
  for (Hypothesis& h : list) h.gain = gain_of(a, p, h.unknown, h.fault);
  std::stable_sort(list.begin(), list.end(), [](const auto& x, const auto& y) { return x.gain > y.gain; });
  const Hypothesis& best = list.front();
  const double needed = std::log(static_cast<double>(list.size()) / limits.fault_prior) + limits.least_odds;
  PackFinding f = finding_for(a, p.healthy, best);
  if (best.gain < needed || std::abs(f.value) < best.least || std::abs(f.value) < limits.least_sigmas * f.sigma ||
      (best.cause == Cause::all_capacity && std::abs(f.value) > of_shared.most_capacity))
    return std::nullopt;
  double sum = 1 + std::exp(needed - limits.least_odds - best.gain);
  for (std::size_t k = 1; k < list.size(); ++k) {
    const double odds = std::exp(list[k].gain - best.gain);
    if (std::abs(finding_for(a, p.healthy, list[k]).value) < list[k].least) continue;
    sum += odds;
    f.rivals.push_back({list[k].cause, std::nullopt, odds});
  }
  f.probability = 1 / sum;
  for (Rival& r : f.rivals) r.probability *= f.probability;
  std::erase_if(f.rivals, [](const Rival& r) { return r.probability < limits.listed_from; });
  return f;
}

/// First time from which on the data up to it named this cause.
std::optional<double> named_after_s(const Problem& p, const Around& all, Cause cause) {
  std::optional<double> since;
  const auto blocks = static_cast<Eigen::Index>(p.blocks.count()),
             parts = static_cast<Eigen::Index>(limits.checkpoints);
  Around a = all;
  a.information.setZero();
  a.with_data.setZero();
  for (Eigen::Index part = 1, from = 0; part <= parts; ++part) {
    const Eigen::Index to = blocks * part / parts;
    const auto of_unknowns = all.white.block(from, 0, to - from, unknowns);
    const Normal products = of_unknowns.transpose() * of_unknowns;
    a.information += products;
    a.with_data += of_unknowns.transpose() * all.white.block(from, unknowns, to - from, 1) + products * all.u;
    from = to;
    const std::optional<PackFinding> named = judge(p, a);
    if (!named || named->cause != cause) {
      since.reset();
    } else if (!since) {
      since = p.blocks.time_s[static_cast<std::size_t>(to - 1)] - p.pack.time_s.front();
    }
  }
  return since;
}

}  // namespace

SharedState shared_state_of(const Track& track, const PackRecording& pack) {
  SharedState s;
  s.not_tested = reason_not_to_test(track, pack);
  if (!s.not_tested.empty()) return s;
  Problem p{.track = track,
            .pack = pack,
            .charge = counted_charge(track, pack),
            .blocks = Blocks(track, pack),
            .healthy = {}};
  Around best = best_fit(p);
  s.finding = judge(p, best);
  s.ocv_apart_v = ocv_apart_v(p, best.u);
  // what the sensor shows follows from the file's OCV: that of another cell says nothing of it
  if (s.ocv_apart_v > of_shared.another_cell * track.ocv_tolerance_v) s.finding.reset();
  if (s.finding) s.finding->after_s = named_after_s(p, best, s.finding->cause);
  if (!s.finding) best = fit_from(p, best.u, p.healthy, best.noise);
  s.soc = course_of(p, best.u).soc;
  Unknowns prior = p.healthy;
  if (s.finding) prior[sensor_offset] = std::hypot(prior[sensor_offset], of_shared.fault_offset_c * track.capacity_ah);
  s.soc_sigma = soc_sigma_of(p, best, prior);
  s.resistance_factor = factor_of(p, best.u, s.soc);
  s.offset_a = best.u[sensor_offset];
  s.offset_sigma_a =
      finding_for(best, p.healthy,
                  {sensor_offset, Cause::current_offset, of_shared.fault_offset_c * track.capacity_ah, 0, 0})
          .sigma;
  s.gain = best.u[sensor_gain];
  s.polarisation = best.u[all_polarisation];
  return s;
}

}  // namespace bms::diagnosis::pack
