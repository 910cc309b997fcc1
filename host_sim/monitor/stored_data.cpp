#include "monitor/stored_data.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "monitor/pack_view.hpp"

namespace bms::monitor {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint32_t processor_fault = 128, numbers = 256;

double value_of(const BusState& bus, std::string_view message, std::string_view signal) {
  return bus.reading(message, signal).value;
}
std::uint32_t integer_of(const BusState& bus, std::string_view message, std::string_view signal) {
  const double value = value_of(bus, message, signal);
  return value > 0 ? static_cast<std::uint32_t>(value) : 0;
}
/// The name of a value of a signal, if it has one.
std::string name_in(std::string_view message, std::string_view signal, std::uint32_t raw) {
  const std::size_t k = BusState::find(message);
  if (k == messages().size()) return {};
  for (const SignalInfo& info : messages()[k].signals) {
    if (signal != info.name) continue;
    for (const can::ValueName& name : info.names) {
      if (name.raw == static_cast<std::int32_t>(raw)) return name.text;
    }
  }
  return {};
}

std::string fault_name(std::uint32_t code) {
  if (code >= processor_fault) return fmt::format("processor exception {}", code - processor_fault);
  std::string name = name_in("StoredFault", "Code", code);
  if (name.empty()) name = name_in("Faults", "FirstCause", code);
  return name.empty() ? fmt::format("fault {}", code) : name;
}

std::string utc(std::uint32_t unix_s) {
  const std::time_t time = unix_s;
  std::tm parts{};
  gmtime_r(&time, &parts);
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02}:{:02}", parts.tm_year + 1900, parts.tm_mon + 1, parts.tm_mday,
                     parts.tm_hour, parts.tm_min, parts.tm_sec);
}

/// Time of a fault or an action for a person.
std::string when(std::uint32_t time_s) {
  if (StoredFault{.name = {}, .time_s = time_s}.has_calendar_time()) return utc(time_s) + " UTC";
  return fmt::format("after {:.1f} h of operation", time_s / 3'600.0);
}

/// Empty if it is not known.
std::string field(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "";
}

}  // namespace

bool StoredData::receive(const BusState& bus, std::size_t message) {
  if (message >= messages().size()) return false;
  const std::string_view name = messages()[message].name;
  if (receive_fault(bus, name) || receive_action(bus, name)) return true;
  if (name == "StoredCounts") {
    receive_count(bus);
  } else if (name == "StoredUse") {
    operating_s = value_of(bus, name, "OperatingTime");
    cycles = value_of(bus, name, "Cycles");
    others_.set(0);
  } else if (name == "StoredThroughput") {
    charged_ah = value_of(bus, name, "Charged");
    discharged_ah = value_of(bus, name, "Discharged");
    others_.set(1);
  } else if (name == "StoredExtremes") {
    const bool is_highest = integer_of(bus, name, "Kind") == 1;
    StoredExtreme& extreme = is_highest ? highest : lowest;
    extreme = {value_of(bus, name, "Voltage"), value_of(bus, name, "Temperature"), value_of(bus, name, "Current")};
    others_.set(is_highest ? 3 : 2);
  } else if (name == "CanErrors") {
    can_state = name_in(name, "State", integer_of(bus, name, "State"));
    can_errors.clear();
    for (const SignalInfo& signal : messages()[message].signals) {
      if (std::string_view(signal.name) != "State")
        can_errors.push_back({signal.name, value_of(bus, name, signal.name)});
    }
    others_.set(4);
  } else {
    return false;
  }
  return true;
}

bool StoredData::receive_fault(const BusState& bus, std::string_view message) {
  constexpr std::array<std::string_view, 3> frames = {"StoredFault", "StoredFaultPack", "StoredFaultCells"};
  const auto frame = static_cast<std::size_t>(std::find(frames.begin(), frames.end(), message) - frames.begin());
  if (frame == frames.size()) return false;
  const std::uint32_t index = integer_of(bus, message, "Index"), number = integer_of(bus, message, "Number");
  const std::uint32_t newest = (number + index) % numbers;
  if (index >= faults) return true;
  if (newest_ != newest) {  // the first frame, or a fault was stored meanwhile
    fault_ = {};
    counts_.reset();
    newest_ = newest;
  }
  Collected& c = fault_[index];
  c.frames.set(frame);
  if (frame == 0) {
    c.fault.code = integer_of(bus, message, "Code");
    c.fault.name = fault_name(c.fault.code);
    c.fault.time_s = integer_of(bus, message, "Time");
  } else if (frame == 1) {
    c.fault.soc = value_of(bus, message, "Soc") / 100;
    c.fault.current_a = value_of(bus, message, "Current");
    c.fault.temperature_max_c = value_of(bus, message, "HighestTemperature");
    c.fault.temperature_min_c = value_of(bus, message, "LowestTemperature");
  } else {
    c.fault.cell_voltage_max_v = value_of(bus, message, "HighestVoltage");
    c.fault.cell_voltage_min_v = value_of(bus, message, "LowestVoltage");
  }
  return true;
}

