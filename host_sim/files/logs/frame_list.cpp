#include "files/logs/frame_list.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <tuple>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/dbc.hpp"
#include "files/logs/frame_text.hpp"
#include "files/logs/log_formats.hpp"
#include "files/logs/own_frames.hpp"
#include "files/logs/shipped_dbc.hpp"
#include "files/logs/text_lines.hpp"
#include "files/logs/units.hpp"

namespace bms::files {

namespace {

constexpr double largest_of_a_cell_v = 5.5;

/// "BatteryCurrent1" as words: "battery current 1".
std::string words_of(const std::string& name) {
  std::string text;
  for (std::size_t k = 0; k < name.size(); ++k) {
    const auto is = [&](std::size_t at, int (*kind)(int)) { return kind(static_cast<unsigned char>(name[at])) != 0; };
    const bool next =
        k > 0 && ((is(k, std::isupper) && is(k - 1, std::islower)) || (is(k, std::isdigit) && is(k - 1, std::isalpha)));
    text += (next ? " " : "") + std::string(1, name[k]);
  }
  return normalised(text);
}

/// The number at the end of a name; 0 without one.
std::size_t number_at_end(const std::string& text) {
  const std::size_t at = text.find_last_not_of("0123456789") + 1;
  return at < text.size() && text.size() - at < 4 ? std::stoul(text.substr(at)) : 0;
}

std::string column_of(const ListedSignal& s) {
  if (s.values == s.missing) return {};
  const std::string text = words_of(s.name);
  const auto has = [&](const char* word) { return text.find(word) != std::string::npos; };
  const bool limit = has("limit") || has("max") || has("min") || has("target") || has("request");
  if (limit) return {};
  const std::size_t number = number_at_end(text);
  const std::string unit = normalised(s.unit);
  if (unit.empty()) return {};
  if (scale_of(Quantity::current, unit)) return "current_a";
  if (const auto scale = scale_of(Quantity::voltage, unit)) {
    const double v = (*scale)(s.highest);
    if (v > largest_of_a_cell_v) return "pack_voltage_v";
    return number > 0 ? name_of({Quantity::cell_voltage, number}) : "voltage_v";
  }
  if (scale_of(Quantity::temperature, unit))
    return number > 0 ? name_of({Quantity::cell_temperature, number}) : "temperature_c";
  return unit == "%" && has("soc") ? "soc_ref" : "";
}

class Lister {
 public:
  explicit Lister(const ReadOptions& options)
      : options_(options), dbc_(options.dbc.empty() ? own_signals() : signals_of(options.dbc)) {
    for (const DbcSignal& s : dbc_) multiplexors_.push_back(multiplexors_if_any(s));
  }

  void receive(const TextFrame& frame) {
    if (!options_.channel.empty() && frame.channel != options_.channel) return;
    Known& known = messages_[{std::string(frame.channel), frame.long_id, frame.id}];
    if (known.message.frames++ == 0) describe(known, frame);
    known.message.last_s = frame.time_s;
    const std::span<const std::uint8_t> data(frame.data.data(), frame.length);
    for (std::size_t k = 0; k < known.signals.size(); ++k) {
      const DbcSignal& s = dbc_[known.signals[k]];
      if (is_sent(s, multiplexors_[known.signals[k]], data)) add(known.message.signals[k], s, data);
    }
  }

  FrameList list() && {
    FrameList list;
    for (auto& [key, known] : messages_) {
      if (known.signals.empty()) {
        list.unknown_frames += known.message.frames;
        ++list.unknown_messages;
        continue;
      }
      for (ListedSignal& s : known.message.signals) s.column = column_of(s);
      list.messages.push_back(std::move(known.message));
    }
    return list;
  }

 private:
  struct Known {
    ListedMessage message;
    std::vector<std::size_t> signals;  ///< indices in dbc_
  };

  /// A signal whose multiplexor is missing is not listed as sent; --map refuses it with the reason.
  std::vector<DbcSignal> multiplexors_if_any(const DbcSignal& s) const {
    try {
      return multiplexors_of(s, dbc_, options_.dbc);
    } catch (const BadInput&) {
      DbcSignal never = s;
      never.start = 8 * 64;
      return {never};
    }
  }

  void describe(Known& known, const TextFrame& frame) {
    known.message.id = frame.id;
    known.message.long_id = frame.long_id;
    known.message.channel = frame.channel;
    known.message.first_s = frame.time_s;
    for (std::size_t k = 0; k < dbc_.size(); ++k) {
      if (!is_of(dbc_[k], frame.id, frame.long_id)) continue;
      known.message.name = dbc_[k].message;
      known.signals.push_back(k);
      ListedSignal listed;
      listed.name = dbc_[k].name;
      listed.unit = dbc_[k].unit;
      known.message.signals.push_back(std::move(listed));
    }
  }

  static void add(ListedSignal& listed, const DbcSignal& s, std::span<const std::uint8_t> data) {
    const double value = value_of(s, data);
    const bool first = listed.values == listed.missing;
    ++listed.values;
    if (is_missing(s, data) || !std::isfinite(value)) {
      ++listed.missing;
      return;
    }
    listed.lowest = first ? value : std::min(listed.lowest, value);
    listed.highest = first ? value : std::max(listed.highest, value);
  }

  const ReadOptions& options_;
  std::vector<DbcSignal> dbc_;
  std::vector<std::vector<DbcSignal>> multiplexors_;
  std::map<std::tuple<std::string, bool, std::uint32_t>, Known> messages_;
};

}  // namespace

FrameList list_frames(const std::string& path, const ReadOptions& options) {
  Lister lister(options);
  TextLines lines(path);
  FrameText text(options.format);
  std::string_view line;
  TextFrame frame;
  while (lines.next(line)) {
    if (text.parse(line, frame)) lister.receive(frame);
  }
  FrameList list = std::move(lister).list();
  if (list.messages.empty()) {
    throw BadInput(path, 1,
                   fmt::format("no frame of a message of {}, expected a log of CAN frames and the DBC file of its bus",
                               options.dbc.empty() ? own_dbc_name : options.dbc));
  }
  return list;
}

std::string text_of(const FrameList& list) {
  std::string text;
  for (const ListedMessage& m : list.messages) {
    text += fmt::format("{} (id {:X}{}{}): {} frames", m.name, m.id, m.channel.empty() ? "" : ", channel ", m.channel,
                        m.frames);
    text += m.frames < 2 ? "\n" : fmt::format(", every {:.3g} s\n", m.cycle_s());
    for (const ListedSignal& s : m.signals) {
      const bool any = s.values > s.missing;
      text += fmt::format("  {:<24} ", s.name);
      if (any) text += fmt::format("{:g} to {:g} {}", s.lowest, s.highest, s.unit);
      if (!any) text += s.values == 0 ? "not sent" : "not available";
      if (any && s.missing > 0) text += fmt::format(", {} of {} not available", s.missing, s.values);
      text += s.column.empty() ? "\n" : fmt::format("; could be --map {}={}\n", s.column, s.name);
    }
  }
  if (list.unknown_messages > 0) {
    text += fmt::format("{} frames of {} other messages are not in the DBC file\n", list.unknown_frames,
                        list.unknown_messages);
  }
  text.pop_back();
  return text;
}

}  // namespace bms::files
