#include "tool/command_simulate.hpp"

#include <charconv>
#include <chrono>
#include <iterator>
#include <random>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "host_sim/gaussian_noise.hpp"
#include "host_sim/simulation.hpp"
#include "measurement/recording_checks.hpp"
#include "reports/json_results.hpp"
#include "reports/report_page.hpp"

namespace bms::tool {

namespace {

std::string csv_of(const measurement::Recording& r, const std::vector<host_sim::SimulatedRow>& rows,
                   const SimulateOptions& options) {
  host_sim::GaussianNoise noise(options.seed);
  const bool temperature = !r.temperature_c.empty();  // what mechanisms followed goes along: a replay needs it
  std::string csv = temperature ? "time_s,current_a,voltage_v,soc,temperature_c\n" : "time_s,current_a,voltage_v,soc\n";
  csv.reserve(rows.size() * 48);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double current_a = r.current_a[k] + options.noise_a * noise.next(),
                 voltage_v = rows[k].voltage_v + options.noise_v * noise.next();
    // digits below a nanovolt and a nanoampere carry nothing
    fmt::format_to(std::back_inserter(csv), "{},{:.10g},{:.10g},{:.10g}", r.time_s[k], current_a, voltage_v,
                   rows[k].soc);
    if (temperature) fmt::format_to(std::back_inserter(csv), ",{}", r.temperature_c[k]);
    csv += '\n';
  }
  return csv;
}

bool bursts_unknown(const files::CellFile& file) {
  return std::any_of(file.mechanisms.begin(), file.mechanisms.end(),
                     [](const auto& m) { return model::catalogue[m.index].id == model::ContactIntermittent::id; });
}

/// "ID:param=value,..." as a cell file would have it.
model::MechanismSetting mechanism_of(const std::string& text, double capacity_ah) {
  const auto refuse = [&](const std::string& what) { throw files::BadInput("--with", 1, what); };
  const std::size_t colon = text.find(':');
  const std::string id = text.substr(0, colon);
  const std::size_t index = model::mechanism_index(id);
  if (index == model::mechanism_count) {
    std::string ids;
    for (const model::MechanismInfo& info : model::catalogue) ids += (ids.empty() ? "" : ", ") + std::string(info.id);
    refuse("no such mechanism '" + id + "', expected one of: " + ids);
  }
  if (colon == std::string::npos) refuse("'" + id + "' without parameters, expected ID:param=value,...");
  const model::MechanismInfo& info = model::catalogue[index];
  model::MechanismSetting setting = model::default_setting(index, capacity_ah);
  for (std::size_t at = colon; at < text.size();) {
    const std::size_t end = std::min(text.find(',', at + 1), text.size());
    const std::string part = text.substr(at + 1, end - at - 1);
    at = end;
    const std::size_t equals = std::min(part.find('='), part.size());
    const std::string name = part.substr(0, equals);
    std::size_t k = 0;
    while (k < info.parameters && info.parameter[k].name != name) ++k;
    if (k == info.parameters) {
      std::string names;
      for (std::size_t i = 0; i < info.parameters; ++i)
        names += (i == 0 ? "" : ", ") + std::string(info.parameter[i].name);
      refuse("no such parameter '" + name + "' of " + id + ", expected one of: " + names);
    }
    const char *first = part.data() + std::min(equals + 1, part.size()), *last = part.data() + part.size();
    const auto [stopped, error] = std::from_chars(first, last, setting.value[k]);
    if (first == last || stopped != last || error != std::errc{})
      refuse("no value of '" + name + "', expected " + name + "=NUMBER");
  }
  if (const std::size_t k = model::first_fault(setting, capacity_ah); k < info.parameters) {
    refuse(fmt::format("'{}' is out of range, expected {}", info.parameter[k].name,
                       files::range_of(info.parameter[k], capacity_ah)));
  }
  return setting;
}

}  // namespace

int run(const SimulateOptions& options) {
  const std::string& input = options.recording.empty() ? options.profile : options.recording;
  if (options.recording.empty() == options.profile.empty())
    throw files::BadInput("bms simulate", 1, "one input needed, expected --recording or --profile");
  files::CellFile cell_file = files::read_cell(options.cell);
  for (const std::string& mechanism : options.with)
    files::put_mechanism(cell_file, mechanism_of(mechanism, cell_file.parameters.capacity_ah));
  measurement::Recording recording = files::read_recording(
      input, options.recording.empty() ? files::VoltageColumn::optional : files::VoltageColumn::required);
  measurement::compare_with_cell(recording, cell_file.parameters);
  if (bursts_unknown(cell_file))
    recording.warnings.push_back(
        {"bursts_unknown", "contact_intermittent does not act: when its bursts are is not in a cell file"});
  for (const measurement::Warning& warning : recording.warnings) warn(input + ": " + warning.text);

  const auto cell = model::prepare<double, model::max_intervals>(cell_file.parameters);
  const auto begin = std::chrono::steady_clock::now();
  const auto rows = host_sim::simulate({.cell = cell,
                                        .capacity_ah = cell_file.parameters.capacity_ah,
                                        .mechanisms = cell_file.mechanisms,
                                        .time_s = recording.time_s,
                                        .current_a = recording.current_a,
                                        .temperature_c = recording.temperature_c,
                                        .initial_soc = options.initial_soc});
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  write_output(options.out, csv_of(recording, rows, options));

  reports::SimulateResult result{cell_file.name,
                                 input,
                                 options.out,
                                 rows.size(),
                                 recording.duration_s(),
                                 options.initial_soc,
                                 rows.back().soc,
                                 rows.back().voltage_v,
                                 static_cast<double>(rows.size()) / seconds,
                                 recording.warnings};
  if (!options.output.json.empty()) write_output(options.output.json, reports::json_of(result));
  if (!options.output.report.empty()) {
    files::PageChart voltage{"Voltage, open loop", {"simulated, V"}, recording.time_s, {{}}},
        current{"Current, charging up", {"A"}, recording.time_s, {recording.current_a}},
        soc{"State of charge", {"%"}, recording.time_s, {{}}};
    if (!recording.voltage_v.empty())
      voltage.labels.push_back("measured, V"), voltage.columns.push_back(recording.voltage_v);
    for (const host_sim::SimulatedRow& row : rows) {
      voltage.columns[0].push_back(row.voltage_v);
      soc.columns[0].push_back(100 * row.soc);
    }
    write_output(
        options.output.report,
        reports::page_of(
            {"Simulation of " + input, "Cell " + cell_file.name + ", open loop.", {}, {}, {voltage, current, soc}}));
  }
  if (options.out != "-") {
    print_summary(options.output,
                  fmt::format("{} rows in {}: from {:.1f} % to {:.1f} % in {:.2f} h.", rows.size(), options.out,
                              100 * options.initial_soc, 100 * rows.back().soc, recording.duration_s() / 3600));
  }
  return 0;
}

}  // namespace bms::tool