bool StoredData::receive_action(const BusState& bus, std::string_view message) {
  const bool first = message == "StoredAction";
  if (!first && message != "StoredActionDetail") return false;
  const std::uint32_t index = integer_of(bus, message, "Index");
  if (index >= actions) return true;
  CollectedAction& c = action_[index];
  c.frames.set(first ? 0 : 1);
  if (first) {
    c.action.code = integer_of(bus, message, "Code");
    c.action.name = name_in(message, "Code", c.action.code);
    c.action.time_s = integer_of(bus, message, "Time");
  } else {
    c.action.operator_number = integer_of(bus, message, "OperatorNumber");
    c.action.argument = integer_of(bus, message, "Argument");
  }
  return true;
}

void StoredData::receive_count(const BusState& bus) {
  const std::uint32_t cause = integer_of(bus, "StoredCounts", "Cause");
  if (cause >= causes) return;
  resets[cause] = {name_in("StoredCounts", "Cause", cause), value_of(bus, "StoredCounts", "Resets")};
  fault_count = value_of(bus, "StoredCounts", "Faults");
  counts_.set(cause);
}

bool StoredData::has(std::size_t part) const {
  if (part < faults) return fault_[part].frames.all();
  if (part >= first_action) return action_[part - first_action].frames.all();
  const std::size_t cause = part - faults;
  return counts_[cause] && (cause >= others_.size() || others_[cause]);
}

std::optional<StoredData::Parts> StoredData::missing() const {
  std::optional<Parts> range;
  for (std::size_t k = 0; k < parts; ++k) {
    if (has(k)) continue;
    if (!range) range = Parts{k, 0};
    range->count = k - range->first + 1;
  }
  return range;
}

bool StoredData::complete_but_for_actions() const {
  const auto range = missing();
  return !range || range->first >= first_action;
}

std::size_t StoredData::missing_parts() const {
  std::size_t count = 0;
  for (std::size_t k = 0; k < parts; ++k) count += has(k) ? 0U : 1U;
  return count;
}

std::vector<StoredFault> StoredData::stored_faults() const {
  std::vector<StoredFault> all;
  for (auto c = fault_.rbegin(); c != fault_.rend(); ++c) {
    if (c->fault.code != 0) all.push_back(c->fault);
  }
  return all;
}

std::vector<StoredAction> StoredData::stored_actions() const {
  std::vector<StoredAction> all;
  for (auto c = action_.rbegin(); c != action_.rend(); ++c) {
    if (c->action.code != 0) all.push_back(c->action);
  }
  return all;
}

std::string csv_of(const StoredData& data) {
  std::string csv =
      "fault,time_utc,unix_time_s,operating_s,soc,current_a,cell_voltage_max_v,cell_voltage_min_v,temperature_max_c,"
      "temperature_min_c\n";
  for (const StoredFault& f : data.stored_faults()) {
    const std::string time = std::to_string(f.time_s);
    csv += f.name + "," + (f.has_calendar_time() ? utc(f.time_s) + "," + time + "," : ",," + time);
    csv += fmt::format(",{},{},{},{},{},{}\n", field(f.soc, 3), field(f.current_a, 2), field(f.cell_voltage_max_v, 3),
                       field(f.cell_voltage_min_v, 3), field(f.temperature_max_c, 0), field(f.temperature_min_c, 0));
  }
  return csv;
}

