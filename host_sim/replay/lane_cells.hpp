// Charge and tables of several cells, one in each lane.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "arithmetic/lanes.hpp"
#include "estimator/charge.hpp"
#include "model/cell.hpp"

namespace bms::model {

template <std::size_t Registers>
struct ChargeScale<arithmetic::Lanes<Registers>> {
  using S = arithmetic::Lanes<Registers>;
  template <class T>
  using Each = std::array<T, S::size>;

  Each<std::int32_t> shift{};
  S soc_per_count, counts_per_soc;

  void set(std::size_t lane, const ChargeScale<float>& one) {
    shift[lane] = one.shift;
    soc_per_count.set(lane, one.soc_per_count);
    counts_per_soc.set(lane, one.counts_per_soc);
  }
};

}  // namespace bms::model

namespace bms::estimator {

/// Counts in integers, as the charge of one cell does, within +-4 capacities. It does not limit the SOC: a lane is at
/// its limits where in_range() is false.
template <std::size_t Registers>
class Charge<arithmetic::Lanes<Registers>> {
  using S = arithmetic::Lanes<Registers>;
  using Int = arithmetic::IntLanes<Registers>;
  using Scale = model::ChargeScale<S>;

 public:
  /// Largest change by one count, in capacities: 1.25 + 1 + 1.25 are less than 4.
  static constexpr std::int64_t most_counted = 1;

  void set(std::size_t lane, std::int64_t uaus) { uaus_[lane] = uaus; }
  std::int64_t get(std::size_t lane) const { return uaus_[lane]; }

  void count(const typename Int::Array& current_ua, const std::array<std::int64_t, S::size>& duration_us) {
    for (std::size_t k = 0; k < S::size; ++k) uaus_[k] += current_ua[k] * duration_us[k];
  }
  void correct(const S& delta, const Scale& scale) {
    const auto counts = to_counts(delta, scale).array();
    for (std::size_t k = 0; k < S::size; ++k) uaus_[k] += std::int64_t{counts[k]} << scale.shift[k];
  }
  S soc(const Scale& scale) const {
    const Int counts = Int::each([&](std::size_t k) { return uaus_[k] >> scale.shift[k]; });
    return counts.template as<S>() * scale.soc_per_count;
  }

  /// Returns where the charge of one cell would not be limited.
  static typename S::Mask in_range(const S& soc) {
    constexpr float margin = 0.01F;
    return (soc > S(static_cast<float>(model::min_soc) + margin)) &
           (soc < S(static_cast<float>(model::max_soc) - margin));
  }

  friend Charge select(const typename S::Mask& mask, const Charge& a, const Charge& b) {
    Charge c;
    for (std::size_t k = 0; k < S::size; ++k) c.uaus_[k] = mask[k] ? a.uaus_[k] : b.uaus_[k];
    return c;
  }

 private:
  static Int to_counts(const S& delta, const Scale& scale) {
    const S most(static_cast<float>(model::max_soc)), half(0.5F), none;
    S clamped = select(delta > most, most, delta);
    clamped = select(delta < -most, -most, clamped);
    clamped = select(delta == delta, clamped, none);
    return (clamped * scale.counts_per_soc + select(clamped < none, -half, half)).template as<Int>();
  }
  std::array<std::int64_t, S::size> uaus_{};
};

}  // namespace bms::estimator

namespace bms::replay {

using LaneCell = model::Cell<float, model::max_intervals>;

/// A cell for each lane. The cells may be the same, or differ in everything.
template <std::size_t Registers>
struct LaneCells {
  using S = arithmetic::Lanes<Registers>;
  using Int = arithmetic::IntLanes<Registers>;

  std::array<const LaneCell*, S::size> cell{};
  model::ChargeScale<S> charge;
  model::FilterNoise<S> noise;  ///< what an ordinary step uses: model_v2, v_rc_v2
  Int current_max_ua, voltage_min_uv, voltage_max_uv;

  void set(std::size_t lane, const LaneCell& one) {
    cell[lane] = &one;
    charge.set(lane, one.charge);
    noise.model_v2.set(lane, one.noise.model_v2);
    noise.v_rc_v2.set(lane, one.noise.v_rc_v2);
    current_max_ua.set(lane, one.plausible.current_max_ua);
    voltage_min_uv.set(lane, one.plausible.voltage_min_uv);
    voltage_max_uv.set(lane, one.plausible.voltage_max_uv);
  }
};

/// The interval of each lane, from the last look-up. A lane moves to another one in few steps.
template <std::size_t Registers>
struct LaneIntervals {
  using S = arithmetic::Lanes<Registers>;

  model::Interval<S> interval;
  S from{1e30F}, to{-1e30F};  ///< nothing is loaded yet
  std::array<std::uint8_t, S::size> index{};

  void load(std::size_t lane, const LaneCell& cell, float soc) {
    const std::size_t k = model::interval_of(cell, soc, index[lane]);
    const model::Interval<float>& one = cell.interval[k];
    index[lane] = static_cast<std::uint8_t>(k);
    from.set(lane, cell.edge[k]);
    to.set(lane, cell.edge[k + 1]);
    model::Interval<S>& i = interval;
    i.start.set(lane, one.start);
    i.per_width.set(lane, one.per_width);
    i.ocv_v.set(lane, one.ocv_v);
    i.ocv_delta_v.set(lane, one.ocv_delta_v);
    i.r0_ohm.set(lane, one.r0_ohm);
    i.r0_delta_ohm.set(lane, one.r0_delta_ohm);
    i.r1_ohm.set(lane, one.r1_ohm);
    i.r1_delta_ohm.set(lane, one.r1_delta_ohm);
    i.c1_f.set(lane, one.c1_f);
    i.c1_delta_f.set(lane, one.c1_delta_f);
    i.gap.set(lane, one.gap);
    i.gap_delta.set(lane, one.gap_delta);
    i.error_v2.set(lane, one.error_v2);
  }
};

/// The tables of each lane at its SOC.
template <std::size_t Registers>
model::TablePoint<arithmetic::Lanes<Registers>> look_up(const LaneCells<Registers>& cells,
                                                        const arithmetic::Lanes<Registers>& soc,
                                                        LaneIntervals<Registers>& intervals) {
  using S = arithmetic::Lanes<Registers>;
  if (const auto inside = (soc >= intervals.from) & (soc < intervals.to); !all(inside)) [[unlikely]] {
    for (std::size_t lane = 0; lane < S::size; ++lane) {
      if (!inside[lane]) intervals.load(lane, *cells.cell[lane], soc[lane]);
    }
  }
  return model::point_in(intervals.interval, soc);
}

}  // namespace bms::replay
