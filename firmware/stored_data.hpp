// The stored data as frames (Command: stored data). They are sent in parts, one with each sample: first the sixteen
// faults with three frames each, then for each cause of a reset its number and one more frame, then the sixteen actions
// of service sessions with two frames each.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "firmware/commands.hpp"
#include "hal/can.hpp"
#include "storage/persistence.hpp"

namespace bms::firmware {

class StoredData {
 public:
  /// Sends the frames of one part. part: below stored_parts (commands.hpp).
  void send(std::uint32_t part, const storage::Persistence& stored, std::uint32_t capacity_uah);

 private:
  static constexpr std::uint16_t first_id = can::StoredFault::id;

  void send_fault(std::uint32_t index, const storage::EventsRecord& events);
  void send_action(std::uint32_t index, const storage::ActionsRecord& actions);
  void send_extreme(const storage::ReadingRange& range, std::uint32_t kind);
  void send_can_errors();

  template <can::SignalLayout signal>
  void put(std::uint32_t raw) {
    put(signal.start, raw);
  }
  /// The highest value of the signal if `raw` is above it.
  template <can::SignalLayout signal>
  void put_saturated(std::uint32_t raw) {
    put(signal.start, std::min(raw, static_cast<std::uint32_t>(can::mask(signal.bits))));
  }
  void put(unsigned start, std::uint32_t raw);
  template <class Message>
  void send() {
    static_assert(Message::data_id == Message::id);
    if constexpr (Message::id == can::StoredAction::id || Message::id == can::StoredActionDetail::id)
      send(Message::id, counter_[first_action + Message::id - can::StoredAction::id]);
    else
      send(Message::id, counter_[Message::id - first_id]);
  }
  void send(std::uint16_t id, std::uint8_t& counter);

  static constexpr std::size_t first_action = 8, counters = first_action + 2;
  std::uint64_t bits_ = 0;  ///< of the frame that is being made
  std::array<std::uint8_t, counters> counter_{};
};

static_assert(stored_parts ==
              storage::EventsRecord::max_faults + storage::EventsRecord::causes + storage::ActionsRecord::max_actions);

// The records contain the raw values of the signals, so the frames are made of integers.

[[gnu::noinline]] inline void StoredData::put(unsigned start, std::uint32_t raw) {
  bits_ |= std::uint64_t{raw} << start;
}

inline void StoredData::send(std::uint16_t id, std::uint8_t& counter) {
  can::Frame frame{id, 8, {}, false};
  can::set_bits(frame, bits_);
  bits_ = 0;
  can::protect(frame, id, counter);
  counter = can::next(counter);
  hal::can_send(frame);
}

inline void StoredData::send_fault(std::uint32_t index, const storage::EventsRecord& events) {
  using F = can::StoredFault;
  using P = can::StoredFaultPack;
  using C = can::StoredFaultCells;
  const storage::EventsRecord::Fault fault = events.last(index);
  const std::uint32_t number = (events.faults - index) & 0xFF;
  put<F::index_layout>(index);
  put<F::code_layout>(storage::short_code(fault.code));
  put<F::time_layout>(fault.time_s);
  put<F::number_layout>(number);
  send<F>();
  // The bits of the readings are in the order of the signals of two messages.
  constexpr unsigned pack_bits = P::number_layout.start - P::soc_layout.start;
  static_assert(pack_bits == 38 && C::number_layout.start - C::highest_voltage_layout.start == 26);
  const auto low = static_cast<std::uint32_t>(fault.readings), high = static_cast<std::uint32_t>(fault.readings >> 32);
  put<P::index_layout>(index);
  put<P::soc_layout>(low);
  put(P::soc_layout.start + 32, high & 0x3F);
  put<P::number_layout>(number);
  send<P>();
  put<C::index_layout>(index);
  put<C::highest_voltage_layout>(high >> 6);
  put<C::number_layout>(number);
  send<C>();
}

inline void StoredData::send_action(std::uint32_t index, const storage::ActionsRecord& actions) {
  using A = can::StoredAction;
  using D = can::StoredActionDetail;
  const storage::ActionsRecord::Action action = actions.last(index);
  put<A::index_layout>(index);
  put<A::code_layout>(action.code);
  put<A::time_layout>(action.time_s);
  put<A::number_layout>((actions.actions - index) & 0xFF);
  send<A>();
  put<D::index_layout>(index);
  put<D::operator_number_layout>(action.operator_number);
  put<D::argument_layout>(action.argument);
  send<D>();
}

inline void StoredData::send_extreme(const storage::ReadingRange& range, std::uint32_t kind) {
  using M = can::StoredExtremes;
  const auto& values = kind == M::kind_lowest ? range.lowest : range.highest;
  const auto raw = [&](std::size_t k) { return static_cast<std::uint32_t>(values[k]); };
  using enum storage::ReadingRange::Quantity;
  put<M::kind_layout>(kind);
  put<M::voltage_layout>(raw(voltage));
  put<M::temperature_layout>(raw(temperature));
  put<M::current_layout>(raw(current) & static_cast<std::uint32_t>(can::mask(M::current_layout.bits)));
  send<M>();
}

inline void StoredData::send_can_errors() {
  using M = can::CanErrors;
  const hal::CanHealth health = hal::can_health();
  put<M::state_layout>(static_cast<std::uint32_t>(health.state));
  put<M::transmit_errors_layout>(health.transmit_errors);
  put<M::receive_errors_layout>(health.receive_errors);
  put_saturated<M::dropped_layout>(health.dropped);
  put_saturated<M::lost_layout>(health.lost + health.overruns);
  put_saturated<M::bus_offs_layout>(health.bus_offs);
  put_saturated<M::failed_starts_layout>(health.failed_starts);
  send<M>();
}

inline void StoredData::send(std::uint32_t part, const storage::Persistence& stored, std::uint32_t capacity_uah) {
  using N = can::StoredCounts;
  using U = can::StoredUse;
  using T = can::StoredThroughput;
  const storage::EventsRecord& events = stored.events();
  const storage::ChargeRecord& charge = stored.charge();
  constexpr std::uint32_t faults = storage::EventsRecord::max_faults;
  if (part < faults) return send_fault(part, events);
  const std::uint32_t cause = part - faults;
  constexpr std::uint32_t causes = storage::EventsRecord::causes;
  if (cause >= causes) return send_action(cause - causes, stored.actions());
  put<N::cause_layout>(cause);
  put<N::resets_layout>(events.resets[cause]);
  put<N::faults_layout>(events.faults);
  send<N>();
  constexpr std::uint32_t uah_per_count = 100'000;  // 0.1 Ah
  const auto counts = [](std::uint64_t uah) { return static_cast<std::uint32_t>(uah / uah_per_count); };
  switch (cause) {
    case 0:
      put<U::operating_time_layout>(charge.operating_s);
      put_saturated<U::cycles_layout>(static_cast<std::uint32_t>(cycles_milli(charge, capacity_uah) / 100));
      return send<U>();
    case 1:
      put_saturated<T::charged_layout>(counts(charge.charged_uah));
      put_saturated<T::discharged_layout>(counts(charge.discharged_uah));
      return send<T>();
    case 2:
    case 3:
      return send_extreme(stored.extremes().range, cause - 2);
    case 4:
      return send_can_errors();
    default:
      return;
  }
}

}  // namespace bms::firmware
