#include "files/logs/frame_signals.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/column_options.hpp"
#include "files/logs/table_layout.hpp"

namespace bms::files {

MappedSignal mapped_signal(const std::string& text, const std::vector<DbcSignal>& dbc, const std::string& dbc_name,
                           const ReadOptions& options) {
  const std::size_t equals = text.find('=');
  const auto target = target_of(text.substr(0, equals));
  if (equals == std::string::npos || !target || target->quantity == Quantity::time ||
      target->quantity == Quantity::state)
    throw BadInput("--map", 1, in_quotes(text) + ": expected current_a=SIGNAL or another column of a recording");
  const std::string name = text.substr(equals + 1);
  const DbcSignal* found = nullptr;
  for (const DbcSignal& s : dbc) {
    const auto is = [&](const std::string& of) { return !of.empty() && (of == name || s.message + "." + of == name); };
    if (!is(s.name) && !is(s.short_name)) continue;
    if (found != nullptr)
      throw BadInput(dbc_name, 1, in_quotes(name) + " is in several messages, expected MESSAGE.SIGNAL");
    found = &s;
  }
  if (found == nullptr) throw BadInput(dbc_name, 1, "no signal " + in_quotes(name) + ", expected one of this file");
  MappedSignal mapped;
  mapped.signal = *found;
  mapped.target = *target;
  const auto stated = stated_scale(options.unit, *target);
  mapped.scale = stated ? *stated : scale_of(target->quantity, found->unit).value_or(Scale{});
  if (stated) mapped.signal.unit = *stated_unit(options.unit, *target);  // of --unit, for what was read as what
  mapped.multiplexors = multiplexors_of(*found, dbc, dbc_name);
  return mapped;
}

bool Senders::is_read(const TextFrame& frame) {
  if (std::find(channels_.begin(), channels_.end(), frame.channel) == channels_.end())
    channels_.emplace_back(frame.channel);
  return several_.empty() && (channel_.empty() || frame.channel == channel_);
}

bool Senders::is_one(MappedSignal& m, const TextFrame& frame) {
  if (!m.sender) m.sender = {std::string(frame.channel), frame.id};
  if (m.sender->channel == frame.channel && m.sender->id == frame.id) return true;
  const std::string what = fmt::format("message {} (id {:X})", in_quotes(m.signal.message), m.signal.id);
  if (m.sender->channel != frame.channel) {
    several_ = what + " is on several channels, expected --channel with one of: ";
  } else {
    several_ =
        fmt::format("{} comes from the source addresses {:X} and {:X}, expected a DBC file with one of them in the id",
                    what, m.sender->id & 0xFFU, frame.id & 0xFFU);
  }
  return false;
}

std::string Senders::channels() const {
  std::string text;
  for (const std::string& c : channels_) text += (text.empty() ? "" : ", ") + c;
  return text;
}

void Senders::check() const {
  if (!several_.empty()) throw BadInput(path_, 1, several_ + (several_.ends_with(": ") ? channels() : ""));
  if (channel_.empty() || std::find(channels_.begin(), channels_.end(), channel_) != channels_.end()) return;
  throw BadInput(path_, 1, fmt::format("no frame on channel {}, expected one of: {}", in_quotes(channel_), channels()));
}

std::size_t end_columns(std::vector<MappedSignal>& signals, const std::vector<double>& time_s) {
  std::size_t first = 0;
  for (MappedSignal& m : signals) {
    m.column.end();
    const std::size_t row = m.column.first_row();
    if (row < time_s.size() && time_s[row] - time_s.front() < PairedColumn::stale_s) first = std::max(first, row);
  }
  return first;
}

void refuse_absent(const std::vector<MappedSignal>& signals, const std::string& path, const std::string& dbc_name) {
  for (const MappedSignal& m : signals) {
    if (m.column.count() == 0) {
      throw BadInput(path, 1,
                     fmt::format("no frame with {}.{} (id {:X}), expected a log of the bus that {} describes",
                                 m.signal.message, m.signal.name, m.signal.id, dbc_name));
    }
    const bool ranged = m.target.quantity == Quantity::current && m.signal.highest > m.signal.lowest;
    if (!ranged || m.missing < m.column.count()) continue;
    throw BadInput(dbc_name, m.signal.line,
                   fmt::format("no value of {} is in its range from {:g} to {:g}, expected the DBC file of this bus",
                               in_quotes(m.signal.name), m.signal.lowest, m.signal.highest));
  }
}

std::string delays_text(const std::vector<MappedSignal>& signals, double duration_s) {
  double earliest_s = 0, latest_s = 0;
  const MappedSignal* slowest = nullptr;
  std::size_t rows = 0;
  for (const MappedSignal& m : signals) {
    if (m.target.quantity == Quantity::current) rows = m.column.paired();
    earliest_s = std::min(earliest_s, m.column.mean_delay_s());
    latest_s = std::max(latest_s, m.column.mean_delay_s());
    if (slowest == nullptr || m.column.count() < slowest->column.count()) slowest = &m;
  }
  std::string text;
  constexpr double shortest_s = 1e-6;
  if (earliest_s < -shortest_s || latest_s > shortest_s)
    text +=
        fmt::format("; a row has values from {:.3g} s before to {:.3g} s after its current", 0 - earliest_s, latest_s);
  if (slowest != nullptr && slowest->column.count() > 1 && slowest->column.count() < rows / 2) {
    text += fmt::format("; {} is sent every {:.3g} s", name_of(slowest->target),
                        duration_s / static_cast<double>(slowest->column.count() - 1));
  }
  return text;
}

void warn_of_missing(const std::vector<MappedSignal>& signals, measurement::Recording& r) {
  std::size_t missing = 0, count = 0;
  std::string first;
  for (const MappedSignal& m : signals) {
    const bool cell = m.target.quantity == Quantity::cell_voltage || m.target.quantity == Quantity::cell_temperature;
    count += m.column.count();
    if (m.missing == 0 || (cell && m.missing == m.column.count())) continue;
    missing += m.missing;
    if (first.empty()) first = m.signal.name;
  }
  if (missing == 0) return;
  r.warnings.push_back({"missing_reading", fmt::format("values that mean 'not available', or are outside the range in "
                                                       "the DBC file: {} of {}, the first signal is {}; they are "
                                                       "treated as missing",
                                                       missing, count, in_quotes(first))});
}

}  // namespace bms::files
