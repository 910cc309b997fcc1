// Which message goes out when. Time is the samples' own: a recording fed in faster than it was made gives the same
// frames.
//
// Nothing is sent while nobody listens. Every sample that is told ends with the status frame, so that who has
// read it has the whole sample and may send the next (lock step).
#pragma once

#include <cstdint>
#include <optional>
#include <tuple>

#include "estimator/pack_estimator.hpp"
#include "firmware/commands.hpp"
#include "firmware/cycle.hpp"
#include "firmware/messages.hpp"
#include "hal/board_state.hpp"
#include "hal/can.hpp"
#include "hal/power.hpp"
#include "protection/protection.hpp"
#include "storage/persistence.hpp"

namespace bms::firmware {

/// What is told of the board beside the pack.
struct BoardStatus {
  hal::BoardState state;
  bool cell_file_changed = false;       ///< since what is stored was stored
  std::uint32_t longest_sample_us = 0;  ///< 0: not known yet

  constexpr bool unfit() const { return state.unfit() || cell_file_changed; }
  constexpr bool alarming() const { return unfit() || state.supply_low; }
};

template <class Estimator, std::size_t Cells>
class Telemetry {
 public:
  using Result = typename Estimator::Result;

  /// capacity_ah: of the cell file; start: where the estimator began, if somebody said.
  constexpr Telemetry(const messages::Identity& identity, float capacity_ah,
                      const std::optional<measurement::StartingPoint>& start)
      : identity_(identity), capacity_ah_(capacity_ah), start_(start) {}

  /// mean: what the estimator was given of the pack.
  void publish(const measurement::PackSample<Cells>& pack, const measurement::Sample& mean, const Result& estimate,
               const estimator::Condition<Estimator>& condition,
               const estimator::PackCells<typename Estimator::Scalar, Cells>& cells,
               const protection::Decision& decision, const storage::Persistence& persistence, const BoardStatus& board,
               bool log_samples) {
    ++samples_;
    hash_.add(estimator::words(estimate));
    if (!hal::can_listening()) {
      ++published_;
      return;
    }
    publish_fault();
    now_us_ = static_cast<std::uint32_t>(pack.time_us);
    publish_protection(decision);
    if constexpr (Cells > 1) publish_cells(pack, cells, decision);
    send_if_due<can::Identity>([&] { return messages::identity(identity_); });
    send_if_due<can::CurrentLimits>([&] { return messages::current_limits(condition); });
    send_if_due<can::Health>([&] { return messages::health(condition); });
    send_if_due<can::SocAnchor>([&] { return messages::soc_anchor(condition); });
    if constexpr (Estimator::Model::errors_are_states)
      send_if_due<can::SensorErrors>([&] { return messages::sensor_errors(estimate, capacity_ah_); });
    send_if_due<can::Storage>([&] { return messages::storage(persistence); });
    send_if_due_or_changed<can::Board>(board.alarming() != published_alarming_, [&] {
      return messages::board(board.state, board.cell_file_changed, board.longest_sample_us);
    });
    published_alarming_ = board.alarming();
    if (log_samples) log(mean);
    send(messages::pack_state(estimate, condition));
    send(messages::pack_electrical(pack));
    send(messages::model_detail(estimate));
    can::Status status;
    status.flags = estimate.flags;
    status.sample_counter = samples_;
    status.reset_cause = static_cast<std::uint32_t>(hal::reset_cause());
    send(status);
    ++published_;
  }

  /// Samples of which all was told that is to be told, or to nobody; wraps.
  std::uint32_t published() const { return published_; }

  void answer(const can::CommandAnswer& answer) { send(answer); }

 private:
  /// What is remembered of a message.
  template <class Message>
  struct SendState : Cycle {
    std::uint8_t counter = 0;
  };
  template <class>
  struct SendStatesOf;
  template <class... Message>
  struct SendStatesOf<std::tuple<Message...>> {
    using type = std::tuple<SendState<Message>...>;
  };

  template <class Message>
  void send(const Message& message) {
    auto& sent = std::get<SendState<Message>>(sent_);
    hal::can_send(message.frame(sent.counter));
    sent.counter = can::next(sent.counter);
  }

  /// message(): made when it is due.
  template <class Message, class Make>
  void send_if_due(Make&& message) {
    if (std::get<SendState<Message>>(sent_).due(now_us_, Message::cycle_us)) send(message());
  }

  /// When the message is due, or at once when what it says has changed.
  template <class Message, class Make>
  void send_if_due_or_changed(bool changed, Make&& message) {
    if (changed) std::get<SendState<Message>>(sent_).restart();
    send_if_due<Message>(message);
  }

  void publish_protection(const protection::Decision& d) {
    send_if_due_or_changed<can::Faults>(d.faults != published_faults_, [&] { return messages::faults(d); });
    send_if_due_or_changed<can::ContactorState>(d.state != published_state_ || d.outputs != published_outputs_,
                                                [&] { return messages::contactor_state(d); });
    send_if_due<can::AllowedCurrent>([&] { return messages::allowed_current(d); });
    published_faults_ = d.faults;
    published_state_ = d.state;
    published_outputs_ = d.outputs;
  }

  void publish_cells(const measurement::PackSample<Cells>& pack,
                     const estimator::PackCells<typename Estimator::Scalar, Cells>& cells,
                     const protection::Decision& d) {
    send_if_due<can::CellVoltages1>([&] { return messages::cell_voltages<can::CellVoltages1, 0>(pack); });
    if constexpr (Cells > 4)
      send_if_due<can::CellVoltages2>([&] { return messages::cell_voltages<can::CellVoltages2, 4>(pack); });
    if constexpr (Cells > 8)
      send_if_due<can::CellVoltages3>([&] { return messages::cell_voltages<can::CellVoltages3, 8>(pack); });
    if constexpr (Cells > 12)
      send_if_due<can::CellVoltages4>([&] { return messages::cell_voltages<can::CellVoltages4, 12>(pack); });
    send_if_due<can::CellExtremes>([&] { return messages::cell_extremes(pack, cells); });
    send_if_due<can::Temperatures>([&] { return messages::temperatures(pack); });
    send_if_due<can::Balancing>([&] { return messages::balancing(d); });
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
  float capacity_ah_ = 0;
  std::optional<measurement::StartingPoint> start_;
  typename SendStatesOf<can::Messages>::type sent_{};
  estimator::EstimateHash hash_;
  std::uint32_t now_us_ = 0, published_faults_ = 0, published_ = 0;
  protection::ContactorState published_state_ = protection::ContactorState::off;
  protection::Outputs published_outputs_;
  std::uint16_t samples_ = 0;
  bool fault_published_ = false, published_alarming_ = false;
};

}  // namespace bms::firmware