std::string json_of(const StoredData& data, const std::string& source) {
  const auto number = [](double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); };
  Json faults = Json::array();
  for (const StoredFault& f : data.stored_faults()) {
    const Json time = f.time_s;
    faults.push_back({{"name", f.name},
                      {"code", f.code},
                      {"unix_time_s", f.has_calendar_time() ? time : Json(nullptr)},
                      {"operating_s", f.has_calendar_time() ? Json(nullptr) : time},
                      {"soc", number(f.soc)},
                      {"current_a", number(f.current_a)},
                      {"cell_voltage_max_v", number(f.cell_voltage_max_v)},
                      {"cell_voltage_min_v", number(f.cell_voltage_min_v)},
                      {"temperature_max_c", number(f.temperature_max_c)},
                      {"temperature_min_c", number(f.temperature_min_c)}});
  }
  Json actions = Json::array();
  for (const StoredAction& a : data.stored_actions()) {
    actions.push_back({{"name", a.name},
                       {"code", a.code},
                       {"time_s", a.time_s},
                       {"operator", a.operator_number},
                       {"argument", a.argument}});
  }
  const auto extreme = [&](const StoredExtreme& e) {
    return Json{{"cell_voltage_v", number(e.cell_voltage_v)},
                {"temperature_c", number(e.temperature_c)},
                {"current_a", number(e.current_a)}};
  };
  Json resets = Json::object(), errors = Json::object();
  for (const StoredCount& r : data.resets) resets[r.name] = r.count;
  for (const StoredCount& e : data.can_errors) errors[e.name] = e.count;
  const Json json = {{"command", "log"},
                     {"source", source},
                     {"faults", faults},
                     {"fault_count", number(data.fault_count)},
                     {"operating_s", number(data.operating_s)},
                     {"cycles", number(data.cycles)},
                     {"charged_ah", number(data.charged_ah)},
                     {"discharged_ah", number(data.discharged_ah)},
                     {"lowest", extreme(data.lowest)},
                     {"highest", extreme(data.highest)},
                     {"resets", resets},
                     {"actions", actions},
                     {"can", {{"state", data.can_state}, {"errors", errors}}}};
  return json.dump(1) + "\n";
}

std::string summary_of(const StoredData& data) {
  const auto or_dash = [](double value, int digits) {
    return std::isfinite(value) ? field(value, digits) : std::string("-");
  };
  const auto faults = data.stored_faults();
  std::string text = faults.empty() ? "Faults       none stored\n"
                                    : fmt::format("Faults       {:.0f} so far, the last {} are stored:\n",
                                                  data.fault_count, faults.size());
  for (auto f = faults.rbegin(); f != faults.rend(); ++f)
    text += fmt::format("  {:<28} {:<30} {} %  {} A  cells {} to {} V\n", f->name, when(f->time_s),
                        or_dash(100 * f->soc, 1), or_dash(f->current_a, 2), or_dash(f->cell_voltage_min_v, 3),
                        or_dash(f->cell_voltage_max_v, 3));
  text +=
      fmt::format("Use          {:.1f} h in operation, {:.1f} full cycles\n", data.operating_s / 3'600, data.cycles);
  text += fmt::format("Throughput   {:.1f} Ah charged, {:.1f} Ah discharged\n", data.charged_ah, data.discharged_ah);
  text += "Lowest and highest readings so far\n";
  const auto pair = [&](const char* what, double low, double high, int digits, const char* unit) {
    text += fmt::format("  {:<11}{} to {} {}\n", what, or_dash(low, digits), or_dash(high, digits), unit);
  };
  pair("cell", data.lowest.cell_voltage_v, data.highest.cell_voltage_v, 3, "V");
  pair("temperature", data.lowest.temperature_c, data.highest.temperature_c, 0, "degC");
  pair("current", data.lowest.current_a, data.highest.current_a, 2, "A (above 0: charging)");
  const auto list = [&](const char* what, const auto& counts) {
    text += fmt::format("{:<13}", what);
    const char* separator = "";
    for (const StoredCount& c : counts) {
      text += fmt::format("{}{} {:.0f}", separator, c.name, c.count);
      separator = ", ";
    }
    text += "\n";
  };
  const auto actions = data.stored_actions();
  if (!actions.empty()) text += "Service      what sessions have done, the newest first:\n";
  for (auto a = actions.rbegin(); a != actions.rend(); ++a)
    text += fmt::format("  {:<28} {:<30} operator {}, argument {}\n", a->name, when(a->time_s), a->operator_number,
                        static_cast<std::int32_t>(a->argument));
  list("Resets", data.resets);
  list("CAN errors", data.can_errors);
  return text + fmt::format("CAN state    {}", data.can_state);
}

}  // namespace bms::monitor
