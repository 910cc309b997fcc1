#include "diagnosis/pack/pack_texts.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

/// In the order of Cause.
constexpr std::array texts = {
    CauseText{"charge_imbalance", "a charge that differs from that of its neighbours", "soc", "1",
              "The cell is charged more or less than the others. The pack is full or empty earlier than it should be.",
              "Balance the pack. If the difference returns, look for self-discharge."},
    CauseText{"capacity_change", "a capacity that is lower than that of its neighbours", "loss", "1",
              "The cell stores less charge than the others and limits the pack.",
              "Measure the capacity of this cell; plan its replacement."},
    CauseText{"leakage", "self-discharge", "per_day", "1/day",
              "The cell loses charge against its neighbours while the pack works and rests.",
              "Measure the voltage of this cell over some days at rest. An internal short can be dangerous: watch its "
              "temperature."},
    CauseText{"resistance_growth", "a resistance of the cell that is higher than that of its neighbours", "growth", "1",
              "The cell is aged, cold or damaged. It heats up more and reaches the voltage limits earlier.",
              "Compare its temperature with the neighbours, then measure its resistance with pulses."},
    CauseText{"joint_resistance", "a resistance in a connection", "resistance_ohm", "ohm",
              "A busbar or a joint next to the cell has a contact resistance. It heats up with the square of the "
              "current.",
              "Open the pack, check the torque and the surfaces of the connections of this cell, look for hot spots."},
    CauseText{"voltage_offset", "a voltage channel with an offset", "offset_v", "V",
              "The channel shows a constant error. Limits of this cell trip too early or too late.",
              "Measure the voltage of this cell with a meter at rest and calibrate or replace the monitor."},
    CauseText{"voltage_gain", "a voltage channel with a gain error", "gain", "1",
              "The channel's error grows with the voltage.",
              "Measure the voltage of this cell with a meter at two states of charge and calibrate the monitor."},
    CauseText{"channel_skew", "a voltage channel that is late", "delay_s", "s",
              "The readings of this channel are older than those of its neighbours.",
              "Check the sampling of the monitor. Do not compare this cell during changes of the current."},
    CauseText{
        "sense_wire", "a sense wire with an error", "offset_v", "V",
        "Two neighbouring cells have errors of the same size and opposite sign: the wire between them is at fault.",
        "Check the sense wire and its plug between these two cells."},
    CauseText{"channel_held", "voltage readings that are held", "period_s", "s",
              "The readings change only once in this time. In between, an old value is recorded.",
              "Check how the logger and the monitor read these channels. Use only readings that have just changed."},
    CauseText{"channels_staggered", "voltage channels that are sampled at different times", "spread_s", "s",
              "The channels are read one after the other. During changes of the current their difference does not come "
              "from the cells.",
              "Compare cells only while the current is constant."},
    CauseText{"readings_missing", "a voltage channel with missing readings", "share", "1",
              "The channel often has no reading.", "Check the connection of the monitor and its communication."},
    CauseText{"temperature_sensor", "a temperature sensor that disagrees with the others", "offset_k", "K",
              "The sensor reads another temperature than the others, more than the pack's own differences explain.",
              "Compare the sensor with a thermometer at rest. If it is right, the pack has a hot or a cold spot."},
    CauseText{"pack_voltage", "a pack voltmeter that disagrees with the sum of the cells", "gain", "1",
              "The pack's voltmeter and the sum of the cell voltages differ.",
              "Measure the pack's voltage with a meter and calibrate the voltmeter."},
    CauseText{"shared", "a cause that all cells share", "", "", "All cells show it.", ""},
    CauseText{"current_offset", "a current sensor with an offset", "offset_a", "A",
              "The sensor shows a current that does not flow. The state of charge drifts.",
              "Read the sensor with the contactors open and calibrate its zero."},
    CauseText{"current_gain", "a current sensor with a gain error", "gain", "1",
              "The sensor's error grows with the current. Charge and resistances of all cells are wrong.",
              "Compare the sensor with a second one under load."},
    CauseText{"all_capacity", "a capacity of all cells that differs from the cell file", "loss", "1",
              "The pack has aged as a whole, or its cell file describes another cell.",
              "Measure the capacity of the pack and identify the cell file again."},
    CauseText{"current_sign", "a current sensor with a reversed sign", "share", "1",
              "The voltage of the cells falls when the reading rises. The state of charge goes the wrong way.",
              "Check the direction of the sensor and the sign in the logger. Positive current charges. The diagnosis "
              "used the reversed current."},
    CauseText{"current_silent", "a current sensor that reads exactly 0 under load", "duration_s", "s",
              "While the reading is 0, the voltages show steps of a load. The charge of that time is not counted.",
              "Check the connection of the sensor and its reading. If it is read, look for loads that bypass it."},
};

