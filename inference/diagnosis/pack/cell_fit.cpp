#include "diagnosis/pack/cell_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>

#include "diagnosis/pack/damped_fit.hpp"
#include "diagnosis/pack/noise_search.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"

namespace bms::diagnosis::pack {

namespace {

/// The neighbours' voltage at another time than that of a row, with straight lines between the rows.
class Delayed {
 public:
  Delayed(const std::vector<double>& time_s, const std::vector<double>& v, double delay_s)
      : time_s_(time_s), v_(v), delay_s_(delay_s) {}

  struct Value {
    double v, slope_v_per_s, share_of_step;  ///< share: where between two rows, 0 .. 1
    double step_v;                           ///< between these rows
    std::size_t row;                         ///< the nearer one of them
  };
  /// Rows in ascending order.
  Value at(std::size_t row) {
    const double wanted_s = time_s_[row] - delay_s_;
    while (before_ + 2 < v_.size() && time_s_[before_ + 1] < wanted_s) ++before_;
    const double width_s = time_s_[before_ + 1] - time_s_[before_];
    share_ = 0;
    if (!(width_s > 0)) return {v_[before_], 0, 0, 0, before_};
    const double share = std::clamp((wanted_s - time_s_[before_]) / width_s, 0.0, 1.0);
    const double step_v = v_[before_ + 1] - v_[before_];
    share_ = share;
    return {v_[before_] + share * step_v, step_v / width_s, share, step_v, share > 0.5 ? before_ + 1 : before_};
  }
  /// Another column at the time of the last row.
  double between(const std::vector<double>& values) const {
    return (1 - share_) * values[before_] + share_ * values[before_ + 1];
  }

 private:
  const std::vector<double>&time_s_, &v_;
  double delay_s_, share_ = 0;
  std::size_t before_ = 0;
};

/// Columns of the parameters and, last, the difference that theta does not explain.
struct Linearised {
  Columns columns;
  RowNoise noise;
  std::vector<char> usable;
  std::vector<double> difference_v;

  std::vector<double> soc;  ///< of the cell

