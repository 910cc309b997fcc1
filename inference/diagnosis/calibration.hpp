// The control hypothesis: every base parameter is free within the accuracy of the calibration (the cell file's
// [tolerance]).
//
// A mechanism must explain more than this hypothesis, not more than the frozen model: a table that is off by 1 mV or 2
// % is not missing physics. Each unknown has a standard normal prior; its size in the model is its standard deviation
// (Thresholds::Calibration):
//
//   OCV         hat functions over soc, tolerance.ocv_v or what was learned (learned_error.hpp); and one at each sharp
//   corner of the table: a smooth curve cuts
//               a corner of straight lines by its change of slope times some soc
//   R0, R1, C1  hat functions over soc, 1, 2 and 4 times tolerance.resistance_fraction, or the identification's own
//               standard deviation if that is larger; more beyond the table's nodes, where it is only extrapolated:
//               towards empty, resistances grow
//   capacity    one unknown;  gain of the current sensor  one unknown
//   share       R0's share in R0 + R1, where an identification knew both so badly that only their sum is known (rows
//               too far apart): the sum stays
//   per record  initial soc, where those read from a first voltage share the OCV's error; the branch position of a
//               hysteresis at the start; a slow wander of the current sensor's zero, over hours
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/dual.hpp"
#include "diagnosis/learned_error.hpp"
#include "diagnosis/prepared_recording.hpp"
#include "diagnosis/thresholds.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

/// Piecewise linear between knots, constant outside: one unknown per knot.
class HatFunctions {
 public:
  HatFunctions() = default;
  /// knots: ascending, two at least. first: place of the first knot's unknown. sigma(x): standard deviation at a knot.
  template <class Sigma>
  HatFunctions(std::vector<double> knots, std::size_t first, Sigma sigma) : knots_(std::move(knots)), first_(first) {
    for (std::size_t k = 0; k + 1 < knots_.size(); ++k) per_width_.push_back(1 / (knots_[k + 1] - knots_[k]));
    for (const double x : knots_) sigma_.push_back(sigma(x));
  }
  std::size_t size() const { return knots_.size(); }
  void loosen(double times) {
    for (double& s : sigma_) s *= times;
  }
  const std::vector<double>& knots() const { return knots_; }

  /// Value at x, u: all unknowns in standard deviations. X, U: double or a dual number.
  template <class X, class U>
  auto at(const X& x, const std::vector<U>& u) const {
    using S = decltype(x * u[0]);
    const double v = number(x);
    if (v <= knots_.front()) return S(u[first_] * sigma_.front());
    if (v >= knots_.back()) return S(u[first_ + knots_.size() - 1] * sigma_.back());
    const std::size_t k = below(v);
    const U low = u[first_ + k] * sigma_[k];
    return S(low + (x - knots_[k]) * per_width_[k] * (u[first_ + k + 1] * sigma_[k + 1] - low));
  }
  /// f(unknown, derivative of the value at x by it), for those with a derivative other than 0.
  template <class F>
  void each(double x, F&& f) const {
    if (x <= knots_.front()) return f(first_, sigma_.front());
    if (x >= knots_.back()) return f(first_ + knots_.size() - 1, sigma_.back());
    const std::size_t k = below(x);
    const double t = (x - knots_[k]) * per_width_[k];
    f(first_ + k, (1 - t) * sigma_[k]);
    f(first_ + k + 1, t * sigma_[k + 1]);
  }

 private:
  /// The knot at or below x, which lies between the outermost knots.
  std::size_t below(double x) const {
    const double steps = (x - knots_.front()) * per_width_.front();
    std::size_t k = steps >= 1 ? std::min(static_cast<std::size_t>(steps), knots_.size() - 2) : 0;
    while (x < knots_[k]) --k;
    while (x >= knots_[k + 1]) ++k;
    return k;
  }

  std::vector<double> knots_, per_width_, sigma_;
  std::size_t first_ = 0;
};

