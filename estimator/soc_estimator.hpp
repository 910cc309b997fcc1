// State of charge of one cell: an extended Kalman filter over the states of a cell model. One sample in, one estimate
// out.
//
//   predict   count the charge in integers, advance the other states by the model's exact step, propagate the
//             covariance with the analytic state transition
//   correct   with the voltage, if the checks accept it; otherwise the prediction stands and sigma grows
//
// The parts, each with its own header:
//   input_check.hpp         which readings are used
//   step_constants.hpp      what depends on the time step and the temperature alone
//   charge_count.hpp        charge, and the capacity with which it is counted
//   persistent_errors.hpp   errors that last for hours: as noise or as states
//   first_state.hpp         the state at the first sample
//   soc_monitor.hpp         finds out when the voltages contradict the SOC, and then estimates it again
//   cell_state.hpp          the state itself
//
// One source for every scalar and for the 1RC model with any mechanisms (model/extended_rc.hpp: N states). The laws of
// the mechanisms come with the cell; a cell without mechanisms pays nothing for them. No heap, no exceptions, no libm
// function except sqrt, no clock: the same samples give the same bits on every core (float and fixed point; compile
// with -ffp-contract=off).
//
// Voltage noise: it is larger where the OCV is steep, because the SOC axis of the table has an uncertainty of
// tolerance.initial_soc, and under current, because R0 and R1 have one of tolerance.resistance_fraction.
// Memory: CellState<float> 24 bytes a cell; the rest is shared or guards inputs. Cost: estimator/README.md.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "estimator/cell_state.hpp"
#include "estimator/charge_count.hpp"
#include "estimator/estimate.hpp"
#include "estimator/first_state.hpp"
#include "estimator/input_check.hpp"
#include "estimator/persistent_errors.hpp"
#include "estimator/soc_monitor.hpp"
#include "estimator/step_constants.hpp"
#include "estimator/voltage_uncertainty.hpp"
#include "measurement/sample.hpp"
#include "model/extended_rc.hpp"
#include "model/fixed_ranges.hpp"

namespace bms::estimator {

template <class S, template <class> class ModelOf = model::ExtendedRc<0, 0>::Of>
class SocEstimator {
  using Errors = PersistentErrors<S, ModelOf>;

 public:
  using Model = ModelOf<S>;
  using Scalar = S;
  static constexpr std::size_t states = Model::states;
  static constexpr std::size_t extra_values = Errors::values + Model::values - Model::first_mechanism_state;
  using Result = std::conditional_t<extra_values == 0, Estimate<S>, ExtendedEstimate<S, extra_values>>;

  constexpr SocEstimator() = default;

  /// Starts from a known state of charge instead of the first voltage, clamped to 0 to 1; its sigma to 1e-6 to 1.
  constexpr explicit SocEstimator(const measurement::StartingPoint& from) : from_(possible(from)), has_start_(true) {}

