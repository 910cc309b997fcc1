// The application: for each sample it updates the estimator, evaluates the protections, drives the contactors, sends
// messages, handles commands and stores its state. It feeds the watchdog only after progress in all (progress.hpp).
//
//   Board   number of cells, and the functions that depend on the cell file: estimator step, time of the last step,
//           condition, differences between the cells, plausible range of a reading, protection plan
//           (firmware/board_cell.hpp; tests bring their own)
//
// The application accesses the hardware only through hal/. It runs on any host that implements the functions it calls.
#pragma once

#include <algorithm>
#include <optional>
#include <type_traits>
#include <utility>

#include "estimator/pack_estimator.hpp"
#include "estimator/soc_estimator.hpp"
#include "firmware/access.hpp"
#include "firmware/board_parameters.hpp"
#include "firmware/board_updates.hpp"
#include "firmware/charger_frames.hpp"
#include "firmware/commands.hpp"
#include "firmware/group_side.hpp"
#include "firmware/latched_faults.hpp"
#include "firmware/parameter_commands.hpp"
#include "firmware/power_requests.hpp"
#include "firmware/progress.hpp"
#include "firmware/pulses_of.hpp"
#include "firmware/snapshot.hpp"
#include "firmware/stored_state.hpp"
#include "firmware/telemetry.hpp"
#include "firmware/truck_side.hpp"
#include "firmware/without_profile.hpp"
#include "hal/board_state.hpp"
#include "hal/calendar.hpp"
#include "hal/clock.hpp"
#include "hal/estimate_record.hpp"
#include "hal/power_path.hpp"
#include "hal/requests.hpp"
#include "hal/second_line.hpp"
#include "hal/watchdog.hpp"
#include "protection/protection.hpp"

namespace bms::firmware {

template <class Board, class VehicleProfile = WithoutVehicleProfile>
class Application {
 public:
  using Estimator = typename Board::Estimator;
  using Result = typename Estimator::Result;
  static constexpr std::size_t cells = Board::cells;
  static constexpr bool has_parameters = requires { Board::parameters(); };

  /// start: state of charge from outside or from storage. persistence: already started.
  Application(const std::optional<measurement::StartingPoint>& start, const messages::Identity& identity,
              float capacity_ah, storage::Persistence& persistence)
      : estimator_{start ? Estimator(*start) : Estimator()},
        latched_faults_{persistence, hal::reset_cause()},
        protection_{Board::plan(), latched_faults_.faults()},
        telemetry_{identity, start},
        capacity_ah_{capacity_ah},
        persistence_{persistence},
        access_{persistence},
        cell_hash_{hash_of_stored_data<Board>(identity.cell_hash)} {
    board_.cell_file_changed = stored_for_another_cell_file(persistence, cell_hash_);
    if (board_.cell_file_changed) return;
    store_setting(cell_file_key, cell_hash_);
    if constexpr (cells > 1) restore_cells(cells_, persistence.cells());
    restore_health(estimator_, condition_, persistence.health());
  }

