// The control hypothesis: every base parameter free within what the calibration is good for (the cell file's
// [tolerance]).
//
// A mechanism must beat this, not the frozen model: a table that is 1 mV or 2 % off is no missing physics. Each unknown
// is a standard normal one; its size in the model is its deviation:
//
//   OCV         at knots every 5 % of soc: tolerance.ocv_v; where the table bends sharply, another one beside the
//   corner: a smooth
//               curve cuts a corner of straight lines by its change of slope times some soc
//   R0, R1, C1  at knots every 10, 20, 20 %: 1, 2 and 4 times tolerance.resistance_fraction, or the identification's
//   own deviation if
//               that is more; more beyond the table's nodes, where it only carries on: towards empty resistances grow
//   capacity    0.5 %;  gain of the current 0.2 %
//   per record  initial soc; a slow wander of the current's zero, 0.1 % of 1C at most, in hours
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

/// Without its derivatives.
template <class S>
double number(const S& x) {
  if constexpr (model::Dual<S>)
    return x.a;
  else
    return x;
}

/// Values between evenly spaced knots, straight lines; constant outside.
class Hats {
 public:
  Hats() = default;
  Hats(std::vector<double> knots, std::size_t first) : knots_(std::move(knots)), first_(first) {
    for (std::size_t k = 0; k + 1 < knots_.size(); ++k) per_width_.push_back(1 / (knots_[k + 1] - knots_[k]));
  }
  std::size_t size() const { return knots_.size(); }
  const std::vector<double>& knots() const { return knots_; }
  /// What an unknown of 1 makes of the value at knot k: deviation(knot's x).
  template <class Deviation>
  Hats& scaled(Deviation deviation) {
    for (const double x : knots_) size_.push_back(deviation(x));
    return *this;
  }

  /// The unknowns u between the knots around x, in their deviations. X, U: double or a dual number.
  template <class X, class U>
  auto at(const X& x, const std::vector<U>& u) const {
    using S = decltype(x * u[0]);
    const double v = number(x);
    if (v <= knots_.front()) return S(u[first_] * size_.front());
    if (v >= knots_.back()) return S(u[first_ + knots_.size() - 1] * size_.back());
    const std::size_t k = below(v);
    const U low = u[first_ + k] * size_[k];
    return S(low + (x - knots_[k]) * per_width_[k] * (u[first_ + k + 1] * size_[k + 1] - low));
  }
  /// f(unknown, d value at x / d unknown), of those that say something there.
  template <class F>
  void each(double x, F&& f) const {
    if (x <= knots_.front()) return f(first_, size_.front());
    if (x >= knots_.back()) return f(first_ + knots_.size() - 1, size_.back());
    const std::size_t k = below(x);
    const double t = (x - knots_[k]) * per_width_[k];
    f(first_ + k, (1 - t) * size_[k]);
    f(first_ + k + 1, t * size_[k + 1]);
  }

 private:
  /// The knot at or below x, which lies between the outermost.
  std::size_t below(double x) const {
    const double steps = (x - knots_.front()) * per_width_.front();
    std::size_t k = steps >= 1 ? std::min(static_cast<std::size_t>(steps), knots_.size() - 2) : 0;
    while (x < knots_[k]) --k;
    while (x >= knots_[k + 1]) ++k;
    return k;
  }

  std::vector<double> knots_, per_width_, size_;
  std::size_t first_ = 0;
};

/// What the base parameters move in a row: the OCV; shares of R0, R1, C1; the current's zero; shares of the capacity
/// and of the gain. Each unknown acts through one of these alone, but for the start.
struct Lever {
  enum : std::size_t { ocv, r0, r1, c1, zero, capacity, gain, count };
};

class Calibration {
 public:
  struct AsItIs {
    template <class S>
    const S& operator()(std::size_t, const S& x) const {
      return x;
    }
  };

  Calibration(const model::CellParameters<>& cell, std::span<const PreparedRecording> records);

  std::size_t size() const { return size_; }

