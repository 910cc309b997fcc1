// State of health from ordinary use: present capacity and resistance relative to the cell file, each with a standard
// deviation.
//
//   capacity     between two visits to steep parts of the OCV curve: counted charge over the difference of the SOCs
//                that the voltages gave, moved / (soc_b - soc_a). Possible errors of the counting widen its sigma. The
//                charge is counted with it (charge_count.hpp)
//   resistance   at current edges: change of the voltage beyond the model's, over the change of the drop that the model
//                computes for R0 and the charged part of R1, (e_k - e_k-1) / (drop_k - drop_k-1)
//
// Each is a constant that a scalar Kalman filter estimates. Its sigma has a lower limit, because errors of the tables
// persist.
#pragma once

#include <cstdint>

#include "arithmetic/scalar.hpp"
#include "measurement/sample.hpp"

namespace bms::estimator {

/// Relative to the cell file: 1 is as new.
template <class S>
struct Health {
  arithmetic::Soc<S> ratio{1};
  arithmetic::Soc<S> sigma{};
};

/// A constant, relative to the cell file, that a scalar Kalman filter estimates.
template <class S>
class LearnedRatio {
  using Ratio = arithmetic::Soc<S>;  // as fine, and a resistance beyond 8 times is another fault
  using Variance = arithmetic::Variance<S>;

 public:
  constexpr explicit LearnedRatio(double initial_sigma) : variance_(Variance(initial_sigma * initial_sigma)) {}
  [[gnu::cold, gnu::noinline]] constexpr void restore(std::int32_t ratio_ppm, std::int32_t sigma_ppm) {
    const auto sigma = arithmetic::from_micro<Ratio>(sigma_ppm);
    ratio_ = arithmetic::from_micro<Ratio>(ratio_ppm);
    variance_ = Variance(sigma * sigma);
  }
  /// Cold, like all that happens once in minutes: small instead of fast. Arguments by value: gcc would make a copy of
  /// the function for each source that passes a reference to a number.
  [[gnu::cold, gnu::noinline]] constexpr void learn(Ratio measured, Variance measured_variance, Variance least) {
    const auto gain = arithmetic::ratio<arithmetic::Fraction<S>>(variance_, Variance(variance_ + measured_variance));
    ratio_ = Ratio(ratio_ + Ratio(measured - ratio_) * gain);
    variance_ = Variance(variance_ - arithmetic::product<Variance>(variance_, gain));
    if (variance_ < least) variance_ = least;
  }
  /// Returns true if a value is off by more than the root of sigmas2 standard deviations. its_variance: of the value.
  [[gnu::cold, gnu::noinline]] constexpr bool away(const Ratio& value, const Variance& its_variance,
                                                   const arithmetic::Count<S>& sigmas2) const {
    const Ratio by = Ratio(value - ratio_);
    return Variance(by * by) > arithmetic::product<Variance>(Variance(variance_ + its_variance), sigmas2);
  }
  constexpr void double_sigma() { variance_ = arithmetic::product<Variance>(variance_, arithmetic::Count<S>(4)); }
  constexpr const Ratio& ratio() const { return ratio_; }
  constexpr const Variance& variance() const { return variance_; }
  constexpr Health<S> health() const { return {ratio_, arithmetic::root<arithmetic::Soc<S>>(variance_)}; }

 private:
  Ratio ratio_{1};
  Variance variance_;
};

template <class S>
class CapacityHealth {
  using Soc = arithmetic::Soc<S>;
  using Variance = arithmetic::Variance<S>;

 public:
  static constexpr double initial_sigma = 1e-6 * measurement::StartingCapacity{}.sigma_ppm;
  static constexpr double min_sigma = 0.003;
  static constexpr double known_soc = 0.02;      ///< voltages that give the SOC less accurately are not used
  static constexpr double min_moved_soc = 0.3;   ///< between two visits
  static constexpr double most_moved_soc = 4;    ///< no cell has moved so far: the current is wrong
  static constexpr double max_visit_soc = 0.05;  ///< charge moved during one visit
  static constexpr std::uint16_t min_readings = 10;
  static constexpr int max_sigmas = 3;  ///< a measurement that far away contradicts the estimate

