#include "files/logs/own_frames.hpp"

#include <algorithm>
#include <array>
#include <span>

#include <fmt/format.h>

#include "can/codec.hpp"
#include "files/logs/dbc.hpp"
#include "files/logs/text_lines.hpp"

namespace bms::files {

namespace {

constexpr std::size_t foreign_frames = 100'000;  ///< without one of its own: not a log of the battery

/// Identifier of a message; 0 if the file does not have it.
std::uint32_t id_of(std::string_view message) {
  for (const DbcSignal& s : own_signals()) {
    if (s.message == message) return s.id;
  }
  return 0;
}

/// A signal that can fill a column.
struct Candidate {
  std::string column;
  DbcSignal signal;
  bool seen = false;
};

class OwnLog {
 public:
  OwnLog() {
    add("current_a", "SampleCurrent", "CurrentUa");  // the reading itself, unless it was switched off
    add("current_a", "PackElectrical", "Current");
    add("voltage_v", "SampleVoltage", "VoltageUv");
    add("voltage_v", "PackElectrical", "Voltage");
    add("temperature_c", "PackElectrical", "Temperature");
    add("pack_voltage_v", "PackVoltage", "Voltage");
    add("pack_voltage_v", "PackElectrical", "Voltage");
    for (const DbcSignal& s : own_signals()) {
      if (s.message.starts_with("CellVoltages") && s.name.starts_with("Cell"))
        candidates_.push_back({"v_" + s.name.substr(4), s});
      if (s.message == "Temperatures" && s.name.starts_with("Temperature"))
        candidates_.push_back({"t_" + s.name.substr(11), s});
    }
  }

  void receive(const TextFrame& frame) {
    if (!is_own_frame(frame)) return;
    static const std::uint32_t identity = id_of("Identity");
    identified_ = identified_ || frame.id == identity;
    for (Candidate& c : candidates_) {
      if (!c.seen && c.signal.id == frame.id)
        c.seen = !is_missing(c.signal, std::span(frame.data.data(), frame.length));
    }
  }
  bool identified() const { return identified_; }

  std::vector<std::string> map() const {
    const bool pack = has("v_");
    std::vector<std::string> lines;
    std::string last;
    for (const Candidate& c : candidates_) {
      const bool of_the_other = c.column == (pack ? "voltage_v" : "pack_voltage_v");
      const bool mean = c.column == "temperature_c" && has("t_");
      if (!c.seen || of_the_other || mean || c.column == last) continue;
      last = c.column;
      lines.push_back(fmt::format("{}={}.{}", c.column, c.signal.message, c.signal.name));
    }
    return identified_ ? lines : std::vector<std::string>{};
  }

 private:
  void add(const char* column, std::string_view message, std::string_view name) {
    for (const DbcSignal& s : own_signals()) {
      if (s.message == message && s.name == name) candidates_.push_back({column, s});
    }
  }
  bool has(std::string_view prefix) const {
    return std::any_of(candidates_.begin(), candidates_.end(),
                       [&](const Candidate& c) { return c.seen && c.column.starts_with(prefix); });
  }

  std::vector<Candidate> candidates_;
  bool identified_ = false;
};

}  // namespace

const std::vector<DbcSignal>& own_signals() {
  static const std::vector<DbcSignal> signals = parse_dbc(own_dbc, own_dbc_name);
  return signals;
}

bool is_own_frame(const TextFrame& frame) {
  if (frame.long_id || frame.length != 8) return false;
  can::Frame own;
  own.id = frame.id;
  own.length = 8;
  std::copy_n(frame.data.begin(), own.data.size(), own.data.begin());
  return can::intact(own, static_cast<std::uint16_t>(frame.id)) && can::counter_of(own) < can::counters;
}

bool ends_a_sample(const TextFrame& frame) {
  static const std::uint32_t status = id_of("Status");
  return frame.id == status;
}

std::vector<std::string> own_map_of(const std::string& path, const std::string& format, const std::string& channel) {
  OwnLog log;
  TextLines lines(path);
  FrameText text(format);
  std::string_view line;
  TextFrame frame;
  std::size_t frames = 0;
  while (lines.next(line)) {
    if (!text.parse(line, frame) || (!channel.empty() && frame.channel != channel)) continue;
    log.receive(frame);
    if (++frames == foreign_frames && !log.identified()) break;
  }
  return log.map();
}

}  // namespace bms::files