/// What the base parameters change in a row: the OCV; fractions of R0, R1, C1; R0's share in R0 + R1; the current
/// sensor's zero; fractions of the capacity and of the gain. Each unknown but the initial soc acts through exactly one
/// of these levers.
struct Lever {
  enum : std::size_t { ocv, r0, r1, c1, share, zero, capacity, gain, count };
};

/// Factors on the standard deviations of a law's tables.
struct Loosened {
  double ocv = 1, r0 = 1, rc = 1;
};

class Calibration {
 public:
  struct Unchanged {
    template <class S>
    const S& operator()(std::size_t, const S& x) const {
      return x;
    }
  };

  /// records: one at least, none empty. branch: each recording has a branch position of its own.
  Calibration(const model::CellParameters<>& cell, std::span<const PreparedRecording> records, bool branch = false,
              const Loosened& loosened = {}, const LearnedError& learned = {});

  /// Number of unknowns: the OCV's first, those of single recordings last.
  std::size_t size() const { return size_; }

  /// Applies the unknowns to the tables at a soc. U: double or S. pulled(lever, x): x, or x with a derivative added.
  template <class S, class U, class Pulled = Unchanged>
  void adjust(model::TablePoint<S>& at, const S& soc, const std::vector<U>& u, const Pulled& pulled = {}) const {
    at.ocv_v += pulled(Lever::ocv, ocv_.at(soc, u));
    for (const Corner& c : corners_) {
      const double apart_soc = number(soc) - c.soc;
      if (apart_soc <= -c.width || apart_soc >= c.width) continue;
      const S t = (soc - S(c.soc)) * (1 / c.width);
      at.ocv_v += u[c.unknown] * (c.sigma_v * (apart_soc < 0 ? S(1) + t : S(1) - t));
    }
    at.r0_ohm *= factor(pulled(Lever::r0, r0_.at(soc, u)));
    at.r1_ohm *= factor(pulled(Lever::r1, r1_.at(soc, u)));
    at.c1_f *= factor(pulled(Lever::c1, c1_.at(soc, u)));
    if (share_.size() == 0) return;
    using std::exp;
    const S sum_ohm = at.r0_ohm + at.r1_ohm, odds_ohm = at.r0_ohm * exp(S(pulled(Lever::share, share_.at(soc, u))));
    at.r0_ohm = sum_ohm * odds_ohm / (odds_ohm + at.r1_ohm);
    at.r1_ohm = sum_ohm - at.r0_ohm;
  }
  /// f(lever, unknown, change of the lever per unit of the unknown), for all that act on a row. The OCV's come first
  /// among the unknowns because they change no state.
  template <class F>
  void each_lever(std::size_t record, double time_s, double soc, F&& f) const {
    const auto through = [&](std::size_t lever) {
      return [&f, lever](std::size_t unknown, double size) { f(lever, unknown, size); };
    };
    ocv_.each(soc, through(Lever::ocv));
    for (const Corner& c : corners_) {
      const double apart_soc = std::abs(soc - c.soc);
      if (apart_soc < c.width) f(Lever::ocv, c.unknown, c.sigma_v * (1 - apart_soc / c.width));
    }
    r0_.each(soc, through(Lever::r0));
    r1_.each(soc, through(Lever::r1));
    c1_.each(soc, through(Lever::c1));
    if (share_.size() > 0) share_.each(soc, through(Lever::share));
    offset_[record].each(time_s, through(Lever::zero));
    f(Lever::capacity, capacity_, thresholds.calibration.capacity_sigma);
    f(Lever::gain, gain_, thresholds.calibration.gain_sigma);
  }
  std::size_t ocv_unknowns() const { return ocv_.size() + corners_.size(); }
  /// f(unknown, change of the start per unit of the unknown), for all that move the start of a recording.
  template <class F>
  void each_start(std::size_t record, F&& f) const {
    for (std::size_t k = 0; k <= record; ++k) {
      if (const double size = start_(at(record), at(k)); size != 0) f(initial_soc_[k], size);
    }
  }

