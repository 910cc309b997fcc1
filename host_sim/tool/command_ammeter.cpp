// bms ammeter: what a log says about its current sensor, and the correction where users enter it.
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "ammeter/ammeter.hpp"
#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "measurement/recording_checks.hpp"
#include "reports/report_page.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

using Json = nlohmann::ordered_json;
using ammeter::Ammeter;
using ammeter::amperes;
using ammeter::SensorFinding;

struct AmmeterOptions {
  std::string recording, cell = "table9", open_contactors;
  std::optional<double> capacity_sigma;
  double clamp_v = 4, clamp_a = 100;  ///< nominal values of Battery-Emulator's clamp
  files::ReadOptions reading;
  Output output;
};

constexpr double most_offset_a = 5, most_gain = 0.05;  ///< that the firmware accepts (firmware/commands.hpp)

std::string offset_text(const SensorFinding& f) {
  if (!f.value) return f.why;
  return fmt::format("reads {} +- {} too {}{}", amperes(std::abs(f.value->value)), amperes(f.value->std),
                     f.value->value < 0 ? "low" : "high", f.why.empty() ? "" : ", " + f.why);
}

std::string balance_text(const Ammeter& a) {
  const SensorFinding& f = a.balance_a;
  if (!f.value) return f.why;
  if (ammeter::balance_of(a) == ammeter::Balance::balanced)
    return fmt::format("balanced to {} +- {}", amperes(f.value->value), amperes(f.value->std));
  return fmt::format("{} by {} +- {}", f.value->value > 0 ? "short" : "over", amperes(std::abs(f.value->value)),
                     amperes(f.value->std));
}

std::string gain_text(const SensorFinding& f) {
  if (!f.value) return f.why;
  return fmt::format("reads {:.2f} +- {:.2f} % too {}", 100 * std::abs(f.value->value), 100 * f.value->std,
                     f.value->value < 0 ? "little" : "much");
}

std::string dead_band_text(const SensorFinding& f) {
  if (!f.value) return f.why;
  return fmt::format("reads 0 below {:.3g} +- {:.1g} A, {}", f.value->value, f.value->std, f.why);
}

std::string clipping_text(const SensorFinding& f) {
  return f.value ? fmt::format("at {:.4g} A: {}", f.value->value, f.why) : f.why;
}

/// A line for each place where a correction is entered.
std::vector<std::pair<std::string, std::string>> corrections_of(const AmmeterOptions& o, const Ammeter& ammeter) {
  const ammeter::AmmeterCorrection c = ammeter::correction_of(ammeter);
  std::vector<std::pair<std::string, std::string>> lines;
  if (c.empty()) return lines;
  const bool confirmed = ammeter::balance_of(ammeter) == ammeter::Balance::by_sensor;
  if (c.offset_a != 0 && !ammeter.offset_a.why.empty() && !confirmed)
    lines.emplace_back("condition", ammeter.offset_a.why);
  if (std::abs(c.gain) > most_gain || std::abs(c.offset_a) > most_offset_a) {
    lines.emplace_back("this firmware",
                       "none: more than 5 % or 5 A is a wrong part, not a tolerance; replace the sensor");
  } else {
    if (c.offset_a != 0)
      lines.emplace_back("this firmware",
                         fmt::format("bms service can0 current-offset --value {:.0f} --key FILE", 1e6 * c.offset_a));
    if (c.gain != 0)
      lines.emplace_back("this firmware",
                         fmt::format("bms service can0 current-gain --value {:.0f} --key FILE", 1e6 * c.gain));
  }
  const double end_a = std::ceil(1.5 * ammeter.largest_reading_a);
  lines.emplace_back("dbus-serialbattery, config.ini",
                     fmt::format("CURRENT_REPORTED_BY_BMS = {:.0f}, 0, {:.0f}", -end_a, end_a));
  lines.emplace_back("dbus-serialbattery, config.ini", fmt::format("CURRENT_MEASURED_BY_USER = {:.3f}, {:.3f}, {:.3f}",
                                                                   c.of(-end_a), c.of(0), c.of(end_a)));
  // its current is (pin voltage - offset) * nominal current / nominal voltage
  if (c.offset_a != 0)
    lines.emplace_back("Battery-Emulator, CT clamp",
                       fmt::format("change the offset by {:+.1f} mV (clamp of {:g} V at {:g} A)",
                                   -1e3 * c.offset_a / (1 + c.gain) * o.clamp_v / o.clamp_a, o.clamp_v, o.clamp_a));
  if (c.gain != 0)
    lines.emplace_back("Battery-Emulator, CT clamp", fmt::format("multiply the nominal current by {:.4f}", 1 + c.gain));
  return lines;
}

