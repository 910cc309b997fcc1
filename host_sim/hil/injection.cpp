#include "hil/injection.hpp"

#include <charconv>
#include <utility>

#include <fmt/format.h>

#include "files/bad_input.hpp"

namespace bms::hil {

namespace {

enum class Value { none, probability, cell };

struct Kind {
  const char* name;
  Value value;
  const char* expected;
  double within_s;  ///< the delay in the table of firmware/protection/README.md, without `latency_s`
};

constexpr double latency_s = 0.5;      // of the samples and of the cycle of the message Faults
constexpr double no_deadline_s = 1e9;  // depends on when the contactors next switch
constexpr std::int32_t cell_high_uv = 4'050'000, cell_low_uv = 1'700'000;
constexpr Kind kinds[] = {
    {"drop", Value::probability, "", 0},
    {"corrupt", Value::probability, "", 0},
    {"delay", Value::probability, "", 0},
    {"cell_stuck", Value::cell, "VoltageStuck", 1 + 30},  // after the other cells have moved
    {"cell_open", Value::cell, "VoltageMissing", 0.5},
    {"sense_wire", Value::cell, "OpenWire", 0.5},
    {"cell_high", Value::cell, "CellOvervoltageSevere", 0.2},
    {"cell_low", Value::cell, "CellUndervoltageSevere", 0.2},
    {"current_stuck", Value::none, "", 0},
    {"current_open", Value::none, "CurrentMissing", 0.5},
    {"temperature_open", Value::none, "TemperatureLost", 2},
    {"temperature_stuck", Value::none, "", 0},
    {"overcurrent", Value::none, "DischargeOvercurrent", 30},
    {"welded", Value::none, "ContactorWelded", no_deadline_s},
    {"precharge_open", Value::none, "PrechargeFailed", no_deadline_s},
    {"silence", Value::none, "SamplesMissing", 0.5 + 0.2},  // the table's delay and one sample at each end
};

[[noreturn]] void reject(const std::string& text, const std::string& what) {
  throw files::BadInput("--fault", 1, "'" + text + "': " + what);
}

double number(const std::string& text, std::string_view part, const char* what) {
  double value = 0;
  const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
  if (error != std::errc{} || end != part.data() + part.size() || !(value >= 0))
    reject(text, fmt::format("expected {} instead of '{}'", what, part));
  return value;
}

}  // namespace

Injection parse_injection(const std::string& text, std::size_t cells) {
  const std::string_view all = text;
  const std::size_t at = all.find('@');
  if (at == std::string_view::npos) reject(text, "expected NAME[=VALUE]@START[-END] in seconds");
  const std::string_view what = all.substr(0, at), when = all.substr(at + 1);
  const std::size_t equals = what.find('=');
  const std::string name(what.substr(0, equals));
  const Kind* kind = nullptr;
  std::string names;
  for (const Kind& k : kinds) {
    if (k.name == name) kind = &k;
    names += (names.empty() ? "" : ", ") + std::string(k.name);
  }
  if (kind == nullptr) reject(text, "expected one of: " + names);
  Injection i{text, name, 0, 0, 1e300, kind->expected, kind->within_s + latency_s};
  const bool is_probability = kind->value == Value::probability;
  const char* example = is_probability ? "=0.01@60" : "=3@60";
  const char* expected_value = is_probability ? "a probability, 0 to 1" : "a cell, from 1";
  if ((kind->value == Value::none) != (equals == std::string_view::npos))
    reject(text, kind->value == Value::none ? "takes no value" : "expected a value, as in " + name + example);
  if (kind->value != Value::none) i.value = number(text, what.substr(equals + 1), expected_value);
  if (is_probability && i.value > 1) reject(text, "expected a probability, 0 to 1");
  const double most = static_cast<double>(name == "sense_wire" ? cells - 1 : cells);
  if (kind->value == Value::cell && !(i.value >= 1 && i.value <= most && i.value == static_cast<int>(i.value)))
    reject(text, most > 1 ? fmt::format("expected a cell, 1 to {}", most)
                          : "this board has one cell; expected cell 1, or more cells with --cells");
  const std::size_t dash = when.find('-');
  i.from_s = number(text, when.substr(0, dash), "seconds");
  if (dash != std::string_view::npos) i.to_s = number(text, when.substr(dash + 1), "seconds");
  if (!(i.to_s > i.from_s)) reject(text, "expected an end after the start");
  return i;
}

const Injection* Injector::find(const char* name, double time_s) const {
  for (const Injection& i : all_) {
    if (i.name == name && time_s >= i.from_s && time_s < i.to_s) return &i;
  }
  return nullptr;
}

bool Injector::active(const char* name, double time_s) const { return find(name, time_s) != nullptr; }

void Injector::apply(double time_s, measurement::PackSample<max_cells>& s) {
  const auto cell_of = [&](const Injection& i) { return static_cast<std::size_t>(i.value) - 1; };
  if (const auto* i = find("cell_stuck", time_s)) s.cell_uv[cell_of(*i)] = last_.cell_uv[cell_of(*i)];
  if (const auto* i = find("cell_open", time_s)) s.cell_uv[cell_of(*i)] = measurement::no_reading;
  if (const auto* i = find("sense_wire", time_s)) {
    const std::int32_t both = s.cell_uv[cell_of(*i)] + s.cell_uv[cell_of(*i) + 1];
    s.cell_uv[cell_of(*i)] = both / 5 * 2;  // the input currents of the front end divide the sum, but not in halves
    s.cell_uv[cell_of(*i) + 1] = both - s.cell_uv[cell_of(*i)];
  }
  if (const auto* i = find("cell_high", time_s)) s.cell_uv[cell_of(*i)] = cell_high_uv;
  if (const auto* i = find("cell_low", time_s)) s.cell_uv[cell_of(*i)] = cell_low_uv;
  if (active("current_stuck", time_s)) s.current_ua = last_.current_ua;
  if (active("current_open", time_s)) s.current_ua = measurement::no_reading;
  if (active("temperature_open", time_s)) s.temperature_cdegc[0] = measurement::no_temperature;
  if (active("temperature_stuck", time_s)) s.temperature_cdegc[0] = last_.temperature_cdegc[0];
  last_ = s;
}

std::vector<can::Frame> Injector::apply(double time_s, std::vector<can::Frame> frames) {
  std::vector<can::Frame> through = std::exchange(late_, {});
  if (active("silence", time_s)) return {};
  const auto happens = [&](const char* name) {
    const Injection* i = find(name, time_s);
    return i != nullptr && std::uniform_real_distribution<double>()(random_) < i->value;
  };
  for (can::Frame& frame : frames) {
    if (happens("drop")) continue;
    if (happens("corrupt")) frame.data[random_() % 8] ^= static_cast<std::uint8_t>(1U << random_() % 8);
    (happens("delay") ? late_ : through).push_back(frame);
  }
  return through;
}

}  // namespace bms::hil