  /// Applies the unknowns to the tables at a soc. U: double or as S. pulled(lever, x): x, where a lever may be seized.
  template <class S, class U, class Pulled = AsItIs>
  void adjust(model::TablePoint<S>& at, const S& soc, const std::vector<U>& u, const Pulled& pulled = {}) const {
    at.ocv_v += pulled(Lever::ocv, ocv_.at(soc, u));
    for (const Corner& c : corners_) {
      const double apart = (number(soc) - c.soc) / c.width;
      if (apart <= -1 || apart >= 1) continue;
      const S t = (soc - S(c.soc)) * (1 / c.width);
      at.ocv_v += u[c.unknown] * (c.deviation_v * (apart < 0 ? S(1) + t : S(1) - t));
    }
    at.r0_ohm *= factor(pulled(Lever::r0, r0_.at(soc, u)));
    at.r1_ohm *= factor(pulled(Lever::r1, r1_.at(soc, u)));
    at.c1_f *= factor(pulled(Lever::c1, c1_.at(soc, u)));
  }
  /// f(lever, unknown, how far an unknown of 1 moves it), of all that act on a row. The OCV's come first among the
  /// unknowns: they move no state.
  template <class F>
  void each_lever(std::size_t record, double time_s, double soc, F&& f) const {
    const auto through = [&](std::size_t lever) {
      return [&f, lever](std::size_t unknown, double size) { f(lever, unknown, size); };
    };
    ocv_.each(soc, through(Lever::ocv));
    for (const Corner& c : corners_) {
      const double apart = std::abs(soc - c.soc) / c.width;
      if (apart < 1) f(Lever::ocv, c.unknown, c.deviation_v * (1 - apart));
    }
    r0_.each(soc, through(Lever::r0));
    r1_.each(soc, through(Lever::r1));
    c1_.each(soc, through(Lever::c1));
    offset_[record].each(time_s, through(Lever::zero));
    f(Lever::capacity, capacity_, capacity_size);
    f(Lever::gain, gain_, gain_size);
  }
  std::size_t ocv_unknowns() const { return ocv_.size() + corners_.size(); }
  std::size_t initial_soc_unknown(std::size_t record) const { return initial_soc_[record]; }

  /// Error of the current's zero.
  template <class S>
  S offset_a(std::size_t record, double time_s, const std::vector<S>& u) const {
    return offset_[record].at(time_s, u);
  }
  template <class S>
  S initial_soc_shift(std::size_t record, const std::vector<S>& u) const {
    return u[initial_soc_[record]] * initial_soc_size(record);
  }
  double initial_soc_size(std::size_t record) const { return initial_soc_sigma_[record]; }
  template <class S>
  S capacity_loss(const std::vector<S>& u) const {
    return u[capacity_] * capacity_size;
  }
  template <class S>
  S gain_error(const std::vector<S>& u) const {
    return u[gain_] * gain_size;
  }
  /// The cell with its tables and capacity as the unknowns have them: what belongs to one recording alone (its start,
  /// its wander of the zero, the gain of its sensor) is left out. Edges and nodes are added at the knots as far as a
  /// cell file holds them.
  model::CellParameters<> applied(const model::CellParameters<>& cell, const std::vector<double>& u) const;
  /// How many unknowns come before those of single recordings.
  std::size_t shared() const { return initial_soc_.front(); }

  /// Deviation of the error of the current's zero; its memory is current_offset_correlation_s of the cell file.
  double offset_a() const { return offset_a_; }

 private:
  struct Corner {
    double soc, width, deviation_v;
    std::size_t unknown;
  };
  static constexpr double capacity_size = 0.005, gain_size = 0.002;

  /// 1 + x, and as much less as more: no unknown makes a resistance negative.
  template <class S>
  static S factor(const S& x) {
    return number(x) > 0 ? S(S(1) + x) : S(S(1) / (S(1) - x));
  }

  Hats ocv_, r0_, r1_, c1_;
  std::vector<Corner> corners_;
  std::vector<Hats> offset_;
  std::vector<std::size_t> initial_soc_;
  std::vector<double> initial_soc_sigma_;
  std::size_t capacity_ = 0, gain_ = 0, size_ = 0;
  double offset_a_ = 0;
};

}  // namespace bms::diagnosis