/// What may be the cause of a charge balance that is off, if it is not the sensor.
std::string cell_causes(const Ammeter& a) {
  return a.balance_a.value->value > 0
             ? "the cell loses it (leakage, internal short circuit), or its capacity is less than that of the cell file"
             : "the capacity of the cell is another than that of the cell file";
}

/// Of a balance that is off, and no reading without current that explains it.
std::string undecided_text(const Ammeter& a, const std::string& recording) {
  std::string text = fmt::format("The charge balance is {}: the sensor reads that much too {}, or {}.", balance_text(a),
                                 a.balance_a.value->value > 0 ? "high" : "low", cell_causes(a));
  if (a.offset_a.value) text += fmt::format(" At rest the sensor {}.", offset_text(a.offset_a));
  return text + fmt::format(
                    " Before anything is corrected, record the sensor for ten minutes with the contactors open, then: "
                    "bms ammeter {} --open-contactors FILE",
                    recording);
}

std::string statement_of(const AmmeterOptions& o, const Ammeter& a) {
  if (!a.silent.empty()) return fmt::format("The sensor is not always read: {}.", a.silent);
  if (a.clipping_a.value) return fmt::format("The current sensor is clipped {}.", clipping_text(a.clipping_a));
  const ammeter::Balance balance = ammeter::balance_of(a);
  if (balance == ammeter::Balance::undecided) return undecided_text(a, o.recording);
  if (balance == ammeter::Balance::by_cell)
    return fmt::format(
        "The charge balance is {}, but with {} the sensor {}. So {}. Do not correct the sensor for it; "
        "bms diagnose names the cause.",
        balance_text(a), a.open_contactors ? "open contactors" : "no load", offset_text(a.offset_a), cell_causes(a));
  if (!a.offset_a.value) {
    if (balance == ammeter::Balance::balanced) return fmt::format("The charge is {}: no correction.", balance_text(a));
    return "This log does not show the offset of the current sensor: " + a.offset_a.why + ".";
  }
  std::string text = fmt::format("The current sensor {}", offset_text(a.offset_a));
  if (balance == ammeter::Balance::by_sensor) text += "; the charge balance shows the same";
  if (a.gain.value) text += fmt::format("; it {}", gain_text(a.gain));
  text += ".";
  if (ammeter::correction_of(a).empty()) text += " That is within two standard deviations: no correction.";
  return text;
}

const char* name_of(ammeter::Balance balance) {
  switch (balance) {
    case ammeter::Balance::missing:
      return "missing";
    case ammeter::Balance::balanced:
      return "balanced";
    case ammeter::Balance::by_sensor:
      return "by_sensor";
    case ammeter::Balance::by_cell:
      return "by_cell";
    case ammeter::Balance::undecided:
      return "undecided";
  }
  return "";
}

Json finding_json(const SensorFinding& f) {
  return {{"value", f.value ? Json(f.value->value) : Json()},
          {"std", f.value ? Json(f.value->std) : Json()},
          {"why", f.why}};
}

std::string json_of(const AmmeterOptions& o, const measurement::Recording& recording, const Ammeter& a) {
  Json corrections = Json::array(), warnings = Json::array();
  for (const auto& [where, what] : corrections_of(o, a)) corrections.push_back({{"where", where}, {"what", what}});
  for (const measurement::Warning& w : recording.warnings) warnings.push_back(w.id + ": " + w.text);
  const ammeter::AmmeterCorrection c = ammeter::correction_of(a);
  return Json{{"command", "ammeter"},
              {"statement", statement_of(o, a)},
              {"by", a.by_reference ? "reference" : "cell"},
              {"offset_a", finding_json(a.offset_a)},
              {"balance_a", finding_json(a.balance_a)},
              {"balance", name_of(ammeter::balance_of(a))},
              {"gain", finding_json(a.gain)},
              {"dead_band_a", finding_json(a.dead_band_a)},
              {"clipping_a", finding_json(a.clipping_a)},
              {"silent", a.silent.empty() ? Json() : Json(a.silent)},
              {"missed_a", a.missed_a},
              {"residual_v", a.residual_v ? Json(*a.residual_v) : Json()},
              {"correction", {{"gain", c.gain}, {"offset_a", c.offset_a}}},
              {"enter", corrections},
              {"warnings", warnings}}
             .dump(1) +
         "\n";
}

std::vector<std::pair<std::string, std::string>> findings_of(const Ammeter& a) {
  std::vector<std::pair<std::string, std::string>> found = {{"offset", offset_text(a.offset_a)},
                                                            {"gain", gain_text(a.gain)},
                                                            {"dead band", dead_band_text(a.dead_band_a)},
                                                            {"clipping", clipping_text(a.clipping_a)}};
  if (!a.silent.empty()) found.emplace_back("reads 0", a.silent);
  if (!a.by_reference) found.insert(found.begin(), {"charge", balance_text(a)});
  return found;
}

