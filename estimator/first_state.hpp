// The state of an estimator at its first sample: from a starting point, from the first voltage, or from both.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "estimator/ambiguous_soc.hpp"
#include "estimator/cell_state.hpp"
#include "estimator/start.hpp"
#include "estimator/voltage_uncertainty.hpp"
#include "measurement/sample.hpp"
#include "model/extended_rc.hpp"

namespace bms::estimator {

/// The nearest possible starting point: SOC 0 to 1, sigma 1e-6 to 1.
constexpr measurement::StartingPoint possible(const measurement::StartingPoint& from) {
  return {std::clamp<std::int32_t>(from.soc_ppb, 0, 1'000'000'000),
          std::clamp<std::int32_t>(from.soc_sigma_ppb, 1'000, 1'000'000'000)};
}

/// Sets a state and opens its bank. The references are to the parts of one estimator.
template <class S, template <class> class ModelOf>
class FirstState {
  using Model = ModelOf<S>;
  using StepInput = model::StepInput<S>;
  using At = model::TablePoint<S>;
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Current = arithmetic::Current<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using Coupling = arithmetic::Coupling<S>;
  using Variances = typename Model::Variances;

 public:
  constexpr FirstState(CellState<S, ModelOf>& state, AmbiguousSoc<S, ModelOf>& ambiguous, std::uint8_t& interval)
      : state_(state), ambiguous_(ambiguous), interval_(interval) {}

  /// error: by how much larger than the cell file says an overpotential may be because of the temperature, relative.
  /// from, voltage_uv: nullptr if it is missing; not both. Opens the bank if the SOC is ambiguous, and in the
  /// background if it was given. Returns the tables at the first SOC.
  template <class Cell>
  [[gnu::cold, gnu::noinline]] constexpr At set(const Cell& cell, const StepInput& input, bool current_measured,
                                                const Coupling& error, const measurement::StartingPoint* from,
                                                const std::int32_t* voltage_uv) {
    SocDistribution<S> soc{Soc(0.5), Variance{}};
    const auto factor = Coupling(error + Coupling(1));
    if (from != nullptr) soc = given(*from);
    const auto tables = operating_point(cell, input);
    const Reading<Cell> reading =
        reading_of(cell, input, current_measured, Variance(factor * factor), look_up(tables, soc.soc, interval_));
    // a start that is finer than the points of the grid needs no help from a voltage
    if (from == nullptr || soc_of_ppb(from->soc_sigma_ppb) > Soc(2.0 / start_points)) {
      const bool present = voltage_uv != nullptr;
      const Voltage read_v =
          present ? Model::true_voltage(laws_of(cell), arithmetic::from_micro<Voltage>(*voltage_uv)) : Voltage(0);
      Load load;
      const auto of_ocv = [&](const At& there) {
        if (!load.is_that_of(there)) load = reading.load(there);
        return OcvReading<S>{read_v - Voltage(load.left_v + there.r0_ohm * input.current_a), load.v2, load.above_v2};
      };
      soc = from_voltage(tables, from != nullptr ? &soc : nullptr, present ? &of_ocv : nullptr);
    }
    const At there = look_up(tables, soc.soc, interval_);
    const StartState left = reading.start_state(there);
    state_.charge.set(soc.soc, cell.charge);
    state_.model_state = left.state;
    Variances all = left.variances(laws_of(cell), reading.own_v2);
    all[Model::soc] = soc.variance;
    state_.covariance.set_diagonal(all);
    return there;
  }

 private:
  using FinalVoltages = std::array<Voltage, 1 + Model::soc - Model::first_voltage>;

  /// What the present current, flowing for an unknown time, and an unknown current before may have left: half of the
  /// final voltages of one, with all of those of the other as standard deviation.
  struct StartState {
    typename Model::State state;
    FinalVoltages before_v;
    Variance larger2;  ///< square of how much larger than these they may be; >= 1

    /// own_v2: variances of the states without any current.
    template <class Laws>
    constexpr Variances variances(const Laws& laws, Variances own_v2) const {
      const auto add = [&](Variance& to, const Voltage& half_v, const Voltage& before) {
        to = Variance(to + Variance(Variance(half_v * half_v) + before * before) * larger2);
      };
      add(own_v2[0], state[0], before_v[0]);
      for (std::size_t k = Model::first_voltage; k < Model::soc; ++k) {
        if (Model::is_polarisation(laws, k))
          add(own_v2[k], state[Model::value_index(k)], before_v[1 + k - Model::first_voltage]);
      }
      return own_v2;
    }
  };

  /// What is between the first voltage and the OCV, at the resistances of one SOC.
  struct Load {
    At at{};
    Voltage left_v{};           ///< of polarisations
    Variance v2{}, above_v2{};  ///< as in OcvReading

    /// Within an eighth: this is an uncertainty, and costs as much as the rest of a start.
    constexpr bool is_that_of(const At& there) const {
      const auto close = [](const auto& a, const auto& b) {
        using T = std::remove_cvref_t<decltype(a)>;
        return arithmetic::magnitude(T(a - b)) <= T(b * Fraction(0.125));
      };
      return close(there.r1_ohm, at.r1_ohm) && close(there.activation, at.activation) && close(there.gap, at.gap);
    }
  };

  /// The first voltage as a reading of the OCV. Resistances depend on the SOC, in the cold by a factor of ten: so do
  /// the polarisation and its uncertainty.
  template <class Cell>
  struct Reading {
    const Cell& cell;
    StepInput input;
    typename Model::State state;  ///< at `final_v`
    FinalVoltages final_v, charged_v;
    Variances own_v2;
    bool warm;
    Variance rest_v2;
    Current unknown_a;  ///< through R0
    Variance larger2;

    constexpr FinalVoltages final_at(const At& there) const {
      const StepInput unknown{cell.noise.unknown_a, input.duration_s, input.temperature_c};
      return Model::final_voltages(laws_of(cell), state, there, unknown);
    }
    constexpr StartState start_state(const At& there) const {
      const FinalVoltages there_v = final_at(there);
      return {Model::polarisation_at(state, final_v, there_v), there_v, larger2};
    }
    constexpr Load load(const At& there) const {
      const StartState left = start_state(there);
      const auto h = Model::measurement_jacobian(laws_of(cell), there, input);
      const Voltage unknown_v = there.r0_ohm * unknown_a;
      const auto variance = [&](const StartState& p) {
        Variances of_states = p.variances(laws_of(cell), own_v2);
        of_states[0] = Variance(of_states[0] - own_v2[0]);  // a rested voltage has an error of its own
        const Variance of_polarisation =
            sum_variance<Model>(of_states, h, [](std::size_t k) { return k == 0 || k >= Model::first_voltage; });
        return Variance(Variance(rest_v2 + unknown_v * unknown_v) + of_polarisation);
      };
      return {there, left.state[0] + Model::sum_v(laws_of(cell), left.state), variance(left),
              variance(warm ? left : StartState{left.state, charged_v, Variance(1)})};
    }
  };

  /// In the cold, chargers reduce their current at least as the resistance increases, so a charge leaves no larger
  /// voltage than at the reference temperature: a cell at rest that reads far above its plateau is full. at: the tables
  /// at any SOC.
  template <class Cell>
  constexpr Reading<Cell> reading_of(const Cell& cell, const StepInput& input, bool current_measured,
                                     const Variance& larger2, const At& at) {
    Variances own_v2{};
    own_v2[0] = cell.noise.v_rc_v2;
    Model::start(laws_of(cell), state_.model_state, own_v2, at, input, cell.noise);
    state_.model_state[0] = at.r1_ohm * Fraction(0.5) * input.current_a;
    for (std::size_t k = Model::first_voltage; k < Model::soc; ++k) {
      const Voltage& half_v = state_.model_state[Model::value_index(k)];
      if (Model::is_polarisation(laws_of(cell), k)) own_v2[k] = Variance(own_v2[k] - half_v * half_v);
    }
    const bool warm = input.temperature_c > cell.reference.c || !rests<S>(input.current_a, cell.noise);
    Reading<Cell> reading{cell,
                          input,
                          state_.model_state,
                          {},
                          {},
                          own_v2,
                          warm,
                          cell.noise.rest_v2,
                          current_measured ? Current(0) : cell.noise.unknown_a,
                          larger2};
    reading.final_v = reading.final_at(at);
    if (!warm) reading.charged_v = charged_before(cell, input);
    return reading;
  }
  /// Final voltages of the unknown current at the reference temperature.
  template <class Cell>
  constexpr FinalVoltages charged_before(const Cell& cell, const StepInput& input) const {
    const StepInput charge{cell.noise.unknown_a, input.duration_s, cell.reference.c};
    std::uint8_t interval = 0;
    return Model::final_voltages(laws_of(cell), state_.model_state,
                                 look_up(operating_point(cell, charge), Soc(0.5), interval), charge);
  }

  template <class Cell>
  constexpr auto operating_point(const Cell& cell, const StepInput& input) const {
    return model::OperatingPoint{cell, input, Model::mechanism_states(state_.model_state)};
  }

  /// before, reading: nullptr if it is missing; not both.
  template <class Tables, class OfOcv>
  constexpr SocDistribution<S> from_voltage(const Tables& tables, const SocDistribution<S>* before,
                                            const OfOcv* reading) {
    const PriorMisfit<S> prior =
        before != nullptr ? PriorMisfit<S>(*before, WrongPrior::one_in_ten_thousand) : PriorMisfit<S>();
    SocBank<S>& bank = ambiguous_.hypotheses();
    bank.clear_first_misfits();
    const SocDistribution<S> soc =
        reading != nullptr ? StartSearch(StartMisfit<S, Tables, OfOcv>{tables, *reading}, prior).run(bank) : *before;
    const bool ambiguous = soc.variance > Variance(SocBank<S>::open_above_sigma * SocBank<S>::open_above_sigma);
    if (ambiguous || before != nullptr) ambiguous_.open_after_voltage(soc.soc, prior.with_even_odds(), !ambiguous);
    return soc;
  }

  static constexpr SocDistribution<S> given(const measurement::StartingPoint& from) {
    const Soc sigma = soc_of_ppb(from.soc_sigma_ppb);
    return {soc_of_ppb(from.soc_ppb), Variance(sigma * sigma)};
  }
  static constexpr Soc soc_of_ppb(std::int32_t ppb) {
    return Soc(arithmetic::from_micro<Current>(ppb) * Fraction(1e-3));
  }

  CellState<S, ModelOf>& state_;
  AmbiguousSoc<S, ModelOf>& ambiguous_;
  std::uint8_t& interval_;
};

}  // namespace bms::estimator
