#include "monitor/screen.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>

#include <fmt/format.h>

#include "monitor/message_table.hpp"
#include "monitor/pack_view.hpp"

namespace bms::monitor {

namespace {

std::string number(const Reading& r, int digits, const char* unit) {
  return r.known() ? fmt::format("{:.{}f}{}", r.value, digits, unit) : fmt::format("-{}", unit);
}

std::string clock(double seconds) {
  const auto s = static_cast<long long>(std::max(0.0, seconds));
  return fmt::format("{}:{:02}:{:02}", s / 3'600, s / 60 % 60, s % 60);
}

constexpr double silent_after_s = 3;
constexpr int soc_from_voltage = 1, soc_from_counting = 2;  // values of the signal SocQuality
constexpr double smallest_bar_range_v = 0.05;               // of the cell bars, so that noise does not look large
constexpr std::size_t least_cell_columns = 20, most_cell_columns = 60, cell_text_columns = 12;
constexpr std::size_t columns_for_rate = 70, columns_for_direction = 60, columns_for_long_lines = 62;
constexpr std::size_t two_part_columns = 150, left_columns = 84;  // pack on the left, messages on the right
constexpr std::size_t rows_for_fault_comments = 16;

/// Draws lines of a given width, with block characters or in ASCII.
class Drawing {
 public:
  Drawing(const BusState& bus, const ScreenFacts& facts, std::size_t columns)
      : bus_(bus), facts_(facts), columns_(columns), pack_(pack_view(bus)) {}

  ScreenLine head() const {
    ScreenLine line;
    line.add("bms monitor ", TextStyle::strong).add(printable(facts_.source).substr(0, columns_ / 2));
    line.add(fmt::format("  {}  {} frames", clock(bus_.duration_s()), bus_.frames()));
    if (columns_ >= columns_for_rate) line.add(fmt::format("  {:.0f}/s", facts_.frames_per_second));
    if (bus_.frames() == 0)
      line.add("  no frames received yet", TextStyle::warning);
    else if (const double silent_s = 1e-6 * static_cast<double>(bus_.now_us() - bus_.last_us());
             silent_s > silent_after_s)
      line.add(fmt::format("  silent for {}", age_text(silent_s)), TextStyle::alarm);
    return line;
  }

  /// Errors of the bus; empty without errors.
  ScreenLine troubles() const {
    std::uint64_t lost = 0, repeated = 0, crc = 0, length = 0;
    for (const MessageState& m : bus_.states()) {
      lost += m.lost;
      repeated += m.repeated;
      crc += m.crc_errors;
      length += m.wrong_length;
    }
    ScreenLine line;
    const auto report = [&](std::uint64_t count, const char* what, TextStyle style) {
      if (count > 0) line.add(line.columns() == 0 ? "Bus      " : ", ").add(fmt::format("{} {}", count, what), style);
    };
    report(facts_.dropped, "dropped by the kernel", TextStyle::alarm);
    report(lost, "lost", TextStyle::warning);
    report(crc, "CRC errors", TextStyle::warning);
    report(length, "with wrong length", TextStyle::warning);
    report(repeated, "repeated", TextStyle::warning);
    report(facts_.malformed, "malformed lines", TextStyle::warning);
    report(bus_.errors(), "error reports", TextStyle::alarm);
    report(bus_.unknown_frames(), "with other ids", TextStyle::faint);
    report(bus_.remote() + bus_.fd(), "remote or FD", TextStyle::faint);
    return line;
  }

  ScreenLine soc() const {
    ScreenLine line;
    line.add("Charge   ");
    const Reading &soc = pack_.soc_percent, &sigma = pack_.soc_sigma_percent;
    line.add(number(soc, 1, " %"), style_of(soc.stale, TextStyle::strong));
    if (sigma.known())
      line.add(fmt::format(" {} {:.1f}", facts_.blocks ? "\u00b1" : "+-", 2 * sigma.value), style_of(sigma.stale));
    if (!pack_.soc_quality.text.empty()) line.add("  " + pack_.soc_quality.text, style_of(soc.stale, quality_style()));
    if (columns_ >= columns_for_rate && pack_.soc_display_percent.known())
      line.add(fmt::format("  (display {:.1f} %)", pack_.soc_display_percent.value), TextStyle::faint);
    return line;
  }

  /// A bar from 0 to 100 %: filled up to the lower end of the two-sigma band, then the band; a mark at the estimate.
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
        line.add(facts_.blocks ? "\u2503" : "|", style_of(soc.stale, TextStyle::strong));
      else if (column(soc.value - half) >= right)
        line.add(facts_.blocks ? "\u2588" : "#", style_of(soc.stale, TextStyle::bar));
      else if (column(soc.value + half) > left)
        line.add(facts_.blocks ? "\u2592" : "~", style_of(soc.stale, TextStyle::band));
      else
        line.add(" ");
    }
    line.add("]", TextStyle::faint);
    return line;
  }