std::string report_of(const AmmeterOptions& o, const measurement::Recording& recording, const Ammeter& a) {
  files::PageContent page{
      "Current sensor of " + recording.path.substr(recording.path.rfind('/') + 1), statement_of(o, a), {}, {}, {}};
  const auto table = [&](const char* id, const char* title, const char* first, const char* second, const auto& lines,
                         const char* note) {
    files::PageTable t{id, title, {first, second}, {}, note};
    for (const auto& [name, text] : lines) t.rows.push_back({{name, {}, {}}, {text, {}, {}}});
    page.tables.push_back(std::move(t));
  };
  table("findings", "What the log shows", "error", "size", findings_of(a),
        "A reading is (1 + gain) x current + offset. One standard deviation after +-.");
  if (const auto lines = corrections_of(o, a); !lines.empty())
    table("corrections", "Correction", "where", "what", lines,
          "Corrections that were set when the log was recorded must be added to these.");
  for (const measurement::Warning& w : recording.warnings) page.warnings.push_back(w.text);
  page.charts.push_back(
      {"Current as read, > 0 charges", {"measured, A"}, recording.time_s.copy(), {recording.current_a.copy()}});
  return reports::page_of(page);
}

class AmmeterCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "ammeter",
        "Find offset, gain, dead band and clipping of the current sensor of a log, and print the correction");
    c.footer("Example: bms ammeter evidence/recordings/forklift_shift.csv --cell table9");
    c.add_option("recording", o_.recording,
                 "log with current_a and voltage_v of a cell that the cell file describes, or with current_ref_a of a "
                 "trusted meter")
        ->required();
    c.add_option("--cell", o_.cell, cell_help())->capture_default_str();
    c.add_option("--open-contactors", o_.open_contactors,
                 "log of the same sensor while no current can flow: it distinguishes an offset of the sensor from a "
                 "leakage of the cell")
        ->type_name("FILE");
    c.add_option("--capacity-sigma", o_.capacity_sigma,
                 "standard deviation of the capacity in the cell file, as a fraction, if another instrument than the "
                 "log's measured it; without it the gain is not visible")
        ->check(Within(0, 0.5));
    c.add_option("--clamp-v", o_.clamp_v, "Battery-Emulator: nominal voltage of its current clamp")
        ->check(Within(0.01, 100))
        ->capture_default_str();
    c.add_option("--clamp-a", o_.clamp_a, "Battery-Emulator: nominal current of its current clamp")
        ->check(Within(0.01, 10'000))
        ->capture_default_str();
    add_reading(c, o_.reading);
    add_output(c, o_.output);
    return &c;
  }

  int run() override {
    complete_reading(o_.reading);
    o_.output.protect({o_.recording, o_.cell, o_.open_contactors});
    const files::CellFile cell = files::read_cell(o_.cell);
    measurement::Recording recording = files::read_recording(o_.recording, files::VoltageColumn::required, o_.reading);
    print_read_as(o_.output, recording);
    measurement::compare_with_cell(recording, cell.parameters);
    refuse_contradiction(recording);
    for (const measurement::Warning& w : recording.warnings) warn(o_.recording + ": " + w.text);
    std::optional<measurement::Recording> open;
    if (!o_.open_contactors.empty())
      open = files::read_recording(o_.open_contactors, files::VoltageColumn::optional, o_.reading);
    const Ammeter ammeter = ammeter::examine_ammeter(recording, cell, o_.capacity_sigma, open ? &*open : nullptr);
    if (!o_.output.json.empty()) write_output(o_.output.json, json_of(o_, recording, ammeter));
    if (!o_.output.report.empty()) write_output(o_.output.report, report_of(o_, recording, ammeter));
    print(ammeter);
    return 0;
  }

 private:
  void print(const Ammeter& ammeter) const {
    print_summary(o_.output, statement_of(o_, ammeter));
    for (const auto& [name, text] : findings_of(ammeter))
      print_summary(o_.output, fmt::format("  {:<10} {}", name, text));
    for (const auto& [where, what] : corrections_of(o_, ammeter))
      print_summary(o_.output, fmt::format("{}: {}", where, what));
    if (!o_.output.report.empty()) print_summary(o_.output, "Report: " + o_.output.report);
  }

  AmmeterOptions o_;
};

}  // namespace

std::unique_ptr<Command> ammeter_command() { return std::make_unique<AmmeterCommand>(); }

}  // namespace bms::tool
