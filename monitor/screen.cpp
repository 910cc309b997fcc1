#include "monitor/screen.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>

#include <fmt/format.h>

#include "monitor/pack_view.hpp"

namespace bms::monitor {

namespace {

/// Bytes of a character of the few that are written here (UTF-8).
std::size_t bytes_of(char first) {
  const auto byte = static_cast<unsigned char>(first);
  return byte < 0x80 ? 1 : byte < 0xE0 ? 2 : byte < 0xF0 ? 3 : 4;
}

std::size_t columns_of(std::string_view text) {
  std::size_t n = 0;
  for (std::size_t at = 0; at < text.size(); at += bytes_of(text[at])) ++n;
  return n;
}

/// What came from outside: printable ASCII alone.
std::string clean(std::string_view text) {
  std::string out(text);
  for (char& c : out) {
    if (c < 0x20 || c > 0x7E) c = '?';
  }
  return out;
}

TextStyle ink_of(bool stale, TextStyle fresh = TextStyle::plain) { return stale ? TextStyle::faint : fresh; }

std::string number(const Reading& r, int digits, const char* unit) {
  return r.known() ? fmt::format("{:.{}f}{}", r.value, digits, unit) : fmt::format("-{}", unit);
}

/// "3 s", "4 min", "-"
std::string age(double age_s) {
  if (!std::isfinite(age_s)) return "-";
  if (age_s < 9.95) return fmt::format("{:.1f} s", age_s);
  if (age_s < 100) return fmt::format("{:.0f} s", age_s);
  return age_s < 6'000 ? fmt::format("{:.0f} min", age_s / 60) : fmt::format("{:.0f} h", age_s / 3'600);
}

std::string clock(double seconds) {
  const auto s = static_cast<long long>(std::max(0.0, seconds));
  return fmt::format("{}:{:02}:{:02}", s / 3'600, s / 60 % 60, s % 60);
}

/// Draws on bounded lines, in blocks or in ASCII.
class Drawing {
 public:
  Drawing(const BusState& bus, const ScreenFacts& facts, std::size_t columns)
      : bus_(bus), facts_(facts), columns_(columns), pack_(pack_view(bus)) {}

  ScreenLine head() const {
    ScreenLine line;
    line.add("bms monitor ", TextStyle::strong).add(clean(facts_.source).substr(0, columns_ / 2));
    line.add(fmt::format("  {}  {} frames", clock(bus_.duration_s()), bus_.frames()));
    if (columns_ >= 70) line.add(fmt::format("  {:.0f}/s", facts_.frames_per_second));
    if (bus_.frames() == 0)
      line.add("  nothing heard yet", TextStyle::warning);
    else if (const double silent_s = 1e-6 * static_cast<double>(bus_.now_us() - bus_.last_us()); silent_s > 3)
      line.add(fmt::format("  silent for {}", age(silent_s)), TextStyle::alarm);
    return line;
  }

  /// What is wrong with the bus, in words; empty: nothing.
  ScreenLine troubles() const {
    std::uint64_t lost = 0, repeated = 0, crc = 0, length = 0;
    for (const MessageState& m : bus_.states())
      lost += m.lost, repeated += m.repeated, crc += m.crc_errors, length += m.wrong_length;
    ScreenLine line;
    const auto say = [&](std::uint64_t count, const char* what, TextStyle ink) {
      if (count > 0) line.add(line.columns() == 0 ? "Bus      " : ", ").add(fmt::format("{} {}", count, what), ink);
    };
    say(facts_.dropped, "dropped by the kernel", TextStyle::alarm);
    say(lost, "lost", TextStyle::warning);
    say(crc, "CRC errors", TextStyle::warning);
    say(length, "of wrong length", TextStyle::warning);
    say(repeated, "repeated", TextStyle::warning);
    say(facts_.malformed, "malformed lines", TextStyle::warning);
    say(bus_.errors(), "error reports", TextStyle::alarm);
    say(bus_.unknown_frames(), "of other ids", TextStyle::faint);
    say(bus_.remote() + bus_.fd(), "remote or FD", TextStyle::faint);
    return line;
  }

  ScreenLine soc() const {
    ScreenLine line;
    line.add("Charge   ");
    const Reading &soc = pack_.soc_percent, &sigma = pack_.soc_sigma_percent;
    line.add(number(soc, 1, " %"), ink_of(soc.stale, TextStyle::strong));
    if (sigma.known())
      line.add(fmt::format(" {} {:.1f}", facts_.blocks ? "\u00b1" : "+-", 2 * sigma.value), ink_of(sigma.stale));
    if (!pack_.soc_quality.text.empty()) line.add("  " + pack_.soc_quality.text, ink_of(soc.stale, quality_ink()));
    if (columns_ >= 70 && pack_.soc_display_percent.known())
      line.add(fmt::format("  (display {:.1f} %)", pack_.soc_display_percent.value), TextStyle::faint);
    return line;
  }

  /// 0 to 100 %: solid up to the lower end of the two-sigma band, the band, a mark at the estimate.
  ScreenLine soc_bar() const {
    ScreenLine line;
    const std::size_t width = columns_ < 12 ? 0 : columns_ - 2;
    const Reading &soc = pack_.soc_percent, &sigma = pack_.soc_sigma_percent;
    const double half = sigma.known() ? 2 * sigma.value : 0;
    line.add("[", TextStyle::faint);
    const auto column = [&](double percent) {
      return std::clamp(percent, 0.0, 100.0) / 100 * static_cast<double>(width);
    };
    for (std::size_t k = 0; k < width; ++k) {
      const double left = static_cast<double>(k), right = left + 1;
      if (!soc.known())
        line.add(".", TextStyle::faint);
      else if (column(soc.value) >= left && (column(soc.value) < right || k + 1 == width))
        line.add(facts_.blocks ? "\u2503" : "|", ink_of(soc.stale, TextStyle::strong));
      else if (column(soc.value - half) >= right)
        line.add(facts_.blocks ? "\u2588" : "#", ink_of(soc.stale, TextStyle::bar));
      else if (column(soc.value + half) > left)
        line.add(facts_.blocks ? "\u2592" : "~", ink_of(soc.stale, TextStyle::band));
      else
        line.add(" ");
    }
    line.add("]", TextStyle::faint);
    return line;
  }

  ScreenLine electrical() const {
    ScreenLine line;
    const bool stale = pack_.voltage_v.stale;
    const char* direction = !pack_.current_a.known() || pack_.current_a.value == 0 ? ""
                            : pack_.current_a.value > 0                            ? " charging"
                                                                                   : " discharging";
    line.add("Pack     ").add(number(pack_.voltage_v, 3, " V"), ink_of(stale, TextStyle::strong)).add("   ");
    line.add(number(pack_.current_a, 2, " A"), ink_of(stale, TextStyle::strong))
        .add(columns_ >= 60 ? direction : "", ink_of(stale))
        .add("   ");
    line.add(number(pack_.temperature_c, 1, facts_.blocks ? " \u00b0C" : " degC"), ink_of(stale, TextStyle::strong));
    return line;
  }

  ScreenLine limits() const {
    ScreenLine line;
    const bool stale = pack_.discharge_now_a.stale;
    if (columns_ < 62)
      return line.add("Limits   ")
          .add(fmt::format("-{}  +{}", number(pack_.discharge_now_a, 0, " A"), number(pack_.charge_now_a, 0, " A")),
               ink_of(stale));
    line.add("Limits   ")
        .add(fmt::format("discharge {} (10 s {})", number(pack_.discharge_now_a, 0, " A"),
                         number(pack_.discharge_10s_a, 0, " A")),
             ink_of(stale));
    line.add(
        fmt::format("   charge {} (10 s {})", number(pack_.charge_now_a, 0, " A"), number(pack_.charge_10s_a, 0, " A")),
        ink_of(stale));
    return line;
  }

  ScreenLine health() const {
    const auto with_band = [&](const Reading& value, const Reading& sigma) {
      return number(value, 1, " %") + (value.known() && sigma.known()
                                           ? fmt::format(" {} {:.1f}", facts_.blocks ? "\u00b1" : "+-", 2 * sigma.value)
                                           : "");
    };
    ScreenLine line;
    if (columns_ < 62)
      return line.add("Health   ")
          .add(fmt::format("{}  R {}", number(pack_.capacity_percent, 1, " %"),
                           number(pack_.resistance_percent, 0, " %")),
               ink_of(pack_.capacity_percent.stale));
    line.add("Health   ")
        .add("capacity " + with_band(pack_.capacity_percent, pack_.capacity_sigma_percent),
             ink_of(pack_.capacity_percent.stale));
    line.add("   resistance " + with_band(pack_.resistance_percent, pack_.resistance_sigma_percent),
             ink_of(pack_.resistance_percent.stale));
    return line;
  }

  ScreenLine contactor() const {
    ScreenLine line;
    for (const TextItem& w : pack_.contactor)
      line.add(line.columns() == 0 ? "Contactor " : ", ").add(clean(w.text), ink_of(w.stale, TextStyle::strong));
    return line;
  }

  /// One line, or with room one a fault and its comment.
  std::vector<ScreenLine> faults(std::size_t room) const {
    std::vector<ScreenLine> lines;
    if (!pack_.faults_received) return lines;
    if (pack_.faults.empty()) {
      lines.emplace_back().add("Faults   ").add("none", TextStyle::good);
    } else if (room < pack_.faults.size()) {
      ScreenLine& line = lines.emplace_back();
      line.add("Faults   ");
      for (std::size_t k = 0; k < pack_.faults.size(); ++k)
        line.add(k == 0 ? "" : ", ").add(clean(pack_.faults[k].text), ink_of(pack_.faults[k].stale, TextStyle::alarm));
    } else {
      for (std::size_t k = 0; k < pack_.faults.size(); ++k) {
        lines.emplace_back()
            .add(k == 0 ? "Faults   " : "         ")
            .add(clean(pack_.faults[k].text), ink_of(pack_.faults[k].stale, TextStyle::alarm))
            .add("  " + clean(pack_.faults[k].comment), TextStyle::faint);
      }
    }
    return lines;
  }

  ScreenLine fault_details() const {
    ScreenLine line;
    for (const TextItem& w : pack_.fault_details)
      line.add(line.columns() == 0 ? "         " : ", ").add(clean(w.text), ink_of(w.stale));
    return line;
  }

  ScreenLine flags() const {
    ScreenLine line;
    for (const TextItem& w : pack_.flags)
      line.add(line.columns() == 0 ? "Estimate " : ", ").add(w.text, ink_of(w.stale, TextStyle::warning));
    return line;
  }

  /// Summary, then bars in as many columns as fit; nothing more when there is no room for them.
  std::vector<ScreenLine> cells(std::size_t room) const {
    std::vector<ScreenLine> lines;
    const auto c = pack_.cells();
    if (c.count == 0 || room == 0) return lines;
    ScreenLine& summary = lines.emplace_back();
    const bool stale = pack_.cells_v[c.lowest].stale && pack_.cells_v[c.highest].stale;
    summary.add("Cells    ")
        .add(fmt::format("min {:.3f} V (cell {})  max {:.3f} V (cell {})  ", c.lowest_v, c.lowest + 1, c.highest_v,
                         c.highest + 1),
             ink_of(stale));
    summary.add(fmt::format("delta {:.0f} mV", 1e3 * (c.highest_v - c.lowest_v)), ink_of(stale, TextStyle::strong));
    // bars over a range that shows millivolts but does not make noise look large
    const double span_v = std::max(0.05, 1.25 * (c.highest_v - c.lowest_v)), from_v = c.highest_v - span_v;
    const std::size_t least = 20, fit = std::max<std::size_t>(1, columns_ / least);
    for (const std::size_t across : {std::size_t{1}, std::size_t{2}, std::size_t{4}, std::size_t{8}}) {
      const std::size_t rows = (pack_.cells_v.size() + across - 1) / across;
      if (across > fit || rows >= room) continue;
      for (std::size_t row = 0; row < rows; ++row) {
        ScreenLine& line = lines.emplace_back();
        for (std::size_t k = row; k < pack_.cells_v.size(); k += rows)
          cell(line, k, std::min<std::size_t>(columns_ / across, 60), from_v, span_v);
      }
      break;
    }
    return lines;
  }

  std::vector<ScreenLine> message_table() const {
    std::vector<ScreenLine> lines;
    lines.emplace_back().add(fmt::format("{:<16} {:>8} {:>7} {:>8} {:>5} {:>5} {:>5} {:>6}", "Message", "per s", "age",
                                         "frames", "lost", "CRC", "rep.", "length"),
                             TextStyle::strong);
    for (std::size_t k = 0; k < messages().size(); ++k) {
      if (bus_.states()[k].frames > 0 || bus_.states()[k].crc_errors + bus_.states()[k].wrong_length > 0)
        lines.push_back(message(k));
    }
    return lines;
  }

  /// The same with each signal below its message.
  std::vector<ScreenLine> signal_table() const {
    auto lines = message_table();
    std::vector<ScreenLine> all{lines.front()};
    std::size_t at = 1;
    for (std::size_t k = 0; k < messages().size(); ++k) {
      const MessageState& state = bus_.states()[k];
      if (state.frames == 0 && state.crc_errors + state.wrong_length == 0) continue;
      all.push_back(lines[at++]);
      for (std::size_t s = 0; state.frames > 0 && s < state.values.size(); ++s) {
        all.emplace_back()
            .add(fmt::format("  {:<24} ", messages()[k].signals[s].name), TextStyle::faint)
            .add(clean(text_of(messages()[k].signals[s], state.values[s])), ink_of(bus_.stale(k)));
      }
    }
    return all;
  }

  std::vector<ScreenLine> unknown_ids() const {
    std::vector<ScreenLine> lines;
    if (bus_.unknown_frames() == 0) return lines;
    ScreenLine& line = lines.emplace_back();
    line.add("Other ids");
    for (const auto& u : bus_.unknown_ids()) {
      const std::string text = fmt::format(" {:0{}X}:{}", u.id, u.long_id ? 8 : 3, u.frames);
      if (line.columns() + text.size() > columns_) return lines;
      line.add(text, TextStyle::faint);
    }
    return lines;
  }

 private:
  TextStyle quality_ink() const {
    const std::string& q = pack_.soc_quality.text;
    return q.starts_with("told") ? TextStyle::good : q.starts_with("carried") ? TextStyle::plain : TextStyle::warning;
  }

  ScreenLine message(std::size_t k) const {
    const MessageState& m = bus_.states()[k];
    ScreenLine line;
    const bool stale = bus_.stale(k);
    line.add(fmt::format("{:<16} {:>8.{}f} {:>7} {:>8}", messages()[k].name, m.rate_hz(), m.rate_hz() < 99.95 ? 1 : 0,
                         age(bus_.age_s(k)), m.frames),
             ink_of(stale));
    const auto count = [&](std::uint64_t n, int width) {
      line.add(fmt::format(" {:>{}}", n, width), n > 0 ? TextStyle::warning : ink_of(true));
    };
    count(m.lost, 5);
    count(m.crc_errors, 5);
    count(m.repeated, 5);
    count(m.wrong_length, 6);
    return line;
  }

  /// " 3 3.2812 ######    " in so many columns, the last a blank.
  void cell(ScreenLine& line, std::size_t k, std::size_t width, double from_v, double span_v) const {
    const Reading& r = pack_.cells_v[k];
    const std::size_t begin = line.columns(), room = width > 12 ? width - 12 : 0;
    const auto c = pack_.cells();
    const TextStyle ink = ink_of(r.stale, k == c.lowest    ? TextStyle::warning
                                          : k == c.highest ? TextStyle::good
                                                           : TextStyle::plain);
    line.add(fmt::format("{:>3} {:>6} ", k + 1, r.known() ? fmt::format("{:.3f}", r.value) : "-"), ink);
    if (r.known()) line.add(bar((r.value - from_v) / span_v, room), ink_of(r.stale, TextStyle::bar));
    line.to(begin + width);
  }

  std::string bar(double part, std::size_t columns) const {
    static constexpr std::array<const char*, 8> eighths = {"",       "\u258f", "\u258e", "\u258d",
                                                           "\u258c", "\u258b", "\u258a", "\u2589"};
    const double length = std::clamp(part, 0.0, 1.0) * static_cast<double>(columns);
    std::string text;
    for (std::size_t k = 0; k < static_cast<std::size_t>(length); ++k) text += facts_.blocks ? "\u2588" : "#";
    if (facts_.blocks) text += eighths[static_cast<std::size_t>((length - std::floor(length)) * 8)];
    return text;
  }

  const BusState& bus_;
  const ScreenFacts& facts_;
  std::size_t columns_;
  PackView pack_;
};

void add(std::vector<ScreenLine>& lines, ScreenLine line) {
  if (line.columns() > 0) lines.push_back(std::move(line));
}

void add(std::vector<ScreenLine>& lines, std::vector<ScreenLine> more) {
  for (ScreenLine& line : more) lines.push_back(std::move(line));
}

/// All that is about the battery; room: lines that it may have.
std::vector<ScreenLine> pack_part(const Drawing& d, std::size_t room) {
  std::vector<ScreenLine> lines;
  const bool roomy = room >= 16;
  add(lines, d.soc());
  add(lines, d.soc_bar());
  add(lines, d.electrical());
  add(lines, d.faults(roomy ? room / 4 : 0));
  add(lines, d.fault_details());
  add(lines, d.contactor());
  add(lines, d.flags());
  add(lines, d.limits());
  add(lines, d.health());
  add(lines, d.cells(room > lines.size() ? room - lines.size() : 0));
  return lines;
}

}  // namespace

ScreenLine& ScreenLine::add(std::string_view text, TextStyle ink) {
  if (text.empty()) return *this;
  if (!pieces_.empty() && pieces_.back().ink == ink)
    pieces_.back().text += text;
  else
    pieces_.push_back({std::string(text), ink});
  return *this;
}

ScreenLine& ScreenLine::to(std::size_t column) {
  const std::size_t now = columns();
  if (now < column) add(std::string(column - now, ' '));
  return *this;
}

ScreenLine& ScreenLine::append(const ScreenLine& other) {
  for (const Piece& piece : other.pieces_) add(piece.text, piece.ink);
  return *this;
}

void ScreenLine::cut(std::size_t most) {
  std::size_t left = most;
  for (std::size_t k = 0; k < pieces_.size(); ++k) {
    std::string& text = pieces_[k].text;
    std::size_t at = 0;
    for (; at < text.size() && left > 0; --left) at += bytes_of(text[at]);
    text.resize(std::min(at, text.size()));
    if (text.empty()) {
      pieces_.resize(k);
      return;
    }
  }
}

std::size_t ScreenLine::columns() const {
  std::size_t n = 0;
  for (const Piece& piece : pieces_) n += columns_of(piece.text);
  return n;
}

std::vector<ScreenLine> screen(const BusState& bus, const ScreenFacts& facts, const ScreenSize& size) {
  constexpr std::size_t beside = 150, left_columns = 84;
  const bool two = size.columns >= beside;
  const Drawing all(bus, facts, size.columns), pack(bus, facts, two ? left_columns - 2 : size.columns);
  std::vector<ScreenLine> lines;
  add(lines, all.head());
  add(lines, all.troubles());
  if (two) {
    lines.emplace_back();
    const std::size_t room = size.rows > lines.size() ? size.rows - lines.size() : 0;
    auto left = pack_part(pack, room), right = all.signal_table();
    if (right.size() > room) right = all.message_table();
    for (std::size_t k = 0; k < std::max(left.size(), right.size()); ++k) {
      ScreenLine& line = lines.emplace_back();
      if (k < left.size()) line.append(left[k]);
      line.cut(left_columns - 2);
      if (k < right.size()) line.to(left_columns).append(right[k]);
    }
  } else {
    const std::size_t room = size.rows > lines.size() ? size.rows - lines.size() : 0;
    const auto table = all.message_table(), signals = all.signal_table();
    const std::size_t wanted = room > table.size() + 10 ? room - table.size() - 1 : room;
    add(lines, pack_part(pack, wanted));
    if (lines.size() + 3 < size.rows) {
      lines.emplace_back();
      add(lines, lines.size() + signals.size() < size.rows ? signals : table);
    }
  }
  if (lines.size() < size.rows) add(lines, all.unknown_ids());
  if (lines.size() > size.rows) lines.resize(size.rows);
  for (ScreenLine& line : lines) line.cut(size.columns);
  return lines;
}

std::string plain_text(const std::vector<ScreenLine>& lines) {
  std::string text;
  for (const ScreenLine& line : lines) {
    std::string whole;
    for (const auto& piece : line.pieces()) whole += piece.text;
    whole.erase(whole.find_last_not_of(' ') + 1);
    text += whole + "\n";
  }
  return text;
}

std::string ansi_frame(const std::vector<ScreenLine>& lines) {
  static constexpr std::array<const char*, 8> inks = {"",         "\x1b[90m",   "\x1b[1m",  "\x1b[32m",
                                                      "\x1b[33m", "\x1b[1;31m", "\x1b[34m", "\x1b[36m"};
  std::string text = "\x1b[?2026h\x1b[H";
  for (std::size_t k = 0; k < lines.size(); ++k) {
    if (k > 0) text += "\r\n";
    for (const auto& piece : lines[k].pieces()) {
      const char* ink = inks[static_cast<std::size_t>(piece.ink)];
      text += ink + piece.text + (*ink != '\0' ? "\x1b[0m" : "");
    }
    text += "\x1b[K";
  }
  return text + "\x1b[J\x1b[?2026l";
}

std::string status_line(const BusState& bus, const ScreenFacts& facts) {
  const PackView p = pack_view(bus);
  std::string text = clock(bus.duration_s());
  if (bus.good() == 0) {
    text += fmt::format("  nothing of the BMS in {} frames", bus.frames());
  } else {
    text +=
        fmt::format("  {} +- {}  {}  {}  {}", number(p.soc_percent, 2, " %"),
                    p.soc_sigma_percent.known() ? fmt::format("{:.2f}", 2 * p.soc_sigma_percent.value) : "-",
                    number(p.voltage_v, 3, " V"), number(p.current_a, 2, " A"), number(p.temperature_c, 1, " degC"));
    if (!p.soc_quality.text.empty()) text += "  " + p.soc_quality.text;
    if (const auto c = p.cells(); c.count > 0)
      text += fmt::format("  cells {:.3f} to {:.3f} V", c.lowest_v, c.highest_v);
    for (const TextItem& w : p.contactor) text += "  " + clean(w.text);
    for (const TextItem& w : p.faults) text += "  FAULT " + clean(w.text);
    if (p.soc_percent.stale) text += fmt::format("  stale for {}", age(p.soc_percent.age_s));
  }
  std::uint64_t lost = 0, crc = 0;
  for (const MessageState& m : bus.states()) lost += m.lost, crc += m.crc_errors + m.wrong_length;
  if (lost > 0) text += fmt::format("  {} lost", lost);
  if (crc > 0) text += fmt::format("  {} damaged", crc);
  if (facts.dropped > 0) text += fmt::format("  {} dropped", facts.dropped);
  return text;
}

}  // namespace bms::monitor