/// Factor and unit for a reader.
struct Shown {
  double factor;
  const char* unit;
  int digits;
};

Shown shown(std::string_view unit) {
  if (unit == "1") return {100, "%", 1};
  if (unit == "1/day") return {100, "% a day", 2};
  if (unit == "ohm") return {1e6, "µohm", 0};
  if (unit == "V") return {1e3, "mV", 1};
  if (unit == "s") return {1, "s", 2};
  if (unit == "A") return {1e3, "mA", 0};
  return {1, "K", 1};
}

std::string number(double value, double sigma, std::string_view unit) {
  const Shown s = shown(unit);
  if (!(sigma > 0)) return fmt::format("{:.{}f} {}", s.factor * value, s.digits, s.unit);
  return fmt::format("{:.{}f} ± {:.{}f} {}", s.factor * value, s.digits, s.factor * sigma, s.digits, s.unit);
}

std::string relation_of(const PackFinding& f) {
  const bool up = f.value > 0;
  switch (f.cause) {
    case Cause::imbalance:
      return up ? "more charge than its neighbours" : "less charge than its neighbours";
    case Cause::capacity:
      return "less capacity than its neighbours";
    case Cause::leakage:
      return "of its charge is lost";
    case Cause::resistance:
      return "more resistance than its neighbours";
    case Cause::joint:
      return "in series";
    case Cause::offset:
    case Cause::gain:
    case Cause::thermistor:
    case Cause::pack_voltage:
    case Cause::current_offset:
    case Cause::current_gain:
      return up ? "too high" : "too low";
    case Cause::all_capacity:
      return f.value > 0 ? "less than in the cell file" : "more than in the cell file";
    case Cause::late:
      return up ? "later than its neighbours" : "earlier than its neighbours";
    case Cause::sense_wire:
      return "on one cell, the opposite on the other";
    case Cause::repeated:
      return "between readings";
    case Cause::staggered:
      return "from the first to the last channel";
    case Cause::current_silent:
      return "in total";
    case Cause::current_sign:
      return "of the changes of the current show it";
    default:
      return "of the rows";
  }
}

}  // namespace

const CauseText& text_of(Cause cause) { return texts[static_cast<std::size_t>(cause)]; }

std::string id_of(const PackFinding& f) { return f.id.empty() ? std::string(text_of(f.cause).id) : f.id; }

std::string place_of(Cause cause, std::size_t cell) {
  if (cause == Cause::thermistor) return fmt::format("temperature sensor {}", cell + 1);
  if (cause == Cause::sense_wire) return fmt::format("the sense wire between cells {} and {}", cell + 1, cell + 2);
  return fmt::format("cell {}", cell + 1);
}

std::string place_of(const PackFinding& f) {
  if (f.cell) return place_of(f.cause, *f.cell);
  return f.cells.empty() ? "the pack" : "cells " + cells_text(f.cells);
}

std::string size_text(const PackFinding& f) {
  PackFinding shown = f;
  const bool unsigned_size = f.cause != Cause::sense_wire;
  if (unsigned_size) shown.value = std::abs(f.value);
  const std::string what = f.cause == Cause::offset || f.cause == Cause::gain || f.cause == Cause::thermistor ||
                                   f.cause == Cause::pack_voltage || f.cause == Cause::current_offset ||
                                   f.cause == Cause::current_gain
                               ? "reads "
                               : "";
  return what + number(shown.value, f.sigma, text_of(f.cause).unit) + " " + relation_of(f);
}

