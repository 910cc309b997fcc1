// The control hypothesis: every base parameter free within what the calibration is good for (the cell file's [tolerance]).
//
// A mechanism must beat this, not the frozen model: a table that is 1 mV or 2 % off is no missing physics. Each unknown is a
// standard normal one; its size in the model is its deviation:
//
//   OCV         at knots every 5 % of soc: tolerance.ocv_v; where the table bends sharply, another one beside the corner: a smooth
//               curve cuts a corner of straight lines by its change of slope times some soc
//   R0, R1, C1  at knots every 10, 20, 20 %: 1, 2 and 4 times tolerance.resistance_fraction, or the identification's own deviation if
//               that is more; more beyond the table's nodes, where it only carries on: towards empty resistances grow
//   capacity    0.5 %;  gain of the current 0.2 %
//   per record  initial soc; a slow wander of the current's zero, 0.1 % of 1C at most, in hours
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "diagnosis/record.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

/// Values between knots, straight lines; constant outside.
class Hats {
 public:
  Hats() = default;
  Hats(std::vector<double> knots, std::size_t first) : knots_(std::move(knots)), first_(first) {}
  std::size_t size() const { return knots_.size(); }
  const std::vector<double>& knots() const { return knots_; }
  /// What an unknown of 1 makes of the value at knot k: deviation(knot's x).
  template <class Deviation>
  Hats& scaled(Deviation deviation) {
    for (const double x : knots_) size_.push_back(deviation(x));
    return *this;
  }

  /// The unknowns u between the knots around x, in their deviations.
  template <class S>
  S at(const S& x, const std::vector<S>& u) const {
    const double v = value(x);
    if (v <= knots_.front()) return u[first_] * size_.front();
    if (v >= knots_.back()) return u[first_ + knots_.size() - 1] * size_.back();
    std::size_t k = 0;
    while (v >= knots_[k + 1]) ++k;
    const S t = (x - S(knots_[k])) * (1 / (knots_[k + 1] - knots_[k])), low = u[first_ + k] * size_[k];
    return low + t * (u[first_ + k + 1] * size_[k + 1] - low);
  }

 private:
  template <class S>
  static double value(const S& x) {
    if constexpr (model::Dual<S>) return x.a;
    else return x;
  }
  std::vector<double> knots_, size_;
  std::size_t first_ = 0;
};

class Calibration {
 public:
  Calibration(const model::CellParameters<>& cell, std::span<const Record> records);

  std::size_t size() const { return size_; }

  /// Applies the unknowns to the tables at a soc.
  template <class S>
  void adjust(model::TablePoint<S>& at, const S& soc, const std::vector<S>& u) const {
    at.ocv_v += ocv_.at(soc, u);
    for (const Corner& c : corners_) {
      const double apart = (value(soc) - c.soc) / c.width;
      if (apart <= -1 || apart >= 1) continue;
      const S t = (soc - S(c.soc)) * (1 / c.width);
      at.ocv_v += u[c.unknown] * (c.deviation_v * (apart < 0 ? S(1) + t : S(1) - t));
    }
    at.r0_ohm *= factor(r0_.at(soc, u));
    at.r1_ohm *= factor(r1_.at(soc, u));
    at.c1_f *= factor(c1_.at(soc, u));
  }
  /// Error of the current's zero.
  template <class S>
  S offset_a(std::size_t record, double time_s, const std::vector<S>& u) const {
    return offset_[record].at(S(time_s), u);
  }
  template <class S>
  S initial_soc_shift(std::size_t record, const std::vector<S>& u) const {
    return u[initial_soc_[record]] * initial_soc_sigma_[record];
  }
  template <class S>
  S capacity_loss(const std::vector<S>& u) const {
    return u[capacity_] * 0.005;
  }
  template <class S>
  S gain_error(const std::vector<S>& u) const {
    return u[gain_] * 0.002;
  }
  /// The cell with its tables and capacity as the unknowns have them: what belongs to one recording alone (its start, its wander of the
  /// zero, the gain of its sensor) is left out. Edges and nodes are added at the knots as far as a cell file holds them.
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
  template <class S>
  static double value(const S& x) {
    if constexpr (model::Dual<S>) return x.a;
    else return x;
  }

  /// 1 + x, and as much less as more: no unknown makes a resistance negative.
  template <class S>
  static S factor(const S& x) {
    return value(x) > 0 ? S(S(1) + x) : S(S(1) / (S(1) - x));
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
