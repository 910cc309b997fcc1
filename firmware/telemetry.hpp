// Decides which message is sent when. Time is the time of the samples: a recording that is played back faster than it
// was made gives the same frames.
//
// Nothing is sent while no node listens. The frames of a sample end with Status, so that the sender of samples knows
// when the next one may follow (lock step).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <tuple>
#include <type_traits>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake
#include "estimator/pack_estimator.hpp"
#include "firmware/commands.hpp"
#include "firmware/cycle.hpp"
#include "firmware/messages.hpp"
#include "firmware/snapshot.hpp"
#include "firmware/stored_data.hpp"
#include "firmware/stored_state.hpp"
#include "firmware/truck_message.hpp"
#include "hal/can.hpp"
#include "hal/charger_bus.hpp"
#include "hal/power.hpp"
#include "protection/protection.hpp"

namespace bms::firmware {

template <class Estimator, std::size_t Cells>
class Telemetry {
 public:
  /// start: where the estimator began, if it was given.
  constexpr Telemetry(const messages::Identity& identity, const std::optional<measurement::StartingPoint>& start)
      : identity_(identity), start_(start) {}

  /// Sends the messages of one sample.
  void publish(const Snapshot<Estimator, Cells>& now) {
    ++samples_;
    hash_.add(estimator::words(now.estimate));
    if (!hal::can_listening()) {
      ++published_;
      return;
    }
    publish_fault();
    now_us_ = static_cast<std::uint32_t>(now.pack.time_us);
    publish_protection(now.decision);
    if constexpr (Cells > 1) publish_cells(now);
    send_if_due<can::Identity>([&] { return messages::identity(identity_); });
    send_if_due<can::CurrentLimits>([&] { return messages::current_limits(now.condition); });
    send_if_due<can::Health>([&] { return messages::health(now.condition); });
    send_if_due<can::SocAnchor>([&] { return messages::soc_anchor(now.condition); });
    if constexpr (Estimator::Model::errors_are_states)
      send_if_due<can::SensorErrors>([&] { return messages::sensor_errors(now.estimate, now.capacity_ah); });
    if (now.request_challenge) send_if_due<can::RequestChallenge>([&] { return *now.request_challenge; });
    send_if_due<can::Storage>([&] { return messages::storage(now.persistence); });
    send_if_due_or_changed<can::Board>(now.board.alarming() != published_alarming_, [&] {
      auto m = messages::board(now.board.state, now.board.cell_file_changed, now.board.longest_sample_us);
      if constexpr (hal::has_parameters) m.parameters_lost = now.board.parameters_lost ? 1 : 0;
      return m;
    });
    published_alarming_ = now.board.alarming();
    publish_truck(now.board);
    if (now.stored_part) [[unlikely]]
      stored_data_.send(*now.stored_part, now.persistence,
                        static_cast<std::uint32_t>(scaled_to_integer(now.capacity_ah, 1e6F)));
    if (now.log_samples) log(now.mean);
    send(messages::pack_state(now.estimate, now.condition));
    send(messages::pack_electrical(now.pack));
    send(messages::model_detail(now.estimate));
    can::Status status;
    status.flags = now.estimate.flags;
    status.sample_counter = samples_;
    status.reset_cause = static_cast<std::uint32_t>(hal::reset_cause());
    send(status);
    ++published_;
  }

  /// Samples that were published completely, also those without a listener. Wraps.
  std::uint32_t published() const { return published_; }

  void answer(const can::CommandAnswer& answer) { send(answer); }
  /// The frames of a parameter, in the order of ParameterValue.Kind.
  void send_parameter(std::uint8_t number, const std::array<std::int32_t, 4>& values) {
    can::ParameterValue m;
    m.number = number;
    for (const std::int32_t value : values) {
      m.value = value;
      send(m);
      ++m.kind;
    }
  }
  void answer(const can::ServiceChallenge& answer) { send(answer); }

 private:
  /// Time of the last frame of a message, and its counter.
  struct SendState : Cycle {
    std::uint8_t counter = 0;
  };
  template <class Message>
  SendState& state_of() {
    constexpr std::size_t place = []<class... Known>(std::type_identity<std::tuple<Known...>>) {
      std::size_t before = 0;
      (void)((std::is_same_v<Message, Known> || (++before, false)) || ...);
      return before;
    }(std::type_identity<can::Messages>());
    static_assert(place < messages);
    return sent_[place];
  }

  template <class Message>
  void send(const Message& message) {
    send_as<Message>(message);
  }
  template <class Message>
  void send(const messages::BitMessage<Message>& message) {
    send_as<Message>(message);
  }
  template <class Message, class Content>
  void send_as(const Content& message) {
    SendState& sent = state_of<Message>();
    hal::can_send(message.frame(sent.counter));
    sent.counter = can::next(sent.counter);
  }

  /// Calls message() only when it is due.
  template <class Message, class Make>
  void send_if_due(Make&& message) {
    if (state_of<Message>().due(now_us_, Message::cycle_us)) send(message());
  }

  /// Sends when the message is due, or at once when its content has changed.
  template <class Message, class Make>
  void send_if_due_or_changed(bool changed, Make&& message) {
    if (changed) state_of<Message>().restart();
    send_if_due<Message>(message);
  }