  /// Processes one sample. cell: prepared for S, the same in every call.
  template <class Cell>
  constexpr Result step(const Cell& cell, const measurement::Sample& sample) {
    if (!started_) return start(cell, sample);
    if (sample.time_us <= time_us_) return repeated_estimate(cell, time_not_increasing);

    const std::uint64_t step_us = sample.time_us - time_us_;
    if (Consistency<S>::turn_ends(time_us_, sample.time_us)) [[unlikely]]
      monitor_.force_check();
    time_us_ = sample.time_us;
    std::uint32_t flags = 0;
    const AcceptedCurrent current = check_.current(sample.current_ua, cell.plausible, flags);
    if (is_unchecked(step_us)) flags |= set_time_step(cell, step_us, current.ua);
    if (sample.temperature_cdegc >> temperature_bin_bits != temperature_bin_) [[unlikely]]
      set_temperature(cell, sample.temperature_cdegc);
    const auto& laws = laws_of(cell);
    const StepInput input{laws.true_current(Model::without_offset(arithmetic::from_micro<Current>(current.ua),
                                                                  state_.model_state, cell.noise)),
                          constants_.duration_s(), temperature(laws, sample.temperature_cdegc)};
    count_.count(state_.charge, counted_ua(laws, input, current.ua), step_us, cell.charge);

    const Soc soc = state_.charge.soc(cell.charge);
    const auto at = look_up(operating_point(cell, input), soc, interval_);
    const auto discretisation = Model::discretise(laws, state_.model_state, at, input, constants_.error_decay());
    auto noise = Model::noise(laws, discretisation, cell.noise);
    noise[Model::soc] = constants_.soc_noise();
    if ((flags & (unmeasured | current_varies)) != 0) [[unlikely]] {
      flags = add_unknown_current(cell, at, input, flags, noise);
      count_.lose(Variance(noise[Model::soc] - constants_.soc_noise()));
    }
    errors_.add_gain_error(noise[Model::soc], soc, cell.noise.gain);
    state_.covariance.template propagate<typename Model::Couples>(
        Model::state_transition(state_.model_state, at, discretisation, input), noise);
    state_.model_state = Model::advance(state_.model_state, at, discretisation, input);

    const Voltage predicted_v = Model::voltage(laws, state_.model_state, at, input);
    errors_.update_offset_at_rest(state_, cell, current, step_us, constants_.duration_s());
    if (check_.voltage_usable(sample.voltage_uv, Voltage(at.r0_ohm * input.current_a), cell.plausible, flags))
      correct(cell, at, input, soc, predicted_v, arithmetic::from_micro<Voltage>(sample.voltage_uv) - predicted_v,
              flags);
    Result estimate;
    estimate.voltage_predicted_v = predicted_v;
    estimate.flags = flags;
    report_state(cell, estimate);
    count_.corrected(Soc(estimate.soc - soc));
    if constexpr (std::floating_point<S>) {
      if (!is_finite(estimate)) [[unlikely]]
        return start_again(cell, flags);
    }
    errors_.bound_gain_error(estimate.soc, estimate.soc_sigma, cell.noise.gain);
    return estimate;
  }

  /// Goes on with the capacity that an earlier run has found. Before the first sample.
  constexpr void restore_capacity(const measurement::StartingCapacity& found) { count_.restore(found); }
  /// Relative to that of the cell file. counted_capacity_ppm: with which the charge is counted [1e-6].
  constexpr const LearnedRatio<S>& capacity() const { return count_.capacity(); }
  constexpr std::int32_t counted_capacity_ppm() const { return count_.counted_ppm(); }

  constexpr const CellState<S, ModelOf>& state() const { return state_; }
  /// Time of the last accepted sample.
  constexpr std::uint64_t time_us() const { return time_us_; }

 private:
  friend struct LaneAccess;  ///< steps many estimators at once (host_sim/replay/lane_access.hpp)

  using StepInput = model::StepInput<S>;
  using At = model::TablePoint<S>;
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Current = arithmetic::Current<S>;
  using Temperature = arithmetic::Temperature<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using TimeStep = arithmetic::TimeStep<S>;
  using Curve = typename ChargeCount<S>::Curve;

  static constexpr std::uint32_t unmeasured = time_gap | current_missing | current_implausible;
  static constexpr std::uint32_t voltage_was_used = 1U << 31;  ///< of check_voltage(); not a Flag
  /// The current perhaps varied between two rows. Not a Flag; bit 9 is set after it is cleared, and with it the mask of
  /// these bits is one immediate operand.
  static constexpr std::uint32_t current_varies = soc_ambiguous;

  /// Sensors give the mean over a second or less. What flowed in the rest of a longer row is not known.
  static constexpr std::uint64_t row_hides_us = 2'000'000;
  static constexpr double change_share = 1.0 / 8;  ///< of a row in the mean square of the changes

  static constexpr int temperature_bin_bits = 8;  ///< a bin of temperatures is 2.56 K wide
  static constexpr std::int16_t no_temperature_bin = 0x7FFF;

  template <class Cell>
  constexpr auto operating_point(const Cell& cell, const StepInput& input) const {
    return model::OperatingPoint{cell, input, Model::mechanism_states(state_.model_state)};
  }

  /// What acts on the cell: the accepted current and the last possible temperature, corrected for known errors of the
  /// sensors.
  template <class Cell>
  constexpr StepInput step_input(const Cell& cell, std::int32_t current_ua, std::int16_t temperature_cdegc) {
    const auto& laws = laws_of(cell);
    return {laws.true_current(
                Model::without_offset(arithmetic::from_micro<Current>(current_ua), state_.model_state, cell.noise)),
            constants_.duration_s(), temperature(laws, temperature_cdegc)};
  }