  ScreenLine electrical() const {
    ScreenLine line;
    const bool stale = pack_.voltage_v.stale;
    line.add("Pack     ").add(number(pack_.voltage_v, 3, " V"), style_of(stale, TextStyle::strong)).add("   ");
    line.add(number(pack_.current_a, 2, " A"), style_of(stale, TextStyle::strong))
        .add(columns_ >= columns_for_direction ? direction() : "", style_of(stale))
        .add("   ");
    line.add(number(pack_.temperature_c, 1, facts_.blocks ? " \u00b0C" : " degC"), style_of(stale, TextStyle::strong));
    if (pack_.front_end_c.known() && columns_ >= columns_for_direction)
      line.add("   front end " + number(pack_.front_end_c, 0, facts_.blocks ? " \u00b0C" : " degC"),
               style_of(pack_.front_end_c.stale));
    return line;
  }

  ScreenLine limits() const {
    ScreenLine line;
    const bool stale = pack_.discharge_now_a.stale;
    if (columns_ < columns_for_long_lines)
      return line.add("Limits   ")
          .add(fmt::format("-{}  +{}", number(pack_.discharge_now_a, 0, " A"), number(pack_.charge_now_a, 0, " A")),
               style_of(stale));
    line.add("Limits   ")
        .add(fmt::format("discharge {} (10 s {})", number(pack_.discharge_now_a, 0, " A"),
                         number(pack_.discharge_10s_a, 0, " A")),
             style_of(stale));
    line.add(
        fmt::format("   charge {} (10 s {})", number(pack_.charge_now_a, 0, " A"), number(pack_.charge_10s_a, 0, " A")),
        style_of(stale));
    return line;
  }

  ScreenLine health() const {
    const auto with_band = [&](const Reading& value, const Reading& sigma) {
      return number(value, 1, " %") + (value.known() && sigma.known()
                                           ? fmt::format(" {} {:.1f}", facts_.blocks ? "\u00b1" : "+-", 2 * sigma.value)
                                           : "");
    };
    ScreenLine line;
    if (columns_ < columns_for_long_lines)
      return line.add("Health   ")
          .add(fmt::format("{}  R {}", number(pack_.capacity_percent, 1, " %"),
                           number(pack_.resistance_percent, 0, " %")),
               style_of(pack_.capacity_percent.stale));
    line.add("Health   ")
        .add("capacity " + with_band(pack_.capacity_percent, pack_.capacity_sigma_percent),
             style_of(pack_.capacity_percent.stale));
    line.add("   resistance " + with_band(pack_.resistance_percent, pack_.resistance_sigma_percent),
             style_of(pack_.resistance_percent.stale));
    return line;
  }

  ScreenLine contactor() const {
    ScreenLine line;
    for (const TextItem& w : pack_.contactor)
      line.add(line.columns() == 0 ? "Contactor " : ", ").add(printable(w.text), style_of(w.stale, TextStyle::strong));
    return line;
  }