  /// acquisition_us: time that the acquisition of the sample took, part of Board.LongestSample
  void process_sample(const measurement::PackSample<cells>& pack, std::uint32_t acquisition_us = 0) {
    const std::uint64_t began_us = hal::now_us();
    board_.state = hal::board_state();
    const measurement::Sample mean = estimator::mean_cell(pack, Board::plausible());
    if constexpr (has_parameters) board_.parameters_lost = Board::parameters().lost();
    const Result estimate = Board::step(estimator_, mean);
    hal::record_estimate(estimator::words(estimate));
    protection::ExternalInputs inputs;
    const Losses losses = truck_.read(fitted_inputs(), pack.time_us, board_, inputs);
    const ChargerState charger = with_plug(vehicle_profile_.charger(pack.time_us), board_.truck);
    inputs.request = allowed<Board>(requested_.power.active(
        charger, pack.time_us, hal::closes_by_inputs && board_.truck.is_on(hal::TruckInput::key)));
    Board::update_condition(condition_, estimator_, mean, estimate,
                            hal::can_listening() || inputs.request != protection::Request::none);
    if constexpr (cells > 1) Board::update_cells(cells_, pack, estimate);
    observe(pack, estimate);
    if constexpr (hal::has_group_bus)
      group_.update(Board::parameters().active(), pack.current_ua, Board::open_circuit_uv(estimator_, mean, estimate),
                    protection_.decision(), Board::plan().contactors.rest_ua, pack.time_us, vehicle_profile_, inputs);
    protect(pack, estimate, inputs, losses);
    truck_.judge_sensors(mean, inputs.second_current_ua, protection_.decision(), board_);
    for (std::size_t k = 0; cells > 1 && k < cells; ++k) {
      if (const std::int32_t ppm = protection_.take_bled_ppm(k); ppm > 0) [[unlikely]]
        cells_.shift(k, arithmetic::from_micro<arithmetic::Soc<typename Estimator::Scalar>>(-ppm));
    }
    truck_.switch_outputs(pack.temperature_cdegc, known_soc_ppb(estimate), charger.present, pack.time_us,
                          protection_.decision(), Board::plan(), board_);
    access_.drive.renew(pack.time_us, access_.source);
    publish(pack, mean, estimate);
    store_decision();
    handle_requests(pack.time_us);
    estimate_ = estimate;
    if (persistence_.count(mean)) [[unlikely]]
      store_state();
    const auto took_us =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(hal::now_us() - began_us + acquisition_us, 0xFFFF'FFFF));
    board_.longest_sample_us = std::max(board_.longest_sample_us, took_us);
    if (progress_.complete({pack.time_us, Board::estimated_us(estimator_), telemetry_.published()}))
      hal::watchdog_feed();
    serve_update<Board>(
        pack, estimate, inputs.request == protection::Request::none && !protection_.decision().outputs.any_closed(),
        !board_.state.unfit() && !setting_lost_ && persistence_.log().operational(), [&] { shut_down(); });
    if constexpr (requires { requires Board::may_stop; }) {
      if (!truck_.park(pack, inputs, charger, protection_.decision(), board_, Board::plan())) return;
      shut_down();
      if (truck_.still_parked(board_.truck)) hal::switch_off();
    }
  }

  /// Stores the state when the battery is switched off. The last call.
  void shut_down() {
    const StateToStore now(estimate_, condition_, cells_);
    persistence_.power_failing(now.values(), hal::calendar_s());
  }
  /// Stores the state when the supply falls, between two samples. The contactors are open already.
  void supply_failing() {
    const StateToStore now(estimate_, condition_, cells_);
    persistence_.supply_failing(now.values(), hal::calendar_s());
  }

  const VehicleProfile& vehicle_profile() const { return vehicle_profile_; }

 private:
  using StateToStore = StateToStoreOf<typename Estimator::Scalar, cells>;
  static constexpr int max_requests = 4;  // per sample: bounds its processing time

  [[gnu::noinline]] void publish(const measurement::PackSample<cells>& pack, const measurement::Sample& mean,
                                 const Result& estimate) {  // else what follows in a sample has its frame, too
    const Snapshot<Estimator, cells> now{.pack = pack,
                                         .mean = mean,
                                         .estimate = estimate,
                                         .condition = condition_,
                                         .cells = cells_,
                                         .decision = group_.published(protection_.decision()),
                                         .plan = Board::plan(),
                                         .persistence = persistence_,
                                         .board = board_,
                                         .capacity_ah = capacity_ah_,
                                         .log_samples = requested_.log_samples,
                                         .stored_part = requested_.next_stored_part(),
                                         .request_challenge = access_.drive.message()};
    telemetry_.publish(now);
    if constexpr (has_parameters) publish_parameter();
    pulses_.template publish<Board>(now, protection_, estimator_);
    vehicle_profile_.publish(now);
  }

  /// Readings for the stored faults and extremes.
  [[gnu::noinline]] void observe(const measurement::PackSample<cells>& pack, const Result& estimate) {
    storage::Readings now;
    now.range = reading_range(pack.cell_uv, pack.temperature_cdegc, pack.current_ua, Board::plausible());
    if ((estimate.flags & estimator::not_started) == 0)
      now.soc = static_cast<std::uint8_t>(std::clamp<std::int32_t>(messages::ppb(estimate.soc) / 5'000'000, 0, 200));
    persistence_.observe(now);
  }

  void protect(const measurement::PackSample<cells>& pack, const Result& estimate, protection::ExternalInputs& inputs,
               const Losses& losses) {
    protection::PackEstimate<cells> known;
    const bool is_number = messages::is_number(estimate);
    if ((estimate.flags & estimator::not_started) == 0 && is_number) {
      known.soc_ppb = messages::ppb(estimate.soc);
      known.soc_sigma_ppb = messages::ppb(estimate.soc_sigma);
      known.voltage_rejected = (estimate.flags & estimator::voltage_rejected) != 0;
      if (condition_.limits_known()) {
        known.model_charge_ua = arithmetic::to_micro(condition_.limits_10s().charge_a);
        known.model_discharge_ua = arithmetic::to_micro(condition_.limits_10s().discharge_a);
      }
      for (std::size_t k = 0; k < cells; ++k) {
        known.cell_soc_ppb[k] = cells > 1 ? messages::ppb(cells_[k].soc()) : 0;
        known.cell_sigma_ppb[k] = cells > 1 ? messages::ppb(cells_[k].soc_sigma()) : 0;
      }
    }
    inputs.clear = std::exchange(requested_.clear, protection::Clear::none);
    if (board_.cell_file_changed && inputs.clear != protection::Clear::none) [[unlikely]]
      accept_cell_file();
    inputs.board_fault = !is_number || (estimate.flags & estimator::not_a_number) != 0 || board_.unfit() ||
                         parameters_unfit(inputs.clear) || latched_faults_.endangered() ||
                         (first_ && (hal::reset_cause() == hal::ResetCause::watchdog || hal::last_fault()));
    inputs.storage_fault = persistence_.log().sectors() > 0 &&
                           (setting_lost_ || !persistence_.log().operational() || persistence_.full_for_long());
    first_ = false;
    const auto& decision = protection_.update(pack, known, inputs);
    hal::power_path_set({decision.outputs.main_plus, decision.outputs.main_minus, decision.outputs.precharge,
                         decision.outputs.charge_enable, decision.bleed});
    if (!decision.outputs.any_closed()) losses.acknowledge();
  }

  /// After the messages, because a write of flash takes milliseconds.
  void store_decision() {
    const protection::Decision& decision = protection_.decision();
    if (decision.raised != 0) [[unlikely]]
      store_faults(decision.raised);
    const protection::FaultSet stored = latched_faults_.faults();
    if (decision.latched == stored) [[likely]]
      return;
    setting_lost_ = !latched_faults_.store(decision.latched) || setting_lost_;
    if ((stored & ~decision.latched) != 0) hal::second_line_clear();
  }

  /// A setting without room is a storage fault until the next start.
  [[gnu::noinline]] void store_setting(std::uint16_t key, std::uint32_t value) {
    if (!persistence_.set(key, static_cast<std::int32_t>(value))) setting_lost_ = true;
  }

  /// Clearing the faults confirms the new cell file: from now on the stored data belong to it.
  [[gnu::noinline]] void accept_cell_file() {
    store_setting(cell_file_key, cell_hash_);
    board_.cell_file_changed = false;
  }

  [[gnu::noinline]] void store_faults(protection::FaultSet raised) {
    for (std::uint16_t k = 0; k < protection::fault_count; ++k, raised >>= 1) {
      if ((raised & 1) != 0) persistence_.fault(static_cast<std::uint16_t>(first_fault_code + k), hal::calendar_s());
    }
  }

  /// Stops and drive requests are bounded by their places (hal/request_queue.hpp), all else by max_requests.
  void handle_requests(std::uint64_t now_us) {
    can::Frame frame;
    for (int k = 0; k < max_requests && hal::next_request(frame);) {
      if (frame.id == can::Stop::id || frame.id == can::DriveRequest::id) {
        if (!frame.long_id) handle_power(frame, now_us);
        continue;
      }
      ++k;
      if (!handle_session(frame, now_us) && !handle_command(frame, now_us))
        receive_from_truck_bus(vehicle_profile_, frame, now_us);
    }
    receive_network_frames(frame, truck_, vehicle_profile_, max_requests, now_us);
  }

  void handle_power(const can::Frame& frame, std::uint64_t now_us) {
    if (!can::intact(frame, static_cast<std::uint16_t>(frame.id))) return;
    const auto request = can::DriveRequest::of(frame);
    if (frame.id == can::Stop::id)
      requested_.power.stop(now_us);
    else if (request.request == can::DriveRequest::request_none)
      requested_.power.withdraw(now_us);
    else if (const auto wanted = access_.drive.receive(request))
      requested_.power.ask(*wanted, now_us);
  }

  /// Returns false if the frame is not one of a service session.
  [[gnu::noinline]] bool handle_session(const can::Frame& frame, std::uint64_t now_us) {
    const bool opening = frame.id == can::ServiceRequest::id;
    if (frame.long_id || (!opening && frame.id != can::CommandAuthority::id)) return false;
    if (!can::intact(frame, static_cast<std::uint16_t>(frame.id))) return true;
    if (!opening) {
      access_.session.receive(can::CommandAuthority::of(frame));
      return true;
    }
    const std::uint32_t before = access_.session.state();
    const std::uint32_t after = access_.session.receive(can::ServiceRequest::of(frame), now_us, access_.source);
    if (after != before) record_session(after);
    telemetry_.answer(access_.session.message());
    return true;
  }

  /// Of lock-outs one after the other only the first is stored: an attacker must not wear out the flash by them.
  void record_session(std::uint32_t state) {
    using Action = can::StoredAction;
    if (state == can::ServiceChallenge::state_open) record_action(Action::code_session_opened, 0);
    const bool again = persistence_.actions().last(0).code == Action::code_session_locked;
    if (state == can::ServiceChallenge::state_locked && !again) record_action(Action::code_session_locked, 0);
  }
  void record_action(std::uint32_t code, std::uint32_t argument) {
    persistence_.action({static_cast<std::uint8_t>(code), access_.session.operator_number(), argument, 0},
                        hal::calendar_s());
  }

  /// Returns false if the frame is not a command. Inlined, because its callees have the deepest stack of all.
  [[gnu::always_inline]] bool handle_command(const can::Frame& frame, std::uint64_t now_us) {
    bool serviced = false;
    const auto may = [&](Privilege privilege) {
      if (privilege == Privilege::drive) return !access_.drive.needed();
      const std::uint32_t before = access_.session.state();
      serviced = access_.session.authorises(frame, now_us);
      if (access_.session.state() != before) record_session(access_.session.state());
      return serviced;
    };
    const auto other = [&](const can::Command& command, auto&& allowed) {
      if constexpr (has_parameters) return handle_parameters(command, allowed);
      return can::CommandAnswer::result_no_such_command;
    };
    auto answer = commands_.handle(frame, now_us, requested_, may, other);
    if (!answer) return false;
    if (const std::uint32_t time = std::exchange(requested_.unix_time_s, 0); time != 0 && !hal::calendar_set(time))
      answer->result = can::CommandAnswer::result_refused;
    if (const auto change = std::exchange(requested_.calibration_change, std::nullopt);
        change && !apply_calibration(*change))
      answer->result = can::CommandAnswer::result_refused;
    if (serviced && answer->result == can::CommandAnswer::result_done &&
        answer->code != can::Command::code_set_parameter)  // only the set that is applied is recorded
      record_action(answer->code, can::Command::of(frame).argument);
    telemetry_.answer(*answer);
    return true;
  }

  /// Returns false if the measuring chain cannot be calibrated, or not now; then nothing is stored. While a contactor
  /// is closed, the readings that protect must not change.
  [[gnu::noinline]] bool apply_calibration(const Requested::CalibrationChange& change) {
    if (protection_.decision().outputs.any_closed() || !persistence_.may_set()) return false;
    hal::SensorCalibration calibration = stored_calibration(persistence_, change);
    if constexpr (has_parameters) {
      calibration = with_shunt(calibration, Board::parameters());
      if (!gain_proved(calibration)) return false;
    }
    if (!hal::calibrate(calibration)) return false;
    store_setting(static_cast<std::uint16_t>(first_calibration_key + change.which),
                  static_cast<std::uint32_t>(change.value));
    return true;
  }

  template <class May>
  [[gnu::noinline]] std::uint32_t handle_parameters(const can::Command& command, May&& may) {
    if (const auto result = truck_.command(command, protection_.decision().outputs.any_closed(), may)) return *result;
    auto& block = Board::parameters();
    const std::uint16_t before = block.revision();
    const std::uint32_t result =
        parameter_commands_.execute(command, protection_.decision().outputs.any_closed(), block, persistence_, may);
    if (block.revision() == before) return result;
    Board::apply_parameters();
    hal::calibrate(limited(with_shunt(stored_calibration(persistence_), block)));
    return result;
  }

  void publish_parameter() {
    const auto number = parameter_commands_.next_part();
    if (!number) [[likely]]
      return;
    if (!hal::can_listening()) return;
    telemetry_.send_parameter(*number, values_to_send(Board::parameters(), *number));
  }

  /// The stored parameters are lost, or the plan that follows from them has changed by itself.
  bool parameters_unfit(protection::Clear clear) {
    if constexpr (has_parameters) {
      if (clear == protection::Clear::service) Board::parameters().accept(persistence_);
      return Board::parameters().lost() || !Board::plan_intact();
    }
    return false;
  }

  /// Inputs that this truck has, as its parameters say.
  static std::int32_t fitted_inputs() {
    if constexpr (has_parameters) return at(Board::parameters().active(), parameters::Parameter::inputs_fitted);
    return 0x7FFF'FFFF;
  }

  static std::int32_t known_soc_ppb(const Result& estimate) {
    return (estimate.flags & estimator::not_started) == 0 ? messages::ppb(estimate.soc) : measurement::no_reading;
  }

  /// An erase stops the core for half a second, so it happens only while all contactors are open.
  [[gnu::noinline]] void store_state() {
    const StateToStore now(estimate_, condition_, cells_);
    persistence_.store(now.values(), hal::calendar_s());
    if (!protection_.decision().outputs.any_closed()) persistence_.erase_next_sector();
  }

  Estimator estimator_;
  estimator::Condition<Estimator> condition_;
  estimator::PackCells<typename Estimator::Scalar, cells> cells_;
  LatchedFaults latched_faults_;
  protection::Protection<cells> protection_;
  Telemetry<Estimator, cells> telemetry_;
  [[no_unique_address]] VehicleProfile vehicle_profile_;
  [[no_unique_address]] PulsesOf<Board> pulses_;
  float capacity_ah_ = 0;
  TruckSide<has_ship_mode<Board>> truck_;
  [[no_unique_address]] GroupSide<hal::has_group_bus> group_;
  Commands commands_;
  [[no_unique_address]] std::conditional_t<has_parameters, ParameterCommands, std::false_type> parameter_commands_;
  Requested requested_;
  Result estimate_{};
  Progress progress_;
  storage::Persistence& persistence_;
  Access access_;
  std::uint32_t cell_hash_;
  BoardStatus board_;
  bool first_ = true, setting_lost_ = false;
};

}  // namespace bms::firmware