  /// Current that ends as charge. Without a law that changes it, this is the reading itself.
  template <class Laws>
  static constexpr std::int32_t counted_ua(const Laws& laws, const StepInput& input, std::int32_t read_ua) {
    return Model::errors_are_states || laws.changes_charge() ? arithmetic::to_micro(laws.counted(input)) : read_ua;
  }

  /// The last possible temperature; model::assumed_ambient_c before the first one.
  template <class Laws>
  constexpr Temperature temperature(const Laws& laws, std::int16_t cdegc) {
    if constexpr (std::same_as<Laws, model::LawSet<S>>) return Temperature(model::assumed_ambient_c);  // no law uses it
    if (measurement::temperature_possible(cdegc)) temperature_cdegc_ = cdegc;
    return laws.true_temperature(arithmetic::from_centi<Temperature>(temperature_cdegc_));
  }

  /// Also true for every step of 2^32 us and more: comparing 64 bits costs one instruction more.
  constexpr bool is_unchecked(std::uint64_t step_us) const {
    return ((static_cast<std::uint32_t>(step_us) ^ checked_step_us_) | static_cast<std::uint32_t>(step_us >> 32)) != 0;
  }
  /// Returns the flags of the step. By value: flags whose address is taken would be kept in memory.
  template <class Cell>
  [[gnu::noinline]] constexpr std::uint32_t set_time_step(const Cell& cell, std::uint64_t step_us,
                                                          std::int32_t current_ua) {
    std::uint32_t flags = 0;
    // a gap is checked again even if the next step is as long: gaps of equal length are gaps
    const bool gap = check_.gap(constants_.capped(step_us), flags), hides = step_us >= row_hides_us;
    checked_step_us_ = gap || hides ? 0 : static_cast<std::uint32_t>(step_us);
    if (constants_.step_us() != step_us) constants_.set_time_step(cell.noise, step_us);
    count_.set_time_step(step_us);
    half_change_ua_ = hides && row_hid_ ? current_ua / 2 - row_ua_ / 2 : 0;
    row_ua_ = current_ua;
    row_hid_ = hides;
    return hides ? flags | current_varies : flags;
  }

  template <class Cell>
  [[gnu::noinline]] constexpr void set_temperature(const Cell& cell, std::int16_t cdegc) {
    temperature_bin_ = static_cast<std::int16_t>(cdegc >> temperature_bin_bits);
    constants_.set_temperature(cell, cdegc);
  }

  /// Process noise of a step in which a current flowed that was not measured. Returns the flags without current_varies.
  template <class Cell>
  constexpr std::uint32_t add_unknown_current(const Cell& cell, const At& at, const StepInput& input,
                                              std::uint32_t flags, typename Model::Variances& noise) {
    if ((flags & current_varies) != 0) add_hidden_current(cell, at, noise);
    flags &= ~current_varies;
    if ((flags & unmeasured) == 0) return flags;
    const bool measured = (flags & (current_missing | current_implausible)) == 0;
    // such an error keeps its sign, so standard deviations add: (sigma + d)^2 - sigma^2
    const Soc d = constants_.unknown_charge(cell, measured ? Current(0) : input.current_a);
    const Soc sigma = arithmetic::root<Soc>(state_.soc_variance());
    noise[Model::soc] = Variance(noise[Model::soc] + (Variance(d * d) + Variance((sigma + sigma) * d)));
    if (measured) return flags;
    // the drop over the resistances is unknown as well
    const Voltage unknown_v =
        steady_state_drop_v<S>(at, Current(arithmetic::magnitude(input.current_a) + cell.noise.unknown_a));
    noise[0] = Variance(noise[0] + unknown_v * unknown_v);
    return flags;
  }