  /// One line; or one line for each fault, with its comment, if `room` is large enough.
  std::vector<ScreenLine> faults(std::size_t room) const {
    std::vector<ScreenLine> lines;
    if (!pack_.faults_received) return lines;
    if (pack_.faults.empty()) {
      lines.emplace_back().add("Faults   ").add("none", TextStyle::good);
    } else if (room < pack_.faults.size()) {
      ScreenLine& line = lines.emplace_back();
      line.add("Faults   ");
      for (std::size_t k = 0; k < pack_.faults.size(); ++k)
        line.add(k == 0 ? "" : ", ")
            .add(printable(pack_.faults[k].text), style_of(pack_.faults[k].stale, TextStyle::alarm));
    } else {
      for (std::size_t k = 0; k < pack_.faults.size(); ++k) {
        lines.emplace_back()
            .add(k == 0 ? "Faults   " : "         ")
            .add(printable(pack_.faults[k].text), style_of(pack_.faults[k].stale, TextStyle::alarm))
            .add("  " + printable(pack_.faults[k].comment), TextStyle::faint);
      }
    }
    return lines;
  }

  ScreenLine fault_details() const {
    ScreenLine line;
    for (const TextItem& w : pack_.fault_details)
      line.add(line.columns() == 0 ? "         " : ", ").add(printable(w.text), style_of(w.stale));
    return line;
  }

  ScreenLine flags() const {
    ScreenLine line;
    for (const TextItem& w : pack_.flags)
      line.add(line.columns() == 0 ? "Estimate " : ", ").add(w.text, style_of(w.stale, TextStyle::warning));
    return line;
  }

  /// A summary, then a bar for each cell in up to eight columns; only the summary if `room` is too small for them.
  std::vector<ScreenLine> cells(std::size_t room) const {
    std::vector<ScreenLine> lines;
    const auto c = pack_.cells();
    if (c.count == 0 || room == 0) return lines;
    ScreenLine& summary = lines.emplace_back();
    const bool stale = pack_.cells_v[c.lowest].stale && pack_.cells_v[c.highest].stale;
    summary.add("Cells    ")
        .add(fmt::format("min {:.3f} V (cell {})  max {:.3f} V (cell {})  ", c.lowest_v, c.lowest + 1, c.highest_v,
                         c.highest + 1),
             style_of(stale));
    summary.add(fmt::format("delta {:.0f} mV", 1e3 * (c.highest_v - c.lowest_v)), style_of(stale, TextStyle::strong));
    const double span_v = std::max(smallest_bar_range_v, 1.25 * (c.highest_v - c.lowest_v)),
                 from_v = c.highest_v - span_v;
    const std::size_t fit = std::max<std::size_t>(1, columns_ / least_cell_columns);
    for (const std::size_t across : {std::size_t{1}, std::size_t{2}, std::size_t{4}, std::size_t{8}}) {
      const std::size_t rows = (pack_.cells_v.size() + across - 1) / across;
      if (across > fit || rows >= room) continue;
      for (std::size_t row = 0; row < rows; ++row) {
        ScreenLine& line = lines.emplace_back();
        for (std::size_t k = row; k < pack_.cells_v.size(); k += rows)
          cell(line, k, std::min<std::size_t>(columns_ / across, most_cell_columns), from_v, span_v);
      }
      break;
    }
    return lines;
  }

 private:
  const char* direction() const {
    if (!pack_.current_a.known() || pack_.current_a.value == 0) return "";
    return pack_.current_a.value > 0 ? " charging" : " discharging";
  }

  TextStyle quality_style() const {
    if (pack_.soc_quality_value == soc_from_voltage) return TextStyle::good;
    return pack_.soc_quality_value == soc_from_counting ? TextStyle::plain : TextStyle::warning;
  }