  explicit Linearised(std::size_t rows)
      : columns(Columns::Zero(static_cast<Eigen::Index>(rows), parameter_count + 1)),
        noise(rows),
        usable(rows, 0),
        difference_v(rows, no_value),
        soc(rows, no_value) {}
};

double change_of_soc(const Track& t, const Vector& theta, std::size_t k) {
  return std::clamp(theta[charge] + theta[capacity] * (t.soc[k] - t.soc.front()) - theta[leak] * t.days[k],
                    -limits.fit.most_soc_step, limits.fit.most_soc_step);
}

/// Additional noise of a row: the error of resistances at a step of the current, of the curve where it is steep, of the
/// moment of sampling.
void add_row_noise(const Track& t, const Vector& theta, std::size_t k, double di, double slope_v, double steeper_v,
                   double dz, const Delayed::Value& delayed, double edge, RowNoise& noise) {
  constexpr const PackThresholds::Noise& n = limits.noise;
  const auto square = [](double x) { return x * x; };
  const double added_share = std::abs(theta[resistance]) + std::abs(theta[joint]) / t.r0_ohm;
  noise.edge_v2[k] = square((n.edge_share + n.shape_share * added_share) * t.r0_ohm * di);
  const double independent = -std::expm1(-square(dz / n.ocv_reach));
  const double soc = t.soc[delayed.row] + dz, beyond = std::max({0.0, n.lowest_soc - soc, soc - n.highest_soc});
  const double unknown_ohm = n.beyond_resistance * beyond * t.r0_ohm;
  noise.edge_v2[k] += square(unknown_ohm * di / edge);
  const double track_soc = t.soc_sigma.empty() ? n.track_soc : std::hypot(n.track_soc, t.soc_sigma[delayed.row]);
  noise.slow_v2[k] = square(track_soc * steeper_v) + square((n.ocv_axis + n.beyond_axis * beyond) * slope_v) +
                     2 * square(t.ocv_tolerance_v) * independent + square(unknown_ohm * t.instant_a[delayed.row]);
  // a step of the voltage lies before or after the moment of sampling, not in between; the whitener multiplies by
  // edge^2
  noise.white_v2[k] = delayed.share_of_step * (1 - delayed.share_of_step) * square(delayed.step_v / edge);
}

/// What is left of a grown resistance in a cell that it warms up, and the derivatives.
struct Grown {
  double share, by_growth, by_law;
};

Grown grown_of(const Vector& theta, double warm_k) {
  const double law = std::max(0.0, limits.self_heating.per_k + theta[heating]), growth = theta[resistance],
               divisor = 1 + law * warm_k * (1 + growth);
  // at its end the law does not change with its parameter
  return {growth / divisor, (1 + law * warm_k) / (divisor * divisor),
          law > 0 ? -warm_k * growth * (1 + growth) / (divisor * divisor) : 0};
}

/// Sets the columns of the OCV curve's shape; returns what theta says of it.
double set_shapes(double soc, const Vector& theta, Eigen::Ref<Eigen::RowVectorXd> row) {
  const double wave = std::cos(std::numbers::pi * soc);
  double before = 1, now = wave, sum_v = 0;
  for (const Eigen::Index p : std::array<Eigen::Index, 4>{shape_1, shape_2, shape_3, shape_4}) {
    row[p] = now;
    sum_v += theta[p] * now;
    before = std::exchange(now, 2 * wave * now - before);  // cos((n + 1) x) = 2 cos(x) cos(n x) - cos((n - 1) x)
  }
  return sum_v;
}

Linearised linearise(const FitInput& input, const Vector& theta, double edge) {
  const PackRecording& pack = *input.pack;
  const Track& t = *input.track;
  const std::vector<double>& v = pack.cell_v[input.cell];
  Linearised out(pack.rows());
  Delayed delayed(pack.time_s, t.smooth_v, input.known_delay_s.value_or(theta[delay]));
  const RcVoltage own = rc_voltage_of(t, pack, theta[time_constant]);
  std::uint8_t here = 0, there = 0;
  double last_a = 0;
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    const Delayed::Value late = delayed.at(k);
    const double current_a = delayed.between(t.instant_a);
    const double di = pack.current_a[k] - last_a;
    if (std::isfinite(pack.current_a[k])) last_a = pack.current_a[k];
    const double difference_v = v[k] - t.neighbours_v[k];
    if (!std::isfinite(difference_v + current_a + late.v + di)) continue;
    const std::size_t then = late.row;  // when the channel was sampled
    if (!t.uses_moving && (t.moving[k] != 0 || t.moving[then] != 0)) continue;
    const double dz = change_of_soc(t, theta, then);
    const auto from = model::look_up(t.cell, t.soc[then], here), to = model::look_up(t.cell, t.soc[then] + dz, there);
    // not the resistances' course over the state of charge: the cell file knows it too badly to measure a charge by it
    const double slope_v = to.ocv_delta_v * to.per_width;
    // what the neighbours lose; measured, it is closer to the truth than tables that were not compared with the pack
    const double all_v = t.is_calibrated ? t.r0_by_row_ohm[then] * current_a + own.v[then] : late.v - from.ocv_v;
    const double warmer_k = input.warmer_k.empty() || !std::isfinite(input.warmer_k[k]) ? 0 : input.warmer_k[k];
    auto row = out.columns.row(static_cast<Eigen::Index>(k));
    row[charge] = slope_v;
    row[capacity] = slope_v * (t.soc[then] - t.soc.front());
    row[leak] = -slope_v * t.days[then];
    const Grown grown = grown_of(theta, t.warm_k[then]);
    row[resistance] = grown.by_growth * all_v;
    row[heating] = grown.by_law * all_v;
    row[polarisation] = own.v[then];
    row[time_constant] = (1 + grown.share + theta[polarisation]) * own.by_tau_v[then];
    row[tilt] = (t.soc[then] - 0.5) * all_v;
    row[joint] = current_a;
    row[offset] = 1;
    row[gain] = late.v;
    row[slope] = late.v - t.mean_v;
    row[delay] = input.known_delay_s ? 0 : -late.slope_v_per_s;
    row[temperature] = warmer_k * all_v;
    row[blur] = t.r0_ohm * (current_a - delayed.between(t.slow_a));
    const double course_v = (to.r0_ohm / from.r0_ohm - 1) * t.r0_by_row_ohm[then] * current_a +
                            (to.r1_ohm / from.r1_ohm - 1) * t.v_rc_v[then];
    const double shape_v = set_shapes(t.soc[then] + dz, theta, row);
    const double explained_v = to.ocv_v - from.ocv_v + course_v + theta[blur] * row[blur] + grown.share * all_v +
                               theta[polarisation] * own.v[then] + own.v[then] - t.v_rc_v[then] +
                               theta[tilt] * row[tilt] + theta[joint] * current_a + theta[offset] +
                               theta[gain] * late.v + theta[slope] * row[slope] + late.v - t.smooth_v[k] +
                               theta[temperature] * warmer_k * all_v + shape_v;
    row[parameter_count] = difference_v - explained_v;
    out.difference_v[k] = difference_v;
    out.usable[k] = 1;
    out.soc[k] = t.soc[then] + dz;
    add_row_noise(t, theta, k, di, slope_v, slope_v - from.ocv_delta_v * from.per_width, dz, late, edge, out.noise);
  }
  return out;
}

/// Sums of products up to each checkpoint, for the data with what theta explains added again.
void add_information(const FitInput& input, CellFit& fit) {
  const auto rows = static_cast<Eigen::Index>(input.pack->rows());
  const Eigen::Index checkpoints = static_cast<Eigen::Index>(limits.checkpoints);
  Information sum;
  Eigen::Index from = 0;
  fit.until.clear();
  for (Eigen::Index c = 1; c <= checkpoints; ++c) {
    const Eigen::Index to = rows * c / checkpoints;
    if (to == from) continue;
    const auto block = fit.white.middleRows(from, to - from);
    const auto columns = block.leftCols<parameter_count>();
    Matrix products = Matrix::Zero();
    products.selfadjointView<Eigen::Lower>().rankUpdate(columns.transpose());
    products.triangularView<Eigen::StrictlyUpper>() = products.transpose();
    sum.of_parameters += products;
    sum.with_data += columns.transpose() * block.col(parameter_count) + products * fit.theta;
    sum.until_s = input.pack->time_s[static_cast<std::size_t>(to - 1)];
    fit.until.push_back(sum);
    from = to;
  }
}

/// Reduces the weight of rows by how much larger the residual is than its noise, where the cell had this state of
/// charge: there, the model is not as exact as between typical cells, and the information is less.
void weigh_by_misfit(CellFit& fit) {
  constexpr const PackThresholds::Misfit& m = limits.misfit;
  const auto bin_of = [&](std::size_t k) {
    return static_cast<std::size_t>(std::clamp(fit.soc[k], 0.0, 1.0) * static_cast<double>(m.bins - 1));
  };
  std::array<double, m.bins> squares, rows;
  squares.fill(m.prior_rows);  // of variance 1
  rows.fill(m.prior_rows);
  for (std::size_t k = 0; k < fit.soc.size(); ++k) {
    if (!std::isfinite(fit.soc[k])) continue;
    const double residual = fit.white(static_cast<Eigen::Index>(k), parameter_count);
    squares[bin_of(k)] += residual * residual;
    ++rows[bin_of(k)];
  }
  for (std::size_t k = 0; k < fit.soc.size(); ++k) {
    if (!std::isfinite(fit.soc[k])) continue;
    const double ratio = squares[bin_of(k)] / rows[bin_of(k)];
    if (ratio > 1) fit.white.row(static_cast<Eigen::Index>(k)) /= std::sqrt(ratio);
  }
}

double square_of_prior(const Vector& theta, const Vector& prior) {
  return (theta.array() / prior.array()).square().sum();
}

/// NaN where a row is not used.
std::vector<double> residual_of(const Linearised& l) {
  std::vector<double> residual_v(l.usable.size(), no_value);
  for (std::size_t k = 0; k < residual_v.size(); ++k) {
    if (l.usable[k] != 0) residual_v[k] = l.columns(static_cast<Eigen::Index>(k), parameter_count);
  }
  return residual_v;
}

double white_square(const Whitener& whitener, std::vector<double> residual_v) {
  for (double& v : residual_v) v = std::isfinite(v) ? v : 0;
  whitener.whiten(0, residual_v);
  double square = 0;
  for (const double v : residual_v) square += v * v;
  return square;
}

/// Linearised and whitened around theta; cost: -2 log posterior but for a constant.
CellFit around(const FitInput& input, const Vector& theta, const Vector& prior, const NoiseModel& noise) {
  CellFit fit;
  fit.theta = theta;
  fit.noise = noise;
  Linearised l = linearise(input, theta, noise.edge);
  const Whitener whitener(noise, input.pack->time_s, l.noise, l.usable);
  fit.difference_v = std::move(l.difference_v);
  fit.residual_v = residual_of(l);
  whitener.whiten(l.columns);
  fit.used = whitener.used();
  fit.white = std::move(l.columns);
  fit.soc = std::move(l.soc);
  fit.row_noise = std::move(l.noise);
  fit.square = fit.white.col(parameter_count).squaredNorm();
  add_information(input, fit);
  fit.cost = fit.square + whitener.log_determinant() + square_of_prior(theta, prior);
  return fit;
}

/// The fit at theta, if it explains the readings better with the noise that they have around `best`. The noise grows
/// with the size of a delay or a resistance, whichever its sign: at 0 the cost has an edge that no step may get over.
std::optional<Improved<CellFit>> improved_with_same_noise(const FitInput& input, const CellFit& best,
                                                          const Vector& theta, const Vector& prior) {
  const Linearised l = linearise(input, theta, best.noise.edge);
  const Whitener whitener(best.noise, input.pack->time_s, best.row_noise, l.usable);
  const double gain = best.square + square_of_prior(best.theta, prior) - white_square(whitener, residual_of(l)) -
                      square_of_prior(theta, prior);
  if (!(gain > 0)) return std::nullopt;
  return Improved<CellFit>{around(input, theta, prior, best.noise), gain};
}

Matrix normal_of(const Information& data, const Vector& prior) {
  Matrix normal = data.of_parameters;
  normal.diagonal() += prior.array().square().inverse().matrix();
  return normal;
}

}  // namespace