  /// What flowed between two readings that are far apart. A row may have the last reading instead of the mean since the
  /// row before. As soon as the load forgets itself within a row, half the mean square of the change from row to row is
  /// the variance of a reading about the mean of its row. A load that is constant has neither.
  template <class Cell>
  constexpr void add_hidden_current(const Cell& cell, const At& at, typename Model::Variances& noise) {
    const Current half_a = arithmetic::magnitude(arithmetic::from_micro<Current>(half_change_ua_));
    const auto add = [](Variance& mean, const Variance& half_squared, Variance& to) {
      const Variance half_change2 = Variance(half_squared + half_squared);
      mean = Variance(Variance(mean - arithmetic::product<Variance>(mean, Fraction(change_share))) +
                      arithmetic::product<Variance>(half_change2, Fraction(change_share)));
      if (mean < Variance(1e-12)) mean = Variance{};
      to = Variance(to + mean);
    };
    const Soc d = constants_.charge_of(cell, half_a);
    const Voltage drop_v = steady_state_drop_v<S>(at, half_a);
    add(hidden_soc2_, d * d, noise[Model::soc]);
    add(hidden_drop_v2_, drop_v * drop_v, noise[0]);
  }

  /// predicted_v: before the correction.
  template <class Cell>
  constexpr void correct(const Cell& cell, const At& at, const StepInput& input, const Soc& soc,
                         const Voltage& predicted_v, const Voltage& innovation_v, std::uint32_t& flags) {
    if (monitor_.is_due(innovation_v)) [[unlikely]] {
      const std::uint32_t found =
          check_voltage(cell, input.current_a, input.temperature_c, soc, Voltage(predicted_v - at.ocv_v), innovation_v,
                        Curve{ocv_slope<S>(at), at.error_v2}, (flags & unmeasured) == 0);
      flags |= found & ~voltage_was_used;
      if (found != 0) return;
    }
    observe(cell, at, input, innovation_v);
  }

  template <class Cell>
  [[gnu::always_inline]] constexpr void observe(const Cell& cell, const At& at, const StepInput& input,
                                                const Voltage& innovation_v) {
    const Variance model_v2 = model_noise_v2<S, Errors>(cell.noise, at, input.current_a, constants_);
    const Variance noise_v2 = Variance(monitor_.reading_noise_v2() + model_v2);
    state_.apply(
        state_.covariance.observe(Model::measurement_jacobian(laws_of(cell), at, input), noise_v2, innovation_v),
        cell.charge);
  }

  // These take their arguments by value: an argument passed by address would be kept in memory in every step.

  /// What is done once in Consistency's turn, with a suspect voltage, and while the bank is open. above_ocv_v:
  /// predicted voltage above the OCV. Returns 0 if the voltage is good and not used yet; else flags of this step, or
  /// voltage_was_used.
  template <class Cell>
  [[gnu::noinline]] constexpr std::uint32_t check_voltage(const Cell& cell, Current current_a,
                                                          Temperature temperature_c, Soc soc, Voltage above_ocv_v,
                                                          Voltage innovation_v, Curve curve, bool measured) {
    const std::uint32_t since_us =
        monitor_.watch(cell, constants_, state_, time_us_, current_a, above_ocv_v, innovation_v, measured);
    const StepInput input{current_a, constants_.duration_s(), temperature_c};
    std::uint32_t found = 0;
    if (monitor_.needs_check(soc, innovation_v))
      found = monitor_.judge(cell, input, constants_, soc, innovation_v,
                             monitor_.resistance_error_v2(constants_, above_ocv_v, state_), interval_, state_);
    if (since_us != 0 &&
        count_.update(
            soc, Errors::with_error(state_, innovation_v), curve, found == 0,
            Errors::counted_variance(state_, cell.noise, count_.variance(), arithmetic::seconds<S>(since_us)), [&] {
              return Variance(cell.noise.voltage_v2 + monitor_.resistance_error_v2(constants_, above_ocv_v, state_));
            }))
      checked_step_us_ = 0;
    if (found != 0 || !monitor_.bank_is_open()) return found;
    std::uint8_t interval = interval_;
    observe(cell, look_up(operating_point(cell, input), soc, interval), input, innovation_v);
    monitor_.follow(Soc(state_.charge.soc(cell.charge) - soc));
    return voltage_was_used;
  }

  template <class Cell>
  constexpr void report_state(const Cell& cell, Result& estimate) const {
    estimate.soc = state_.charge.soc(cell.charge);
    estimate.soc_sigma = arithmetic::root<Soc>(state_.soc_variance());
    estimate.v_rc_v = state_.model_state[0];
    if constexpr (extra_values > 0) {
      Errors::report(state_, estimate.extra);
      std::size_t next = Errors::values;
      for (std::size_t k = Model::first_mechanism_state; k < Model::values; ++k)
        estimate.extra[next++] = state_.model_state[k];
    }
  }