  /// Adds "  3  3.281 ######    " in `width` columns; the last is a space.
  void cell(ScreenLine& line, std::size_t k, std::size_t width, double from_v, double span_v) const {
    const Reading& r = pack_.cells_v[k];
    const std::size_t begin = line.columns(), room = width > cell_text_columns ? width - cell_text_columns : 0;
    const auto c = pack_.cells();
    TextStyle fresh = TextStyle::plain;
    if (k == c.highest) fresh = TextStyle::good;
    if (k == c.lowest) fresh = TextStyle::warning;
    line.add(fmt::format("{:>3} {:>6} ", k + 1, r.known() ? fmt::format("{:.3f}", r.value) : "-"),
             style_of(r.stale, fresh));
    if (r.known()) line.add(bar((r.value - from_v) / span_v, room), style_of(r.stale, TextStyle::bar));
    line.pad_to(begin + width);
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

/// The lines about the battery; `room` is the number of rows.
std::vector<ScreenLine> pack_part(const Drawing& d, std::size_t room) {
  std::vector<ScreenLine> lines;
  const bool roomy = room >= rows_for_fault_comments;
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

std::vector<ScreenLine> right_part(const BusState& bus, std::size_t room) {
  auto signals = signal_table(bus);
  return signals.size() > room ? message_table(bus) : signals;
}

std::vector<ScreenLine> side_by_side(const std::vector<ScreenLine>& left, const std::vector<ScreenLine>& right) {
  std::vector<ScreenLine> lines;
  for (std::size_t k = 0; k < std::max(left.size(), right.size()); ++k) {
    ScreenLine& line = lines.emplace_back();
    if (k < left.size()) line.append(left[k]);
    line.cut(left_columns - 2);
    if (k < right.size()) line.pad_to(left_columns).append(right[k]);
  }
  return lines;
}

}  // namespace

std::vector<ScreenLine> screen(const BusState& bus, const ScreenFacts& facts, const ScreenSize& size) {
  const bool two_parts = size.columns >= two_part_columns;
  const Drawing all(bus, facts, size.columns);
  std::vector<ScreenLine> lines;
  add(lines, all.head());
  add(lines, all.troubles());
  if (two_parts) lines.emplace_back();
  const std::size_t room = size.rows > lines.size() ? size.rows - lines.size() : 0;
  if (two_parts) {
    add(lines, side_by_side(pack_part(Drawing(bus, facts, left_columns - 2), room), right_part(bus, room)));
  } else {
    const auto table = message_table(bus), signals = signal_table(bus);
    add(lines, pack_part(all, room > table.size() + 10 ? room - table.size() - 1 : room));
    if (lines.size() + 3 < size.rows) {
      lines.emplace_back();
      add(lines, lines.size() + signals.size() < size.rows ? signals : table);
    }
  }
  if (lines.size() < size.rows) add(lines, unknown_id_lines(bus, size.columns));
  if (lines.size() > size.rows) lines.resize(size.rows);
  for (ScreenLine& line : lines) line.cut(size.columns);
  return lines;
}

std::string status_line(const BusState& bus, const ScreenFacts& facts) {
  const PackView p = pack_view(bus);
  std::string text = clock(bus.duration_s());
  if (bus.accepted() == 0) {
    text += fmt::format("  no BMS message in {} frames", bus.frames());
  } else {
    text +=
        fmt::format("  {} +- {}  {}  {}  {}", number(p.soc_percent, 2, " %"),
                    p.soc_sigma_percent.known() ? fmt::format("{:.2f}", 2 * p.soc_sigma_percent.value) : "-",
                    number(p.voltage_v, 3, " V"), number(p.current_a, 2, " A"), number(p.temperature_c, 1, " degC"));
    if (!p.soc_quality.text.empty()) text += "  " + p.soc_quality.text;
    if (const auto c = p.cells(); c.count > 0)
      text += fmt::format("  cells {:.3f} to {:.3f} V", c.lowest_v, c.highest_v);
    for (const TextItem& w : p.contactor) text += "  " + printable(w.text);
    for (const TextItem& w : p.faults) text += "  FAULT " + printable(w.text);
    if (p.soc_percent.stale) text += fmt::format("  stale for {}", age_text(p.soc_percent.age_s));
  }
  std::uint64_t lost = 0, crc = 0;
  for (const MessageState& m : bus.states()) {
    lost += m.lost;
    crc += m.crc_errors + m.wrong_length;
  }
  if (lost > 0) text += fmt::format("  {} lost", lost);
  if (crc > 0) text += fmt::format("  {} damaged", crc);
  if (facts.dropped > 0) text += fmt::format("  {} dropped", facts.dropped);
  return text;
}

}  // namespace bms::monitor