  void publish_protection(const protection::Decision& d) {
    const bool faults_changed = d.faults != published_faults_;
    send_if_due_or_changed<can::Faults>(faults_changed, [&] { return messages::faults(d); });
    send_if_due_or_changed<can::MoreFaults>(faults_changed, [&] { return messages::more_faults(d); });
    send_if_due_or_changed<can::ContactorState>(d.state != published_state_ || d.outputs != published_outputs_,
                                                [&] { return messages::contactor_state(d); });
    send_if_due<can::AllowedCurrent>([&] { return messages::allowed_current(d); });
    const std::uint32_t trips = hal::second_line_trips();
    send_if_due_or_changed<can::FrontEnd>(trips != published_trips_,
                                          [&] { return messages::front_end(trips, hal::front_end_health()); });
    published_trips_ = trips;
    published_faults_ = d.faults;
    published_state_ = d.state;
    published_outputs_ = d.outputs;
  }

  void publish_truck(const BoardStatus& board) {
    if constexpr (!hal::may_have_truck) return;
    // Without inputs the message begins with the first wrong sensor, and then says when none is wrong any more.
    if (!hal::has_charger_bus && board.truck.fitted == 0 && !board.insulation.fitted && published_inputs_ == 0 &&
        board.wrong_current_sensor == can::TruckInputs::wrong_current_sensor_none)
      return;
    const std::uint32_t inputs =
        1U << 31 | board.wrong_current_sensor << 28 | board.truck.fitted << 16 | board.truck.on;
    send_if_due_or_changed<can::TruckInputs>(inputs != published_inputs_, [&] {
      const auto m =
          messages::truck_inputs(board.truck, board.insulation, board.truck_outputs, board.wrong_current_sensor);
      if constexpr (hal::has_charger_bus) return messages::with_charger_bus(m, hal::charger_can_health());
      return m;
    });
    published_inputs_ = inputs;
  }

  void publish_cells(const Snapshot<Estimator, Cells>& now) {
    static_assert(Cells <= 32, "further cells have no message");
    send_if_due<can::CellVoltages1>([&] { return messages::cell_voltages<can::CellVoltages1, 0>(now.pack); });
    if constexpr (Cells > 4)
      send_if_due<can::CellVoltages2>([&] { return messages::cell_voltages<can::CellVoltages2, 4>(now.pack); });
    if constexpr (Cells > 8)
      send_if_due<can::CellVoltages3>([&] { return messages::cell_voltages<can::CellVoltages3, 8>(now.pack); });
    if constexpr (Cells > 12)
      send_if_due<can::CellVoltages4>([&] { return messages::cell_voltages<can::CellVoltages4, 12>(now.pack); });
    if constexpr (Cells > 16)
      send_if_due<can::CellVoltages5>([&] { return messages::cell_voltages<can::CellVoltages5, 16>(now.pack); });
    if constexpr (Cells > 20)
      send_if_due<can::CellVoltages6>([&] { return messages::cell_voltages<can::CellVoltages6, 20>(now.pack); });
    if constexpr (Cells > 24)
      send_if_due<can::CellVoltages7>([&] { return messages::cell_voltages<can::CellVoltages7, 24>(now.pack); });
    if constexpr (Cells > 28)
      send_if_due<can::CellVoltages8>([&] { return messages::cell_voltages<can::CellVoltages8, 28>(now.pack); });
    if constexpr (Cells > messages::max_cells_of_pack_electrical)
      send_if_due<can::PackVoltage>([&] { return messages::pack_voltage(now.pack); });
    send_if_due<can::CellExtremes>([&] { return messages::cell_extremes(now.pack, now.cells); });
    if (now.plan.rule(protection::Fault::short_circuit).threshold > messages::most_ua_of_pack_electrical)
      send_if_due<can::PackCurrent>([&] { return messages::pack_current(now.pack); });
    send_if_due<can::Temperatures>([&] { return messages::temperatures(now.pack); });
    send_if_due<can::Balancing>([&] { return messages::balancing(now.decision); });
  }

  void publish_fault() {
    if (fault_published_) return;
    fault_published_ = true;
    const auto fault = hal::last_fault();
    if (!fault) return;
    can::LastFaultAddress address;
    address.program_counter = fault->pc;
    send(address);
    can::LastFaultCause cause;
    cause.configurable_fault_status = fault->cfsr;
    send(cause);
  }

  void log(const measurement::Sample& sample) {
    if (samples_ == 1) {
      send(messages::starting_soc(start_));
      send(messages::starting_sigma(start_));
    }
    send(messages::sample_current(sample, samples_));
    send(messages::sample_voltage(sample));
    send(messages::sample_time(sample));
    can::EstimateHash hash;
    hash.hash = hash_.value();
    hash.sample_counter = samples_;
    send(hash);
  }

  messages::Identity identity_;
  std::optional<measurement::StartingPoint> start_;
  /// Of those before PulseCurrents, which firmware/pulse_currents.hpp sends; with more than 24 cells also of those
  /// behind it, which are cells 25 to 32. A tuple takes 800 bytes of code to initialise.
  static constexpr std::size_t known = std::tuple_size_v<can::Messages>, pulses = known - 3;
  static constexpr std::size_t messages = Cells > 24 ? known : pulses;
  static_assert(std::is_same_v<std::tuple_element_t<pulses, can::Messages>, can::PulseCurrents>);
  std::array<SendState, messages> sent_{};
  StoredData stored_data_;
  estimator::EstimateHash hash_;
  protection::FaultSet published_faults_ = 0;
  std::uint32_t now_us_ = 0, published_ = 0, published_trips_ = 0, published_inputs_ = 0;
  protection::ContactorState published_state_ = protection::ContactorState::off;
  protection::Outputs published_outputs_;
  std::uint16_t samples_ = 0;
  bool fault_published_ = false, published_alarming_ = false;
};

}  // namespace bms::firmware
