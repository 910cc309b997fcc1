#include "host_sim/command_simulate.hpp"

#include <chrono>
#include <iterator>
#include <random>

#include <fmt/format.h>

#include "host_sim/bad_input.hpp"
#include "host_sim/cell_file.hpp"
#include "host_sim/gaussian_noise.hpp"
#include "host_sim/json_results.hpp"
#include "host_sim/recording.hpp"
#include "host_sim/report_page.hpp"
#include "host_sim/simulation.hpp"

namespace bms {

namespace {

std::string csv_of(const Recording& r, const std::vector<SimulatedRow>& rows, const SimulateOptions& options) {
  GaussianNoise noise(options.seed);
  std::string csv = "time_s,current_a,voltage_v,soc\n";
  csv.reserve(rows.size() * 48);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double current_a = r.current_a[k] + options.noise_a * noise.next(), voltage_v = rows[k].voltage_v + options.noise_v * noise.next();
    // digits below a nanovolt and a nanoampere carry nothing
    fmt::format_to(std::back_inserter(csv), "{},{:.10g},{:.10g},{:.10g}\n", r.time_s[k], current_a, voltage_v, rows[k].soc);
  }
  return csv;
}

}  // namespace

int run(const SimulateOptions& options) {
  const std::string& input = options.recording.empty() ? options.profile : options.recording;
  if (options.recording.empty() == options.profile.empty()) throw BadInput("bms simulate", 1, "one input needed, expected --recording or --profile");
  const CellFile cell_file = read_cell(options.cell);
  Recording recording = read_recording(input, options.recording.empty() ? VoltageColumn::optional : VoltageColumn::required);
  compare_with_cell(recording, cell_file.parameters);
  for (const Warning& warning : recording.warnings) warn(input + ": " + warning.text);

  const auto cell = model::prepare<double, model::max_intervals>(cell_file.parameters);
  const auto begin = std::chrono::steady_clock::now();
  const auto rows = simulate(cell, cell_file.parameters.capacity_ah, recording.time_s, recording.current_a, options.initial_soc);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  put(options.out, csv_of(recording, rows, options));

  SimulateResult result{cell_file.name, input, options.out, rows.size(), recording.duration_s(), options.initial_soc, rows.back().soc, rows.back().voltage_v,
                        static_cast<double>(rows.size()) / seconds, recording.warnings};
  if (!options.output.json.empty()) put(options.output.json, json_of(result));
  if (!options.output.report.empty()) {
    PageChart voltage{"Voltage, open loop", {"simulated, V"}, recording.time_s, {{}}}, current{"Current, charging up", {"A"}, recording.time_s, {recording.current_a}}, soc{"State of charge", {"%"}, recording.time_s, {{}}};
    if (!recording.voltage_v.empty()) voltage.labels.push_back("measured, V"), voltage.columns.push_back(recording.voltage_v);
    for (const SimulatedRow& row : rows) {
      voltage.columns[0].push_back(row.voltage_v);
      soc.columns[0].push_back(100 * row.soc);
    }
    put(options.output.report, page_of({"Simulation of " + input, "Cell " + cell_file.name + ", open loop.", {}, {}, {voltage, current, soc}}));
  }
  if (options.out != "-") {
    tell(options.output, fmt::format("{} rows in {}: from {:.1f} % to {:.1f} % in {:.2f} h.", rows.size(), options.out, 100 * options.initial_soc,
                                     100 * rows.back().soc, recording.duration_s() / 3600));
  }
  return 0;
}

}  // namespace bms
