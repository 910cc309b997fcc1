#include "monitor/results.hpp"

#include <cmath>
#include <iterator>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "monitor/pack_view.hpp"

namespace bms::monitor {

namespace {

using Json = nlohmann::ordered_json;

/// NaN and infinity become null.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }
Json fraction(const Reading& percent) { return number(std::round(percent.value * 1e7) / 1e9); }
Json seconds(double s) { return number(std::round(s * 1e6) / 1e6); }

Json list_of(const std::vector<TextItem>& items) {
  Json list = Json::array();
  for (const TextItem& item : items) list.push_back(item.text);
  return list;
}

Json pack_json(const BusState& bus) {
  const PackView p = pack_view(bus);
  Json json = {{"stale", p.soc_percent.stale},
               {"soc", fraction(p.soc_percent)},
               {"soc_sigma", fraction(p.soc_sigma_percent)},
               {"soc_display", fraction(p.soc_display_percent)},
               {"soc_quality", p.soc_quality.text.empty() ? Json(nullptr) : Json(p.soc_quality.text)},
               {"voltage_v", number(p.voltage_v.value)},
               {"current_a", number(p.current_a.value)},
               {"temperature_c", number(p.temperature_c.value)},
               {"front_end_c", number(p.front_end_c.value)},
               {"limits",
                {{"discharge_now_a", number(p.discharge_now_a.value)},
                 {"charge_now_a", number(p.charge_now_a.value)},
                 {"discharge_10s_a", number(p.discharge_10s_a.value)},
                 {"charge_10s_a", number(p.charge_10s_a.value)}}},
               {"health",
                {{"capacity", fraction(p.capacity_percent)},
                 {"capacity_sigma", fraction(p.capacity_sigma_percent)},
                 {"resistance", fraction(p.resistance_percent)},
                 {"resistance_sigma", fraction(p.resistance_sigma_percent)}}}};
  json["cells_v"] = Json::array();
  for (const Reading& cell : p.cells_v) json["cells_v"].push_back(number(cell.value));
  json["contactor"] = list_of(p.contactor);
  json["faults"] = p.faults_received ? list_of(p.faults) : Json(nullptr);
  json["fault_details"] = list_of(p.fault_details);
  json["flags"] = list_of(p.flags);
  return json;
}

Json message_json(const BusState& bus, std::size_t k) {
  const MessageInfo& info = messages()[k];
  const MessageState& state = bus.states()[k];
  Json json = {{"id", info.id},
               {"frames", state.frames},
               {"lost", state.lost},
               {"repeated", state.repeated},
               {"crc_errors", state.crc_errors},
               {"wrong_length", state.wrong_length},
               {"age_s", seconds(1e-6 * static_cast<double>(bus.last_us() - state.last_us))},
               {"stale", bus.stale(k)},
               {"rate_hz", number(std::round(state.rate_hz() * 1e3) / 1e3)}};
  if (state.frames == 0) {
    json["age_s"] = nullptr;
    return json;
  }
  Json& signals = json["signals"] = Json::object();
  for (std::size_t s = 0; s < info.signals.size(); ++s) {
    const SignalInfo& signal = info.signals[s];
    const double value = state.values[s];
    Json& entry = signals[signal.name] = {
        {"value", signal.integer && std::isfinite(value) ? Json(static_cast<std::int64_t>(value)) : number(value)}};
    if (*signal.unit != '\0') entry["unit"] = signal.unit;
    if (!signal.names.empty()) entry["words"] = text_of(signal, value);
  }
  return json;
}

}  // namespace

std::string json_of(const BusState& bus, const ScreenFacts& facts, double silent_s) {
  Json json;
  json["command"] = "monitor";
  json["source"] = facts.source;
  json["frames"] = bus.frames();
  json["duration_s"] = seconds(bus.duration_s());
  json["complete"] = bus.complete();
  json["pack"] = pack_json(bus);
  Json& all = json["messages"] = Json::object();
  for (std::size_t k = 0; k < messages().size(); ++k) {
    const MessageState& state = bus.states()[k];
    if (state.frames + state.crc_errors + state.wrong_length > 0) all[messages()[k].name] = message_json(bus, k);
  }
  Json ids = Json::object();
  for (const auto& u : bus.unknown_ids()) ids[fmt::format("{:0{}X}", u.id, u.long_id ? 8 : 3)] = u.frames;
  json["other_ids"] = {{"frames", bus.unknown_frames()}, {"ids", ids}, {"without_place", bus.unknown_overflow()}};
  json["other_kinds"] = {{"remote", bus.remote()},
                         {"fd", bus.fd()},
                         {"error_reports", bus.errors()},
                         {"error_classes", bus.error_classes()}};
  json["malformed"] = facts.malformed;
  json["dropped"] = facts.dropped;
  json["silent_s"] = seconds(silent_s);
  json["frames_per_second"] = number(std::round(facts.frames_per_second * 10) / 10);
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

namespace {

constexpr double most_of_a_cell_v = 5;  ///< a higher voltage is that of a pack
/// Messages with numbered signals, and the columns of a recording that they fill.
struct Numbered {
  std::string_view message, signal, column;
};
constexpr Numbered numbered[] = {{"CellVoltages", "Cell", "v_"}, {"Temperatures", "Temperature", "t_"}};

/// Calls use(column, value) for the column of each cell and sensor; the value is NaN if it is not known.
template <class Use>
void each_numbered(const BusState& bus, Use&& use) {
  for (const Numbered& n : numbered) {
    for (std::size_t k = 0; k < messages().size(); ++k) {
      if (!std::string_view(messages()[k].name).starts_with(n.message)) continue;
      for (std::size_t s = 0; s < messages()[k].signals.size(); ++s) {
        const std::string_view name = messages()[k].signals[s].name;
        if (!name.starts_with(n.signal)) continue;
        use(fmt::format("{}{}", n.column, name.substr(n.signal.size())),
            bus.stale(k) ? std::nan("") : bus.states()[k].values[s]);
      }
    }
  }
}

/// The columns of a recording: of a pack voltage_v is the mean of the cells.
struct RecordedVoltages {
  double cell_v = std::nan(""), pack_v = std::nan("");
};
RecordedVoltages voltages_of(const BusState& bus) {
  double sum = 0;
  std::size_t cells = 0;
  each_numbered(bus, [&](const std::string& column, double value) {
    if (!column.starts_with("v_") || !std::isfinite(value)) return;
    sum += value;
    ++cells;
  });
  const Reading of_sample = bus.reading("PackElectrical", "Voltage"), of_pack = bus.reading("PackVoltage", "Voltage");
  const double sample_v = of_sample.stale ? std::nan("") : of_sample.value;
  const double pack_v = of_pack.stale ? sample_v : of_pack.value;
  if (cells > 0) return {std::round(1e6 * sum / static_cast<double>(cells)) / 1e6, pack_v};
  return sample_v > most_of_a_cell_v ? RecordedVoltages{std::nan(""), pack_v}
                                     : RecordedVoltages{sample_v, std::nan("")};
}

}  // namespace

std::string csv_head() {
  std::string head = "time_s,current_a,voltage_v,temperature_c,pack_voltage_v";
  each_numbered(BusState(), [&](const std::string& column, double) { head += "," + column; });
  for (const MessageInfo& message : messages()) {
    for (const SignalInfo& signal : message.signals)
      head += fmt::format(",{}.{}", message.name, signal.name) +
              (*signal.unit != '\0' ? fmt::format(" [{}]", signal.unit) : "");
  }
  return head + "\n";
}

std::string csv_row(const BusState& bus) {
  std::string row = fmt::format("{:.6f}", bus.duration_s());
  auto out = std::back_inserter(row);
  const auto field = [&](double value, bool integer, bool valid) {
    row += ',';
    if (!valid || !std::isfinite(value)) return;
    if (integer)
      fmt::format_to(out, "{}", static_cast<std::int64_t>(value));
    else
      fmt::format_to(out, "{}", value);
  };
  const RecordedVoltages voltages = voltages_of(bus);
  const Reading current = bus.reading("PackElectrical", "Current"),
                temperature = bus.reading("PackElectrical", "Temperature");
  field(current.value, false, !current.stale);
  field(voltages.cell_v, false, true);
  field(temperature.value, false, !temperature.stale);
  field(voltages.pack_v, false, true);
  each_numbered(bus, [&](const std::string&, double value) { field(value, false, true); });
  for (std::size_t k = 0; k < messages().size(); ++k) {
    const bool stale = bus.stale(k);
    for (std::size_t s = 0; s < messages()[k].signals.size(); ++s)
      field(bus.states()[k].values[s], messages()[k].signals[s].integer, !stale);
  }
  return row + "\n";
}

}  // namespace bms::monitor