Vector starting_point(const FitInput& input, double lag_s) {
  constexpr const PackThresholds::Fit& f = limits.fit;
  const PackRecording& pack = *input.pack;
  const Track& t = *input.track;
  const std::size_t every = std::max<std::size_t>(1, pack.rows() / f.starting_rows);
  Vector best = Vector::Zero(), theta = Vector::Zero();
  double least = std::numeric_limits<double>::infinity();
  for (double z = -f.most_charge; z <= f.most_charge + f.charge_step / 2; z += f.charge_step) {
    for (double q = -f.most_capacity; q <= f.most_capacity + f.capacity_step / 2; q += f.capacity_step) {
      theta[charge] = z;
      theta[capacity] = q;
      // best offset and resistance for this change of the state of charge
      Eigen::Matrix2d normal = Eigen::Matrix2d::Identity() * std::numeric_limits<double>::epsilon();
      Eigen::Vector2d right = Eigen::Vector2d::Zero();
      double square = 0;
      std::uint8_t here = 0, there = 0;
      for (std::size_t k = every - 1; k < pack.rows(); k += every) {
        const double difference_v = pack.cell_v[input.cell][k] - t.neighbours_v[k];
        if (!std::isfinite(difference_v + pack.current_a[k])) continue;
        const double to_v = model::look_up(t.cell, t.soc[k] + change_of_soc(t, theta, k), there).ocv_v;
        const double y = difference_v - to_v + model::look_up(t.cell, t.soc[k], here).ocv_v;
        const Eigen::Vector2d column(1, pack.current_a[k]);
        normal += column * column.transpose();
        right += y * column;
        square += y * y;
      }
      const double rest = square - right.dot(normal.ldlt().solve(right));
      const double prior = (z * z + q * q) * std::numeric_limits<double>::epsilon();
      if (rest + prior >= least) continue;
      least = rest + prior;
      best = theta;
    }
  }
  best[delay] = lag_s;
  return best;
}