  /// counted: change of the SOC by the counted charge since the last call; lost2: its variance.
  constexpr void count(const Soc& counted, const Variance& lost2) {
    if (arithmetic::magnitude(moved_) > Soc(most_moved_soc)) forget_visits();
    moved_ = Soc(moved_ + counted);
    lose(lost2);
  }
  /// A reading on a steep part. voltage_soc: SOC by the voltage alone; variance: of that, known_soc^2 at most. Returns
  /// true if the capacity has changed.
  [[gnu::cold, gnu::noinline]] constexpr bool read(const Soc& voltage_soc, const Variance& variance) {
    const bool found =
        here_.readings > 0 && arithmetic::magnitude(Soc(moved_ - begun_)) > Soc(max_visit_soc) && end_visit();
    if (here_.readings == 0) begun_ = moved_;
    if (here_.readings == 0 || variance < here_.variance) {
      here_.voltage_soc = voltage_soc;
      here_.moved = moved_;
      here_.variance = variance;
    }
    if (here_.readings < min_readings) ++here_.readings;
    return found;
  }
  /// The voltage shows no SOC: the visit ends. Returns true if the capacity has changed.
  constexpr bool leave() { return here_.readings > 0 && end_visit(); }

  /// The charge counted since the last visit has another error. variance: by which its variance grows.
  constexpr void lose(const Variance& variance) { reference_.variance = Variance(reference_.variance + variance); }
  /// Variance of the first visit, and of the charge counted since then.
  constexpr const Variance& reference_variance() const { return reference_.variance; }

  constexpr const LearnedRatio<S>& learned() const { return learned_; }
  /// Goes on with what an earlier run has found, between two visits, as the CAN message Health has it: so the replay of
  /// a log begins with the bits of the firmware. ratio_ppm: as counted; sigma_ppm: > 0.
  constexpr void restore(std::int32_t ratio_ppm, std::int32_t sigma_ppm) {
    constexpr std::int32_t sigma_step = 100;
    learned_.restore(ratio_ppm, (sigma_ppm + sigma_step / 2) / sigma_step * sigma_step);
  }

 private:
  /// The best reading of a visit.
  struct Visit {
    Soc voltage_soc{}, moved{};  ///< moved: since the reference
    Variance variance{};
    std::uint8_t readings = 0;
  };

  constexpr void forget_visits() {
    here_.readings = reference_.readings = 0;
    moved_ = Soc(0);
  }
  /// Returns true if the capacity has changed.
  [[gnu::cold, gnu::noinline]] constexpr bool end_visit() {
    const Visit visit = here_;
    here_.readings = 0;
    if (visit.readings < min_readings) return false;
    const Soc apart = Soc(visit.voltage_soc - reference_.voltage_soc);
    const bool begins = reference_.readings == 0;
    const bool far = !begins && arithmetic::magnitude(visit.moved) >= Soc(min_moved_soc) &&
                     arithmetic::magnitude(apart) >= Soc(min_moved_soc / 2);
    if (far)
      learn(arithmetic::ratio<Soc>(visit.moved, apart), visit, apart);
    else if (!begins && !(visit.variance < reference_.variance))
      return false;
    reference_ = visit;
    moved_ = Soc(moved_ - visit.moved);
    return far;
  }
  /// A battery that was replaced has another capacity: measurements that contradict the estimate open the filter. Not
  /// at once, because a measurement may be wrong by more than is known of it.
  constexpr void learn(const Soc& measured_ratio, const Visit& visit, const Soc& apart) {
    const Variance apart2 = apart * apart, moved2 = visit.moved * visit.moved;
    // (moved / apart)^2 times the relative variance of apart
    const Variance measured_variance = arithmetic::ratio<Variance>(
        arithmetic::ratio<Variance>(Variance(Variance(visit.variance + reference_.variance) * moved2), apart2), apart2);
    if (learned_.away(measured_ratio, measured_variance, arithmetic::Count<S>(max_sigmas * max_sigmas)))
      learned_.double_sigma();
    learned_.learn(measured_ratio, measured_variance, Variance(min_sigma * min_sigma));
  }

  Visit here_, reference_;
  Soc moved_{}, begun_{};  ///< charge since the reference; when the present visit began
  LearnedRatio<S> learned_{initial_sigma};
};

template <class S>
class ResistanceHealth {
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;
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
    const auto measured_ratio = arithmetic::ratio<Soc>(more_v, edge_v);
    const auto tables = Variance(table_sigma * table_sigma);
    const Variance edge_v2 = edge_v * edge_v;
    const Variance measured_variance =
        Variance(tables + arithmetic::ratio<Variance>(Variance(reading_v2 + reading_v2), edge_v2));
    learned_.learn(Soc(Soc(1) + measured_ratio), measured_variance, Variance(min_sigma * min_sigma));
  }
  /// The next reading does not follow the last one, because of a gap or a missing voltage.
  constexpr void interrupt() { follows_ = false; }

  constexpr Health<S> health() const { return learned_.health(); }
  /// Goes on with what an earlier run has found.
  constexpr void restore(std::int32_t ratio_ppm, std::int32_t sigma_ppm) { learned_.restore(ratio_ppm, sigma_ppm); }

 private:
  Voltage innovation_v_{}, drop_v_{};
  LearnedRatio<S> learned_{initial_sigma};
  bool follows_ = false;
};

}  // namespace bms::estimator
