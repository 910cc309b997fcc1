#include "monitor/message_table.hpp"

#include <fmt/format.h>

#include "monitor/pack_view.hpp"

namespace bms::monitor {

namespace {

constexpr double last_rate_with_a_decimal_hz = 99.95;

bool was_received(const MessageState& state) { return state.frames + state.crc_errors + state.wrong_length > 0; }

ScreenLine heading() {
  ScreenLine line;
  return line.add(fmt::format("{:<16} {:>8} {:>7} {:>8} {:>5} {:>5} {:>5} {:>6}", "Message", "per s", "age", "frames",
                              "lost", "CRC", "rep.", "length"),
                  TextStyle::strong);
}

ScreenLine message_line(const BusState& bus, std::size_t k) {
  const MessageState& m = bus.states()[k];
  const int decimals = m.rate_hz() < last_rate_with_a_decimal_hz ? 1 : 0;
  ScreenLine line;
  line.add(fmt::format("{:<16} {:>8.{}f} {:>7} {:>8}", messages()[k].name, m.rate_hz(), decimals,
                       age_text(bus.age_s(k)), m.frames),
           style_of(bus.stale(k)));
  const auto count = [&](std::uint64_t n, int width) {
    line.add(fmt::format(" {:>{}}", n, width), n > 0 ? TextStyle::warning : TextStyle::faint);
  };
  count(m.lost, 5);
  count(m.crc_errors, 5);
  count(m.repeated, 5);
  count(m.wrong_length, 6);
  return line;
}

}  // namespace

std::vector<ScreenLine> message_table(const BusState& bus) {
  std::vector<ScreenLine> lines{heading()};
  for (std::size_t k = 0; k < messages().size(); ++k) {
    if (was_received(bus.states()[k])) lines.push_back(message_line(bus, k));
  }
  return lines;
}

std::vector<ScreenLine> signal_table(const BusState& bus) {
  std::vector<ScreenLine> lines{heading()};
  for (std::size_t k = 0; k < messages().size(); ++k) {
    const MessageState& state = bus.states()[k];
    if (!was_received(state)) continue;
    lines.push_back(message_line(bus, k));
    for (std::size_t s = 0; state.frames > 0 && s < state.values.size(); ++s) {
      const SignalInfo& signal = messages()[k].signals[s];
      lines.emplace_back()
          .add(fmt::format("  {:<24} ", signal.name), TextStyle::faint)
          .add(printable(text_of(signal, state.values[s])), style_of(bus.stale(k)));
    }
  }
  return lines;
}

std::vector<ScreenLine> unknown_id_lines(const BusState& bus, std::size_t columns) {
  std::vector<ScreenLine> lines;
  if (bus.unknown_frames() == 0) return lines;
  ScreenLine& line = lines.emplace_back();
  line.add("Other ids");
  for (const auto& unknown : bus.unknown_ids()) {
    const std::string text = fmt::format(" {:0{}X}:{}", unknown.id, unknown.long_id ? 8 : 3, unknown.frames);
    if (line.columns() + text.size() > columns) return lines;
    line.add(text, TextStyle::faint);
  }
  return lines;
}

}  // namespace bms::monitor