CellFit fit_cell(const FitInput& input, const Vector& start, const Vector& prior, const NoiseModel& noise) {
  const auto normal = [&](const CellFit& fit) { return normal_of(fit.all(), prior); };
  const auto target = [&](const CellFit& fit) -> Vector { return normal(fit).ldlt().solve(fit.all().with_data); };
  const auto fit_by = [&](CellFit from, const auto& improved) {
    return damped_fit(std::move(from), &CellFit::theta, limits.fit.iterations, improved, normal, target);
  };
  CellFit fit = fit_by(around(input, start, prior, noise), [&](const CellFit& best, const Vector& theta) {
    return if_less(best, around(input, theta, prior, noise));
  });
  if (fit.theta == start) {
    fit = fit_by(std::move(fit), [&](const CellFit& best, const Vector& theta) {
      return improved_with_same_noise(input, best, theta, prior);
    });
  }
  weigh_by_misfit(fit);
  add_information(input, fit);
  fit.white.resize(0, 0);
  fit.soc = {};
  fit.lasting_v2 = std::move(fit.row_noise.slow_v2);
  for (double& v2 : fit.lasting_v2) v2 += noise.slow_v * noise.slow_v;
  fit.row_noise = RowNoise();
  return fit;
}

NoiseModel noise_of(const FitInput& input, const CellFit& fit) {
  const Linearised l = linearise(input, fit.theta, 1);
  const std::vector<double>& time_s = input.pack->time_s;
  return search_noise(fit.noise, time_s, [&](const NoiseModel& noise) {
    RowNoise rows = l.noise;
    for (double& white_v2 : rows.white_v2) white_v2 /= noise.edge * noise.edge;
    const Whitener whitener(noise, time_s, rows, l.usable);
    return white_square(whitener, fit.residual_v) + whitener.log_determinant();
  });
}

}  // namespace bms::diagnosis::pack
