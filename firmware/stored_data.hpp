// The stored data as frames (Command: stored data). They are sent in parts, one with each sample: first the sixteen
// faults with three frames each, then for each cause of a reset its number and one more frame.
//
// The messages are packed from raw integers, because the records contain the raw values of their signals. Of all
// messages id and data id are equal.
#pragma once

#include <algorithm>
#include <cstdint>

#include "can_messages.hpp"  // generated from can/greybox_bms.dbc
#include "firmware/commands.hpp"
#include "hal/can.hpp"
#include "storage/persistence.hpp"

namespace bms::firmware::stored_data {

inline constexpr std::uint32_t faults = storage::EventsRecord::max_faults;
static_assert(stored_items == faults + storage::EventsRecord::causes);

constexpr std::uint64_t raw(const can::SignalLayout& signal, std::uint64_t value) {
  return (value & can::mask(signal.bits)) << signal.start;
}
/// The highest value of the signal if `value` is above it.
constexpr std::uint64_t saturated(const can::SignalLayout& signal, std::uint64_t value) {
  return raw(signal, std::min(value, can::mask(signal.bits)));
}

template <class Send>
constexpr void send_fault(std::uint32_t index, const storage::EventsRecord& events, Send&& send) {
  using F = can::StoredFault;
  using P = can::StoredFaultPack;
  using C = can::StoredFaultCells;
  const storage::EventsRecord::Fault fault = events.last(index);
  const std::uint32_t number = events.faults - index;
  const std::uint64_t readings = bits(fault.readings);
  // The bits of the readings are in the order of the signals.
  constexpr unsigned pack_bits = P::number_layout.start - P::soc_layout.start;
  static_assert(C::number_layout.start - C::highest_voltage_layout.start == 64 - pack_bits);
  send(F{}, raw(F::index_layout, index) | raw(F::code_layout, storage::short_code(fault.code)) |
                raw(F::time_layout, fault.time_s) | raw(F::number_layout, number));
  send(P{}, raw(P::index_layout, index) | (readings & can::mask(pack_bits)) << P::soc_layout.start |
                raw(P::number_layout, number));
  send(C{}, raw(C::index_layout, index) | readings >> pack_bits << C::highest_voltage_layout.start |
                raw(C::number_layout, number));
}

template <class Send>
constexpr void send_extreme(const storage::ExtremesRecord& extremes, std::uint32_t kind, Send&& send) {
  using M = can::StoredExtremes;
  const auto& x = kind == M::kind_lowest ? extremes.lowest : extremes.highest;
  send(M{}, raw(M::kind_layout, kind) | raw(M::voltage_layout, x.voltage) | raw(M::temperature_layout, x.temperature) |
                raw(M::current_layout, static_cast<std::uint16_t>(x.current)));
}

template <class Send>
void send_can_errors(Send&& send) {
  using M = can::CanErrors;
  const hal::CanHealth h = hal::can_health();
  send(M{}, raw(M::state_layout, static_cast<std::uint32_t>(h.state)) |
                raw(M::transmit_errors_layout, h.transmit_errors) | raw(M::receive_errors_layout, h.receive_errors) |
                saturated(M::dropped_layout, h.dropped) |
                saturated(M::lost_layout, std::uint64_t{h.lost} + h.overruns) |
                saturated(M::bus_offs_layout, h.bus_offs) | saturated(M::failed_starts_layout, h.failed_starts));
}

/// Calls send(message type, bits from bit 12 on) for each frame of an item below stored_items.
template <class Send>
void send_item(std::uint32_t item, const storage::Persistence& stored, std::uint32_t capacity_uah, Send&& send) {
  const storage::EventsRecord& events = stored.events();
  const storage::ChargeRecord& charge = stored.charge();
  if (item < faults) return send_fault(item, events, send);
  const std::uint32_t cause = item - faults;
  using N = can::StoredCounts;
  using U = can::StoredUse;
  using T = can::StoredThroughput;
  send(N{}, raw(N::cause_layout, cause) | raw(N::resets_layout, events.resets[cause]) |
                raw(N::faults_layout, events.faults));
  constexpr std::uint32_t uah_per_count = 100'000, milli_per_count = 100;
  switch (cause) {
    case 0:
      return send(U{}, raw(U::operating_time_layout, charge.operating_s) |
                           saturated(U::cycles_layout, cycles_milli(charge, capacity_uah) / milli_per_count));
    case 1:
      return send(T{}, saturated(T::charged_layout, charge.charged_uah / uah_per_count) |
                           saturated(T::discharged_layout, charge.discharged_uah / uah_per_count));
    case 2:
    case 3:
      return send_extreme(stored.extremes(), cause - 2, send);
    case 4:
      return send_can_errors(send);
    default:
      return;
  }
}

}  // namespace bms::firmware::stored_data
