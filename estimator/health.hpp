// State of health from ordinary use: present capacity and resistance relative to the cell file, each with a standard
// deviation.
//
//   capacity     between two visits to steep parts of the OCV curve: counted charge over the difference of the SOCs
//                that the voltages gave, moved / (soc_b - soc_a). Possible errors of the counting widen its sigma
//   resistance   at current edges: change of the voltage beyond the model's, over the change of the drop that the model
//                computes for R0 and the charged part of R1, (e_k - e_k-1) / (drop_k - drop_k-1)
//
// Each is a random constant that a scalar Kalman filter estimates. Its sigma has a lower limit, because errors of the
// tables persist.
#pragma once

#include <cstdint>

#include "arithmetic/scalar.hpp"

namespace bms::estimator {

/// Relative to the cell file: 1 is as new.
template <class S>
struct Health {
  arithmetic::Factor<S> ratio{1};
  arithmetic::Soc<S> sigma{};
};

template <class S>
class CapacityHealth {
  using Soc = arithmetic::Soc<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;

 public:
  static constexpr double initial_sigma = 0.1;  ///< standard deviation for an unmeasured cell
  static constexpr double min_sigma = 0.003;
  static constexpr double known_soc = 0.02;      ///< voltages that give the SOC less accurately are not used
  static constexpr double min_moved_soc = 0.3;   ///< between two visits
  static constexpr double max_visit_soc = 0.05;  ///< charge moved during one visit
  static constexpr std::uint16_t min_readings = 10;

  /// One reading. soc: estimate; off: SOC by the voltage alone minus soc, along the slope there; variance: of that SOC;
  /// usable: whether the voltage may be used; counted: change of the SOC by the counted charge since the last call;
  /// lost2: variance of counted.
  constexpr void update(const Soc& soc, const Soc& off, const Variance& variance, bool usable, const Soc& counted,
                        const Variance& lost2) {
    moved_ = Soc(moved_ + counted);
    if (reference_.readings > 0) reference_.variance = Variance(reference_.variance + lost2);
    // further away the slope differs
    const bool good =
        usable && variance < Variance(known_soc * known_soc) && arithmetic::magnitude(off) < Soc(known_soc);
    const Soc voltage_soc = Soc(soc + off);
    if (here_.readings > 0 && (!good || arithmetic::magnitude(Soc(moved_ - begun_)) > Soc(max_visit_soc))) end_visit();
    if (!good) return;
    if (here_.readings == 0) begun_ = moved_;
    if (here_.readings < 0x7FFF) ++here_.readings;
    const Fraction share = arithmetic::ratio<Fraction>(arithmetic::Count<S>(1), arithmetic::Count<S>(here_.readings));
    here_.voltage_soc = Soc(here_.voltage_soc + Soc(voltage_soc - here_.voltage_soc) * share);
    here_.moved = Soc(here_.moved + Soc(moved_ - here_.moved) * share);
    here_.variance =
        Variance(here_.variance + arithmetic::product<Variance>(Variance(variance - here_.variance), share));
  }

  constexpr Health<S> health() const { return {ratio_, arithmetic::root<Soc>(variance_)}; }
  /// Goes on with what an earlier run has found, between two visits.
  constexpr void restore(const Health<S>& found) {
    ratio_ = found.ratio;
    variance_ = Variance(found.sigma * found.sigma);
  }

 private:
  struct Visit {
    Soc voltage_soc{}, moved{};
    Variance variance{};
    std::uint16_t readings = 0;
  };