  /// Error of the current sensor's zero [A].
  template <class S>
  S offset_a(std::size_t record, double time_s, const std::vector<S>& u) const {
    return offset_[record].at(time_s, u);
  }
  template <class S>
  S initial_soc_shift(std::size_t record, const std::vector<S>& u) const {
    S shift(0);
    each_start(record, [&](std::size_t unknown, double size) { shift += u[unknown] * size; });
    return shift;
  }
  /// Of the branch position at the start of a recording.
  template <class S>
  S branch_shift(std::size_t record, const std::vector<S>& u) const {
    return branch_.empty() ? S(0) : S(u[branch_[record]] * thresholds.calibration.branch_sigma);
  }
  /// Empty if no recording has a branch position of its own.
  const std::vector<std::size_t>& branch_unknowns() const { return branch_; }
  template <class S>
  S capacity_loss(const std::vector<S>& u) const {
    return u[capacity_] * thresholds.calibration.capacity_sigma;
  }
  template <class S>
  S gain_error(const std::vector<S>& u) const {
    return u[gain_] * thresholds.calibration.gain_sigma;
  }
  /// The cell with its tables and capacity moved by the unknowns. What belongs to a single recording (its start, the
  /// wander of the zero) or to the sensor (its gain) is left out. Edges and nodes are added at the knots as far as a
  /// cell file has room for them.
  model::CellParameters<> applied(const model::CellParameters<>& cell, const std::vector<double>& u) const;
  /// Number of unknowns that all recordings share; those of single recordings follow.
  std::size_t shared() const { return initial_soc_.front(); }

  /// Standard deviation of the error of the current sensor's zero [A]; its correlation time is
  /// current_offset_correlation_s of the cell file.
  double offset_a() const { return offset_a_; }

 private:
  struct Corner {
    double soc, width, sigma_v;
    std::size_t unknown;
  };
  struct SocRange {
    double low, high;
  };

  /// 1 + x, and its reciprocal for negative x: no unknown makes a resistance negative. With a wide tolerance R1 and C1
  /// became negative, the simulation diverged, and the cost of a fit of a real recording stayed 20,000 above its
  /// minimum.
  template <class S>
  static S factor(const S& x) {
    return number(x) > 0 ? S(S(1) + x) : S(S(1) / (S(1) - x));
  }
  static SocRange counted_range(const model::CellParameters<>& cell, std::span<const PreparedRecording> records);
  template <class Sigma>
  HatFunctions hat_functions(std::vector<double> knots, Sigma sigma);
  void add_ocv(const model::CellParameters<>& cell, SocRange range, const LearnedError& learned);
  void add_resistances(const model::CellParameters<>& cell, SocRange range);
  void add_record(const model::CellParameters<>& cell, const PreparedRecording& r);
  void add_starts(const model::CellParameters<>& cell, std::span<const PreparedRecording> records);
  static Eigen::Index at(std::size_t record) { return static_cast<Eigen::Index>(record); }
  model::OcvTable<double> moved_ocv(const model::OcvTable<double>& ocv, const std::vector<double>& u) const;
  model::RcTable<double> moved_rc(const model::RcTable<double>& rc, const std::vector<double>& u) const;
  /// Change of the OCV, factors of R0, R1, C1. r0_ohm, r1_ohm: of the cell at this soc.
  model::TablePoint<double> change_at(double soc, const std::vector<double>& u, double r0_ohm = 1,
                                      double r1_ohm = 1) const;

  HatFunctions ocv_, r0_, r1_, c1_, share_;
  std::vector<Corner> corners_;
  std::vector<HatFunctions> offset_;  ///< by record
  std::vector<std::size_t> initial_soc_;
  Eigen::MatrixXd start_;  ///< factor of the starts' covariance, lower triangular: by record and initial_soc_
  std::vector<std::size_t> branch_;
  std::size_t capacity_ = 0, gain_ = 0, size_ = 0;
  double offset_a_ = 0;
};

}  // namespace bms::diagnosis
