#include "monitor/pack_view.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "estimator/estimate.hpp"

namespace bms::monitor {

namespace {

constexpr int most_cells = 64;

constexpr std::pair<estimator::Flag, const char*> flag_texts[] = {
    {estimator::voltage_missing, "voltage missing"},
    {estimator::voltage_implausible, "voltage implausible"},
    {estimator::voltage_stuck, "voltage stuck"},
    {estimator::current_missing, "current missing"},
    {estimator::current_implausible, "current implausible"},
    {estimator::time_gap, "time gap"},
    {estimator::time_not_increasing, "time not increasing"},
    {estimator::not_started, "not started"},
    {estimator::soc_ambiguous, "more than one state of charge fits"},
    {estimator::voltage_rejected, "voltage rejected"},
    {estimator::soc_contradicted, "voltages contradicted the state of charge"},
    {estimator::current_beyond_limits, "current beyond the limits of the cell file"},
    {estimator::not_a_number, "not a number"}};

std::vector<TextItem> flag_items(const Reading& flags) {
  std::vector<TextItem> set;
  if (!flags.known()) return set;
  auto bits = static_cast<std::uint32_t>(flags.value);
  for (const auto& [bit, text] : flag_texts) {
    if ((bits & bit) != 0) set.push_back({text, "", flags.stale});
    bits &= ~static_cast<std::uint32_t>(bit);
  }
  if (bits != 0) set.push_back({fmt::format("unknown flags {:#x}", bits), "", flags.stale});
  return set;
}

/// Calls use(signal, value, stale) for each signal of a message. Returns false if the message was never received.
template <class Use>
bool each_signal(const BusState& bus, std::string_view message, Use&& use) {
  const std::size_t k = BusState::find(message);
  if (k == messages().size() || bus.states()[k].frames == 0) return false;
  for (std::size_t s = 0; s < messages()[k].signals.size(); ++s)
    use(messages()[k].signals[s], bus.states()[k].values[s], bus.stale(k));
  return true;
}

std::vector<Reading> cells_of(const BusState& bus) {
  std::vector<Reading> cells;
  for (const MessageInfo& message : messages()) {
    if (!std::string_view(message.name).starts_with("CellVoltages")) continue;
    const double age_s = bus.age_s(BusState::find(message.name));
    each_signal(bus, message.name, [&](const SignalInfo& signal, double value, bool stale) {
      const std::string_view name = signal.name;
      if (!name.starts_with("Cell") || !std::isfinite(value)) return;
      int number = 0;
      std::from_chars(name.data() + 4, name.data() + name.size(), number);
      if (number < 1 || number > most_cells) return;
      if (cells.size() < static_cast<std::size_t>(number)) cells.resize(static_cast<std::size_t>(number));
      cells[static_cast<std::size_t>(number) - 1] = {value, age_s, stale};
    });
  }
  return cells;
}

}  // namespace

std::string text_of(const SignalInfo& signal, double value) {
  const bool known = std::isfinite(value);
  const long raw = known ? std::lround((value - signal.offset) / signal.factor) : signal.layout.invalid;
  for (const can::ValueName& name : signal.names) {
    if (raw == name.raw && (known || signal.layout.has_invalid)) return name.text;
  }
  if (!known) return "-";
  if (signal.integer && signal.layout.bits > 16 && !signal.layout.is_signed && *signal.unit == '\0')
    return fmt::format("{:#x}", static_cast<std::int64_t>(value));
  return fmt::format("{:.{}f}{}{}", value, signal.digits, *signal.unit != '\0' ? " " : "", signal.unit);
}

PackView::Cells PackView::cells() const {
  Cells c;
  for (std::size_t k = 0; k < cells_v.size(); ++k) {
    if (!cells_v[k].known()) continue;
    const double v = cells_v[k].value;
    if (c.count == 0 || v < c.lowest_v) {
      c.lowest = k;
      c.lowest_v = v;
    }
    if (c.count == 0 || v > c.highest_v) {
      c.highest = k;
      c.highest_v = v;
    }
    ++c.count;
    c.mean_v += (v - c.mean_v) / static_cast<double>(c.count);
  }
  return c;
}

PackView pack_view(const BusState& bus) {
  PackView v;
  v.soc_percent = bus.reading("PackState", "Soc");
  v.soc_sigma_percent = bus.reading("PackState", "SocSigma");
  v.soc_display_percent = bus.reading("PackState", "SocDisplay");
  each_signal(bus, "PackState", [&](const SignalInfo& signal, double value, bool stale) {
    if (std::string_view(signal.name) != "SocQuality") return;
    v.soc_quality = {text_of(signal, value), signal.comment, stale};
    if (std::isfinite(value)) v.soc_quality_value = static_cast<int>(value);
  });
  v.voltage_v = bus.reading("PackElectrical", "Voltage");
  if (!v.voltage_v.known()) v.voltage_v = bus.reading("PackVoltage", "Voltage");  // more than 16 cells
  v.current_a = bus.reading("PackElectrical", "Current");
  v.temperature_c = bus.reading("PackElectrical", "Temperature");
  v.front_end_c = bus.reading("FrontEnd", "DieTemperature");
  v.discharge_now_a = bus.reading("CurrentLimits", "DischargeNow");
  v.charge_now_a = bus.reading("CurrentLimits", "ChargeNow");
  v.discharge_10s_a = bus.reading("CurrentLimits", "DischargeTenSeconds");
  v.charge_10s_a = bus.reading("CurrentLimits", "ChargeTenSeconds");
  v.capacity_percent = bus.reading("Health", "Capacity");
  v.capacity_sigma_percent = bus.reading("Health", "CapacitySigma");
  v.resistance_percent = bus.reading("Health", "Resistance");
  v.resistance_sigma_percent = bus.reading("Health", "ResistanceSigma");
  v.cells_v = cells_of(bus);
  each_signal(bus, "ContactorState", [&](const SignalInfo& signal, double value, bool stale) {
    if (!std::isfinite(value) || (signal.layout.bits == 1 && value == 0)) return;
    std::string text = text_of(signal, value);
    if (signal.layout.bits == 1)
      text = signal.name;
    else if (std::string_view(signal.name) != "State")
      text = fmt::format("{} {}", signal.name, text);
    v.contactor.push_back({text, signal.comment, stale});
  });
  const auto add_fault = [&](const SignalInfo& signal, double value, bool stale) {
    if (!std::isfinite(value) || value == 0) return;
    if (signal.layout.bits == 1)
      v.faults.push_back({signal.name, signal.comment, stale});
    else
      v.fault_details.push_back({fmt::format("{} {}", signal.name, text_of(signal, value)), signal.comment, stale});
  };
  v.faults_received = each_signal(bus, "Faults", add_fault);
  each_signal(bus, "MoreFaults", add_fault);
  v.flags = flag_items(bus.reading("Status", "Flags"));
  return v;
}

}  // namespace bms::monitor