  /// After a result that was not a number: the charge, counted in integers, stays; all else is unknown.
  template <class Cell>
  [[gnu::noinline]] constexpr Result start_again(const Cell& cell, std::uint32_t flags) {
    const auto anything = Variance(0.289 * 0.289);  // of a SOC from 0 to 1: 1 / 12
    typename Model::Variances unknown{};
    unknown.fill(anything);
    state_.model_state = {};
    state_.covariance.set_diagonal(unknown);
    errors_ = {};
    monitor_ = {};
    Result estimate;
    estimate.flags = flags | not_a_number;
    report_state(cell, estimate);
    count_.begin(estimate.soc);
    errors_.start(estimate.soc);
    monitor_.start(cell);
    monitor_.bank().open_at(estimate.soc, PriorMisfit<S>({estimate.soc, anything}));
    return estimate;
  }

  /// The present estimate, for a sample that is not later than the last one.
  template <class Cell>
  [[gnu::noinline]] constexpr Result repeated_estimate(const Cell& cell, std::uint32_t flags) const {
    Result estimate;
    estimate.flags = flags;
    const StepInput rest{Current(0), TimeStep(1)};
    std::uint8_t interval = interval_;
    const auto at = look_up(operating_point(cell, rest), state_.charge.soc(cell.charge), interval);
    estimate.voltage_predicted_v = Model::voltage(laws_of(cell), state_.model_state, at, rest);
    report_state(cell, estimate);
    return estimate;
  }

  template <class Cell>
  [[gnu::noinline]] constexpr Result start(const Cell& cell, const measurement::Sample& sample) {
    time_us_ = sample.time_us;
    Result estimate;
    const AcceptedCurrent current = check_.current(sample.current_ua, cell.plausible, estimate.flags);
    const bool voltage = InputCheck<S>::voltage_present(sample.voltage_uv, cell.plausible, estimate.flags);
    if (!voltage && !has_start_) {
      estimate.flags |= not_started;
      estimate.soc = Soc(0.5);
      estimate.soc_sigma = Soc(0.289);  // anything from 0 to 1: 1 / sqrt(12)
      return estimate;
    }
    started_ = true;
    monitor_.start(cell);
    const auto& laws = laws_of(cell);
    set_temperature(cell, sample.temperature_cdegc);
    const StepInput input{laws.true_current(arithmetic::from_micro<Current>(current.ua)), TimeStep(1),
                          temperature(laws, sample.temperature_cdegc)};
    const At at = FirstState<S, ModelOf>(state_, monitor_.bank(), interval_)
                      .set(cell, input, current.measured, constants_.extrapolation_error(),
                           has_start_ ? &from_ : nullptr, voltage ? &sample.voltage_uv : nullptr);
    estimate.voltage_predicted_v = Model::voltage(laws, state_.model_state, at, input);
    report_state(cell, estimate);
    count_.begin(estimate.soc);
    errors_.start(estimate.soc);
    return estimate;
  }

  CellState<S, ModelOf> state_;
  InputCheck<S> check_;
  [[no_unique_address]] Errors errors_;
  std::uint64_t time_us_ = 0;
  std::uint32_t checked_step_us_ = 0;  ///< last step that was not a gap; a step of this length is not checked again
  std::int32_t row_ua_ = 0, half_change_ua_ = 0;  ///< current of the last row whose length was checked; half its change
  Variance hidden_soc2_{}, hidden_drop_v2_{};     ///< of a row, by what its reading does not show
  bool row_hid_ = false;                          ///< that row was row_hides_us long
  std::uint8_t interval_ = 0;
  std::int16_t temperature_cdegc_ = static_cast<std::int16_t>(100 * model::assumed_ambient_c);
  std::int16_t temperature_bin_ = no_temperature_bin;
  StepConstants<S, Model, Errors> constants_;
  SocMonitor<S, ModelOf> monitor_;
  ChargeCount<S> count_;
  measurement::StartingPoint from_;
  bool has_start_ = false, started_ = false;
};

}  // namespace bms::estimator