  constexpr void end_visit() {
    const Visit visit = here_;
    here_ = {};
    if (visit.readings < min_readings) return;
    if (reference_.readings == 0) return set_reference(visit);
    const Soc moved = Soc(visit.moved - reference_.moved);
    const Soc apart = Soc(visit.voltage_soc - reference_.voltage_soc);
    if (arithmetic::magnitude(moved) < Soc(min_moved_soc) || arithmetic::magnitude(apart) < Soc(min_moved_soc / 2)) {
      if (visit.variance < reference_.variance) set_reference(visit);
      return;
    }
    const auto measured_ratio = arithmetic::ratio<arithmetic::Factor<S>>(moved, apart);
    const auto relative =
        arithmetic::ratio<Fraction>(Variance(visit.variance + reference_.variance), Variance(apart * apart));
    const Variance measured_variance =
        arithmetic::product<Variance>(Variance(measured_ratio * measured_ratio), relative);
    const auto gain = arithmetic::ratio<Fraction>(variance_, Variance(variance_ + measured_variance));
    ratio_ = arithmetic::Factor<S>(ratio_ + arithmetic::Factor<S>(measured_ratio - ratio_) * gain);
    variance_ = Variance(variance_ - arithmetic::product<Variance>(variance_, gain));
    const auto least = Variance(min_sigma * min_sigma);
    if (variance_ < least) variance_ = least;
    set_reference(visit);
  }
  constexpr void set_reference(const Visit& visit) {
    reference_ = visit;
    // only differences matter; this keeps the numbers small
    moved_ = Soc(moved_ - visit.moved);
    begun_ = Soc(begun_ - visit.moved);
    reference_.moved = Soc(0);
  }

  Visit here_, reference_;
  Soc moved_{}, begun_{};
  arithmetic::Factor<S> ratio_{1};
  Variance variance_ = Variance(initial_sigma * initial_sigma);
};

template <class S>
class ResistanceHealth {
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using Soc = arithmetic::Soc<S>;

 public:
  static constexpr double initial_sigma = 0.3;  ///< standard deviation for an unmeasured cell
  static constexpr double min_sigma = 0.01;
  static constexpr double table_sigma = 0.05;  ///< error of the tables at one SOC and temperature
  static constexpr double min_edge_v = 0.003;

  /// A reading one step after the last one. innovation_v: measured minus predicted; drop_v: over R0 and the part of R1
  /// that was charged within the step, by the model; reading_v2: variance of a reading.
  constexpr void update(const Voltage& innovation_v, const Voltage& drop_v, const Variance& reading_v2) {
    const Voltage more_v = innovation_v - innovation_v_, edge_v = drop_v - drop_v_;
    const bool edge = follows_ && arithmetic::magnitude(edge_v) > Voltage(min_edge_v);
    innovation_v_ = innovation_v;
    drop_v_ = drop_v;
    follows_ = true;
    if (!edge) return;
    const auto measured_ratio = arithmetic::ratio<arithmetic::Factor<S>>(more_v, edge_v);
    const auto tables = Variance(table_sigma * table_sigma);
    const Variance edge_v2 = edge_v * edge_v;
    const Variance measured_variance =
        Variance(tables + arithmetic::ratio<Variance>(Variance(reading_v2 + reading_v2), edge_v2));
    const auto gain = arithmetic::ratio<Fraction>(variance_, Variance(variance_ + measured_variance));
    more_ = arithmetic::Factor<S>(more_ + arithmetic::Factor<S>(measured_ratio - more_) * gain);
    variance_ = Variance(variance_ - arithmetic::product<Variance>(variance_, gain));
    const auto least = Variance(min_sigma * min_sigma);
    if (variance_ < least) variance_ = least;
  }
  /// The next reading does not follow the last one, because of a gap or a missing voltage.
  constexpr void interrupt() { follows_ = false; }

  constexpr Health<S> health() const {
    return {arithmetic::Factor<S>(arithmetic::Factor<S>(1) + more_), arithmetic::root<Soc>(variance_)};
  }
  /// Goes on with what an earlier run has found.
  constexpr void restore(const Health<S>& found) {
    more_ = arithmetic::Factor<S>(found.ratio - arithmetic::Factor<S>(1));
    variance_ = Variance(found.sigma * found.sigma);
  }

 private:
  Voltage innovation_v_{}, drop_v_{};
  arithmetic::Factor<S> more_{0};
  Variance variance_ = Variance(initial_sigma * initial_sigma);
  bool follows_ = false;
};

}  // namespace bms::estimator
