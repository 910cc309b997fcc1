#include "tool/against.hpp"

#include <cmath>
#include <filesystem>
#include <future>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "hil/firmware_comparison.hpp"
#include "images/firmware_image.hpp"
#include "images/image_file.hpp"
#include "measurement/recording_checks.hpp"
#include "replay/can_log.hpp"
#include "reports/report_page.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

using Json = nlohmann::ordered_json;

struct Firmwares {
  std::string before_name, after_name;
  hil::FirmwareRun before, after;
  hil::FirmwareComparison comparison;
  std::string before_cell, after_cell;  ///< hashes of the cell files that the images are built with
};

/// h:mm:ss
std::string clock(double time_s) {
  const auto s = static_cast<long>(std::floor(time_s));
  return fmt::format("{}:{:02}:{:02}", s / 3'600, s / 60 % 60, s % 60);
}

/// The image itself, if it is one that runs in the loop: its CAN bus is hal/emulated/can_pipe.cpp.
std::filesystem::path checked_image(const std::string& path) {
  bool in_the_loop = false;
  try {
    in_the_loop = images::ImageFile(path).has_symbol("can_pipe.cpp");
  } catch (const std::runtime_error&) {
    throw files::BadInput(path, 1, "not a firmware image, expected an image for the loop (*_hil.elf), or a commit");
  }
  if (!in_the_loop)
    throw files::BadInput(path, 1,
                          "an image for the chip or of another kind, which cannot be given a log, expected the image "
                          "for the loop of the same build (*_hil.elf), or the commit that it was built from");
  return path;
}

/// name: a checkout, a commit, or empty for the present sources.
images::SourceTree sources_named(const std::string& name) {
  if (name.empty()) return images::present_sources();
  return std::filesystem::is_directory(name) ? images::sources_in(name) : images::sources_of_commit(name);
}

/// Hash of the cell file that an image is built with.
std::string cell_hash_of(const std::filesystem::path& image) {
  const images::ImageFile file(image);
  std::uint32_t hash = 0;
  const std::string bytes = file.at(file.symbol("image_cell_hash"), sizeof hash);
  for (std::size_t k = 0; k < bytes.size(); ++k) hash |= std::uint32_t{static_cast<unsigned char>(bytes[k])} << 8 * k;
  return fmt::format("{:08x}", hash);
}

/// name: an image, a checkout, a commit, or empty for the present sources.
std::filesystem::path image_of(const std::string& name, const AgainstOptions& options, const files::CellFile& cell,
                               std::size_t cells) {
  if (std::filesystem::is_regular_file(name)) return checked_image(name);
  const images::SourceTree sources = sources_named(name);
  return images::firmware_image(sources, options.board, cell, images::Image::hil, "none", cells);
}

measurement::Recording read_log(const AgainstOptions& options) {
  const bool foreign = !options.reading.dbc.empty() || !options.reading.format.empty();
  if (!foreign && replay::is_can_log(options.recording))
    return replay::read_can_log(options.recording).back().recording;
  return files::read_recording(options.recording, files::VoltageColumn::required, options.reading);
}

hil::SessionPlan plan_of(const AgainstOptions& options) {
  hil::SessionPlan plan;
  plan.cell = files::read_cell(options.cell);
  plan.replayed = true;
  plan.profile = read_log(options);
  print_read_as(options.output, plan.profile);
  measurement::compare_with_cell(plan.profile, plan.cell.parameters);
  refuse_contradiction(plan.profile);
  plan.cells = plan.profile.cell_voltage_v.size();
  if (plan.cells == 0) {
    plan.cells = images::board_cells(options.board);
    if (plan.cells > 1)
      plan.profile.warnings.push_back(
          {"cells_alike",
           fmt::format("the log has the voltage of one cell: all {} cells of the board read it", plan.cells)});
  }
  plan.sample_period_s = options.sample_period_s;
  for (const measurement::Warning& w : plan.profile.warnings) warn(options.recording + ": " + w.text);
  return plan;
}

/// A comparison of two batteries that are switched off would find no difference.
void refuse_open_contactors(const AgainstOptions& options, const hil::SessionResult& before) {
  if (before.driving_after_s) return;
  std::string faults;
  for (const hil::FaultEvent& f : before.faults) faults += (faults.empty() ? "" : ", ") + f.name;
  throw files::BadInput(options.recording, 1,
                        fmt::format("the present firmware does not close its contactors on this log{}, so nothing can "
                                    "be compared; expected the board's own --sample-s and a log of its cells",
                                    faults.empty() ? "" : " (" + faults + ")"));
}

Firmwares compute(const AgainstOptions& options, const hil::SessionPlan& plan) {
  const files::CellFile new_cell = options.new_cell.empty() ? plan.cell : files::read_cell(options.new_cell);
  Firmwares f;
  f.before_name = options.base.empty() ? "these sources" : options.base;
  f.after_name = options.firmware;
  const auto before = image_of(options.base, options, plan.cell, plan.cells),
             after = image_of(options.firmware, options, new_cell, plan.cells);
  f.before_cell = cell_hash_of(before);
  f.after_cell = cell_hash_of(after);
  const auto show = progress_on_stderr(1, [](double done, double left_s, const std::string&) {
    return fmt::format("both firmwares: {:.0f} %, {:.0f} s left", 100 * done, std::isfinite(left_s) ? left_s : 0);
  });
  auto first = std::async(std::launch::async,
                          [&] { return hil::run_firmware(*hil::emulated_link(options.board, before), plan, {}); });
  f.after = hil::run_firmware(*hil::emulated_link(options.board, after), plan, [&](double done) {
    if (show) show(done, "");
  });
  f.before = first.get();
  refuse_open_contactors(options, f.before.session);
  f.comparison = hil::compare(f.before, f.after);
  return f;
}

const hil::SignalDifference* find(const hil::FirmwareComparison& c, const std::string& message,
                                  const std::string& signal) {
  for (const hil::SignalDifference& d : c.signals) {
    if (d.message == message && d.signal == signal) return &d;
  }
  return nullptr;
}

std::string interval(const std::optional<hil::FaultEvent>& f) {
  if (!f) return "not published";
  return clock(f->raised_at_s) + (f->cleared_at_s ? " to " + clock(*f->cleared_at_s) : " to the end");
}

/// What a driver would notice, in sentences.
std::string consequences(const Firmwares& f) {
  const hil::FirmwareComparison& c = f.comparison;
  std::string text;
  if (const auto* soc = find(c, "PackState", "Soc"))
    text += fmt::format(" State of charge: up to {:.2f} % apart, most at {}.", soc->largest, clock(soc->largest_s));
  else
    text += " State of charge: no difference.";
  for (const auto& [signal, name] : {std::pair{"Discharge", "discharge"}, std::pair{"Charge", "charge"}}) {
    if (const auto* d = find(c, "AllowedCurrent", signal))
      text +=
          fmt::format(" Allowed {} current: up to {:.2f} A apart, most at {}.", name, d->largest, clock(d->largest_s));
  }
  text += c.faults.empty()
              ? " Faults: no difference."
              : fmt::format(" Faults: {} differ, the first is {} ({}; with the new firmware {}).", c.faults.size(),
                            c.faults.front().name, interval(c.faults.front().before), interval(c.faults.front().after));
  if (f.before.session.cut_off_at_s != f.after.session.cut_off_at_s) {
    const auto opened = [](const hil::FirmwareRun& run) {
      return run.session.cut_off_at_s ? "at " + clock(*run.session.cut_off_at_s) : std::string("not at all");
    };
    text += fmt::format(" Contactors open under the load of the log: {}, with the new firmware {}.", opened(f.before),
                        opened(f.after));
  }
  if (c.above_allowed_before_s != c.above_allowed_after_s)
    text += fmt::format(" The log is above the allowed current for {:.0f} s, with the new firmware for {:.0f} s.",
                        c.above_allowed_before_s, c.above_allowed_after_s);
  return text;
}

/// What the comparison does not cover.
std::string uncovered(const Firmwares& f) {
  const auto& cut_off_at_s = f.before.session.cut_off_at_s;
  if (!cut_off_at_s) return "";
  return fmt::format(
      " The present firmware opens its contactors at {} under the load of the log: what follows is the "
      "comparison of a battery without current.",
      clock(*cut_off_at_s));
}

std::string statement_of(const Firmwares& f) {
  const hil::FirmwareComparison& c = f.comparison;
  if (c.differences == 0)
    return fmt::format("No difference: {} and {} publish the same values at all {} samples of {}.", f.before_name,
                       f.after_name, c.samples, clock(f.before.session.duration_s)) +
           uncovered(f);
  std::string text = fmt::format(
      "With {} instead of {} the battery would behave differently on this log, first at {} "
      "({}).",
      f.after_name, f.before_name, clock(c.first->time_s), c.first->what);
  return text + consequences(f) + uncovered(f);
}

Json fault_json(const std::optional<hil::FaultEvent>& f) {
  if (!f) return nullptr;
  return {{"raised_at_s", f->raised_at_s}, {"cleared_at_s", f->cleared_at_s ? Json(*f->cleared_at_s) : Json()}};
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

std::string json_of(const AgainstOptions& options, const hil::SessionPlan& plan, const Firmwares& f,
                    const std::string& statement) {
  const hil::FirmwareComparison& c = f.comparison;
  Json signals = Json::array(), faults = Json::array(), warnings = Json::array();
  for (const hil::SignalDifference& d : c.signals) {
    signals.push_back({{"name", d.message + "." + d.signal},
                       {"unit", d.unit},
                       {"samples", d.samples},
                       {"first_s", d.first_s},
                       {"last_s", d.last_s},
                       {"largest", d.largest},
                       {"largest_at_s", d.largest_s},
                       {"before", number(d.before)},
                       {"after", number(d.after)}});
  }
  for (const hil::FaultDifference& d : c.faults)
    faults.push_back({{"name", d.name}, {"before", fault_json(d.before)}, {"after", fault_json(d.after)}});
  for (const measurement::Warning& w : plan.profile.warnings) warnings.push_back(w.id + ": " + w.text);
  const auto cut_off = [](const hil::FirmwareRun& run) {
    return run.session.cut_off_at_s ? Json(*run.session.cut_off_at_s) : Json();
  };
  return Json{{"command", "replay"},
              {"against", options.firmware},
              {"base", options.base.empty() ? Json() : Json(options.base)},
              {"board", options.board},
              {"cell", plan.cell.name},
              {"cell_hash", f.before_cell},
              {"against_cell_hash", f.after_cell},
              {"cells", plan.cells},
              {"samples", c.samples},
              {"duration_s", f.before.session.duration_s},
              {"differences", c.differences},
              {"first", c.first ? Json{{"time_s", c.first->time_s}, {"what", c.first->what}} : Json()},
              {"statement", statement},
              {"signals", signals},
              {"faults", faults},
              {"cut_off_at_s", {{"before", cut_off(f.before)}, {"after", cut_off(f.after)}}},
              {"above_allowed_s", {{"before", c.above_allowed_before_s}, {"after", c.above_allowed_after_s}}},
              {"warnings", warnings}}
             .dump(1) +
         "\n";
}

std::vector<files::PageTable> tables_of(const hil::FirmwareComparison& c) {
  std::vector<files::PageTable> tables;
  if (!c.faults.empty()) {
    files::PageTable faults{"faults", "Faults that differ", {"fault", "present firmware", "new firmware"}, {}, ""};
    for (const hil::FaultDifference& d : c.faults)
      faults.rows.push_back(
          {files::text_cell(d.name), files::text_cell(interval(d.before)), files::text_cell(interval(d.after))});
    tables.push_back(std::move(faults));
  }
  if (!c.signals.empty()) {
    files::PageTable signals{
        "signals",
        "Published values that differ",
        {"signal", "first at", "present firmware", "new firmware", "largest difference", "at", "samples"},
        {},
        "Values at the first difference. Not compared: the version, the free stack and the time that a sample takes."};
    for (const hil::SignalDifference& d : c.signals) {
      signals.rows.push_back({files::text_cell(d.message + "." + d.signal), files::text_cell(clock(d.first_s)),
                              files::text_cell(d.before_text), files::text_cell(d.after_text),
                              files::text_cell(fmt::format("{:.5g} {}", d.largest, d.unit)),
                              files::text_cell(clock(d.largest_s)), files::text_cell(fmt::format("{}", d.samples))});
    }
    tables.push_back(std::move(signals));
  }
  return tables;
}

/// One quantity of both firmwares.
files::PageChart chart_of(const char* title, const char* unit, const Firmwares& f, double scale,
                          double hil::TracePoint::*field) {
  files::PageChart chart{
      title, {fmt::format("present firmware, {}", unit), fmt::format("new firmware, {}", unit)}, {}, {{}, {}}};
  const auto &before = f.before.session.trace, &after = f.after.session.trace;
  for (std::size_t k = 0; k < std::min(before.size(), after.size()); ++k) {
    chart.time_s.push_back(before[k].time_s);
    chart.columns[0].push_back(scale * before[k].*field);
    chart.columns[1].push_back(scale * after[k].*field);
  }
  return chart;
}

std::string report_of(const AgainstOptions& options, const hil::SessionPlan& plan, const Firmwares& f,
                      const std::string& statement) {
  files::PageContent page{"Two firmwares on " + options.recording.substr(options.recording.rfind('/') + 1),
                          statement,
                          {},
                          tables_of(f.comparison),
                          {}};
  for (const measurement::Warning& w : plan.profile.warnings) page.warnings.push_back(w.text);
  page.charts = {chart_of("State of charge", "%", f, 100, &hil::TracePoint::soc),
                 chart_of("Allowed discharge current", "A", f, 1, &hil::TracePoint::allowed_discharge_a),
                 chart_of("Allowed charge current", "A", f, 1, &hil::TracePoint::allowed_charge_a),
                 chart_of("Current, > 0 charges", "A", f, 1, &hil::TracePoint::current_a)};
  return reports::page_of(page);
}

}  // namespace

int run_against(const AgainstOptions& options) {
  const hil::SessionPlan plan = plan_of(options);
  const Firmwares f = compute(options, plan);
  const std::string statement = statement_of(f);
  if (!options.output.json.empty()) write_output(options.output.json, json_of(options, plan, f, statement));
  if (!options.output.report.empty()) write_output(options.output.report, report_of(options, plan, f, statement));
  print_summary(options.output, statement);
  for (const hil::FaultDifference& d : f.comparison.faults)
    print_summary(options.output,
                  fmt::format("  {}: {}; with the new firmware {}", d.name, interval(d.before), interval(d.after)));
  if (!options.output.report.empty()) print_summary(options.output, "Report: " + options.output.report);
  return f.comparison.differences == 0 ? 0 : 1;
}

}  // namespace bms::tool
