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
struct OfBoard {
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
  void tell(const measurement::PackSample<Cells>& pack, const measurement::Sample& mean, const Result& estimate,
            const estimator::Condition<Estimator>& condition,
            const estimator::PackCells<typename Estimator::Scalar, Cells>& cells, const protection::Decision& decision,
            const storage::Persistence& persistence, const OfBoard& board, bool log_samples) {
    ++samples_;
    hash_.take(estimator::words(estimate));
    if (!hal::can_listening()) {
      ++told_;
      return;
    }
    tell_fault();
    now_us_ = static_cast<std::uint32_t>(pack.time_us);
    tell_protection(decision);
    if constexpr (Cells > 1) tell_cells(pack, cells, decision);
    by_time<can::Identity>([&] { return messages::identity(identity_); });
    by_time<can::CurrentLimits>([&] { return messages::current_limits(condition); });
    by_time<can::Health>([&] { return messages::health(condition); });
    by_time<can::SocAnchor>([&] { return messages::soc_anchor(condition); });
    if constexpr (Estimator::Model::errors_are_states)
      by_time<can::SensorErrors>([&] { return messages::sensor_errors(estimate, capacity_ah_); });
    by_time<can::Storage>([&] { return messages::storage(persistence); });
    by_time_or<can::Board>(board.alarming() != alarming_told_, [&] {
      return messages::board(board.state, board.cell_file_changed, board.longest_sample_us);
    });
    alarming_told_ = board.alarming();
    if (log_samples) log(mean);
    send(messages::pack_state(estimate, condition));
    send(messages::pack_electrical(pack));
    send(messages::model_detail(estimate));
    can::Status status;
    status.flags = estimate.flags;
    status.sample_counter = samples_;
    status.reset_cause = static_cast<std::uint32_t>(hal::reset_cause());
    send(status);
    ++told_;
  }

  /// Samples of which all was told that is to be told, or to nobody; wraps.
  std::uint32_t told() const { return told_; }

  void answer(const can::CommandAnswer& answer) { send(answer); }

 private:
  /// What is remembered of a message.
  template <class Message>
  struct Sent : Cycle {
    std::uint8_t counter = 0;
  };
  template <class>
  struct OfAll;
  template <class... Message>
  struct OfAll<std::tuple<Message...>> {
    using type = std::tuple<Sent<Message>...>;
  };

  template <class Message>
  void send(const Message& message) {
    auto& sent = std::get<Sent<Message>>(sent_);
    hal::can_send(message.frame(sent.counter));
    sent.counter = can::next(sent.counter);
  }

  /// message(): made when it is due.
  template <class Message, class Make>
  void by_time(Make&& message) {
    if (std::get<Sent<Message>>(sent_).due(now_us_, Message::cycle_us)) send(message());
  }

  /// When the message is due, or at once when what it says has changed.
  template <class Message, class Make>
  void by_time_or(bool changed, Make&& message) {
    if (changed) std::get<Sent<Message>>(sent_).restart();
    by_time<Message>(message);
  }

  void tell_protection(const protection::Decision& d) {
    by_time_or<can::Faults>(d.faults != faults_told_, [&] { return messages::faults(d); });
    by_time_or<can::ContactorState>(d.state != state_told_ || d.outputs != outputs_told_,
                                    [&] { return messages::contactor_state(d); });
    by_time<can::AllowedCurrent>([&] { return messages::allowed_current(d); });
    faults_told_ = d.faults;
    state_told_ = d.state;
    outputs_told_ = d.outputs;
  }

  void tell_cells(const measurement::PackSample<Cells>& pack,
                  const estimator::PackCells<typename Estimator::Scalar, Cells>& cells, const protection::Decision& d) {
    by_time<can::CellVoltages1>([&] { return messages::cell_voltages<can::CellVoltages1, 0>(pack); });
    if constexpr (Cells > 4)
      by_time<can::CellVoltages2>([&] { return messages::cell_voltages<can::CellVoltages2, 4>(pack); });
    if constexpr (Cells > 8)
      by_time<can::CellVoltages3>([&] { return messages::cell_voltages<can::CellVoltages3, 8>(pack); });
    if constexpr (Cells > 12)
      by_time<can::CellVoltages4>([&] { return messages::cell_voltages<can::CellVoltages4, 12>(pack); });
    by_time<can::CellExtremes>([&] { return messages::cell_extremes(pack, cells); });
    by_time<can::Temperatures>([&] { return messages::temperatures(pack); });
    by_time<can::Balancing>([&] { return messages::balancing(d); });
  }

  void tell_fault() {
    if (fault_told_) return;
    fault_told_ = true;
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
  typename OfAll<can::Messages>::type sent_{};
  estimator::EstimateHash hash_;
  std::uint32_t now_us_ = 0, faults_told_ = 0, told_ = 0;
  protection::ContactorState state_told_ = protection::ContactorState::off;
  protection::Outputs outputs_told_;
  std::uint16_t samples_ = 0;
  bool fault_told_ = false, alarming_told_ = false;
};

}  // namespace bms::firmware