std::string sentence_of(const PackFinding& f) {
  if (f.cause == Cause::shared) return "All cells: " + f.because;
  std::string place = place_of(f);
  place.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(place.front())));
  return fmt::format("{}: {} ({}; probability {:.0f} %).", place, text_of(f.cause).name, size_text(f),
                     std::floor(100 * f.probability));
}

std::string rivals_text(const PackFinding& f) {
  if (f.rivals.empty()) return "";
  std::string text;
  for (const Rival& r : f.rivals) {
    if (!text.empty()) text += "; ";
    text += fmt::format("{}: {} ({:.0f} %)", r.cell ? place_of(r.cause, *r.cell) : "all cells", text_of(r.cause).name,
                        100 * r.probability);
  }
  return "It could also be: " + text + ".";
}

std::string time_text(const PackFinding& f) {
  if (!f.after_s) return "";
  return fmt::format("The verdict was the same from {:.0f} min of recording on.", std::ceil(*f.after_s / 60));
}

std::string limit_text(const PackLimit& l) {
  return fmt::format("{} {}", text_of(l.cause).id, number(l.value, 0, text_of(l.cause).unit));
}

std::string not_visible_text(const PackDiagnosis& d) {
  std::string ids;
  for (const Cause c : d.not_visible) ids += fmt::format("{}{}", ids.empty() ? "" : ", ", text_of(c).id);
  return ids.empty() ? "" : "Not visible in this recording: " + ids + ".";
}

std::string limits_text(const PackDiagnosis& d) {
  std::string text;
  for (const PackLimit& l : d.detection_limits) text += (text.empty() ? "" : ", ") + limit_text(l);
  if (!text.empty()) text = "Smallest sizes that would be named: " + text + ".";
  const std::string hidden = not_visible_text(d);
  return text + (text.empty() || hidden.empty() ? "" : " ") + hidden;
}

std::string cells_text(const std::vector<std::size_t>& cells) {
  if (cells.size() > 2 && cells.back() - cells.front() + 1 == cells.size())
    return fmt::format("{} to {}", cells.front() + 1, cells.back() + 1);
  std::string text;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    if (k > 0) text += k + 1 == cells.size() ? " and " : ", ";
    text += fmt::format("{}", cells[k] + 1);
  }
  return text;
}

std::string confirmation_of(const Channels& channels, const std::vector<std::size_t>& cells) {
  std::vector<double> fresh, stale;
  for (const std::size_t c : cells) {
    fresh.push_back(channels.cells[c].fresh_ohm);
    stale.push_back(channels.cells[c].stale_ohm);
  }
  std::string text =
      fmt::format("At steps of the current, a reading that has just changed shows {:.2f} mohm, all others {:.2f} mohm.",
                  1e3 * measurement::median(fresh), 1e3 * measurement::median(stale));
  if (channels.pack_ohm)
    text += fmt::format(
        " The pack's own voltmeter shows {:.2f} mohm a cell in every row: it confirms that the cells' "
        "readings are old, not the cells slow.",
        1e3 * *channels.pack_ohm);
  return text;
}

std::string statement_of(const PackDiagnosis& d) {
  std::string text;
  for (const PackFinding& f : d.findings) text += (text.empty() ? "" : " ") + sentence_of(f);
  if (d.verdict == Verdict::ambiguous)
    text += " This recording cannot distinguish some of these causes from others; see what else it could be.";
  for (const UnexplainedCell& u : d.unexplained)
    text += fmt::format(
        "{}Cell {} differs from its neighbours by {:.1f} mV RMS, usual are {:.1f} mV, and none of the "
        "known causes explains it.",
        text.empty() ? "" : " ", u.cell + 1, 1e3 * u.rms_v, 1e3 * u.usual_v);
  if (!text.empty()) return text;
  return fmt::format("The {} cells agree with each other within what healthy cells of this pack show.", d.cells);
}

}  // namespace bms::diagnosis::pack
