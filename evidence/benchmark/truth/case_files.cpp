#include "benchmark/truth/case_files.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <initializer_list>
#include <utility>
#include <vector>

namespace bms::benchmark::truth {

namespace {

std::string rounded(double value, int decimals) {
  std::array<char, 48> digits{};
  const auto written =
      std::to_chars(digits.data(), digits.data() + digits.size(), value + 0.0, std::chars_format::fixed, decimals);
  return {digits.data(), written.ptr};
}

/// As many digits as distinguish the number from its neighbours, without an exponent.
std::string exact(double value) {
  std::array<char, 400> digits{};
  const auto written = std::to_chars(digits.data(), digits.data() + digits.size(), value, std::chars_format::fixed);
  std::string text(digits.data(), written.ptr);
  return text.find('.') == std::string::npos ? text + ".0" : text;
}

std::string list(const std::vector<double>& values) {
  std::string text = "[";
  for (double v : values) text += (text.size() > 1 ? ", " : "") + exact(v);
  return text + "]";
}

}  // namespace

std::string csv_of(const Series& series) {
  const bool warm = !series.temperature_c.empty();
  std::string text =
      warm ? "time_s,current_a,voltage_v,temperature_c,soc_ref\n" : "time_s,current_a,voltage_v,soc_ref\n";
  for (std::size_t k = 0; k < series.time_s.size(); ++k) {
    text += rounded(series.time_s[k], 2) + ',' + rounded(series.current_a[k], 4) + ',' +
            rounded(series.voltage_v[k], 5) + ',';
    if (warm) text += rounded(series.temperature_c[k], 2) + ',';
    text += rounded(series.soc[k], 6) + '\n';
  }
  return text;
}

std::string cell_toml(const CalibratedCell& cell, const std::string& name) {
  const double q = cell.capacity_ah;
  std::string text = "# Made by evidence/benchmark/truth: the cell file of a calibrated cell.\n";
  const auto table = [&](const char* title, const char* source,
                         std::initializer_list<std::pair<const char*, std::string>> entries) {
    text += std::string("\n[") + title + "]\nsource = \"" + source + "\"\n";
    for (const auto& [key, value] : entries) text += std::string(key) + " = " + value + "\n";
  };
  text += "name = \"" + name + "\"\nchemistry = \"LiFePO4\"\ncapacity_ah = " + exact(q) +
          "\nsource = \"a concealed case of the benchmark\"\n";
  table("limits", "usual for LiFePO4",
        {{"voltage_min_v", "2.0"},
         {"voltage_max_v", "3.65"},
         {"charge_current_max_a", exact(2 * q)},
         {"discharge_current_max_a", exact(std::min(10 * q, 2'000.0))},
         {"temperature_min_c", "-20.0"},
         {"temperature_max_c", "60.0"}});
  table("ocv", "simulated calibration",
        {{"soc", list(cell.ocv_soc)}, {"b0_v", list(cell.ocv_b0_v)}, {"b1_v", list(cell.ocv_b1_v)}});
  table("rc", "simulated calibration",
        {{"soc", list(cell.rc_soc)},
         {"r0_ohm", list(cell.r0_ohm)},
         {"r1_ohm", list(cell.r1_ohm)},
         {"c1_f", list(cell.c1_f)}});
  table("noise", "the benchmark's measuring chain",
        {{"voltage_v", "0.001"},
         {"model_v", "0.003"},
         {"model_correlation_s", "60.0"},
         {"v_rc_v", "0.002"},
         {"rest_v", "0.005"},
         {"current_a", exact(0.002 * q)},
         {"current_offset_a", exact(0.0005 * q)},
         {"current_offset_correlation_s", "3600.0"},
         {"current_unknown_a", exact(0.2 * q)}});
  table("tolerance", "errors of the simulated calibration",
        {{"ocv_v", exact(cell.ocv_tolerance_v)},
         {"resistance_fraction", exact(cell.resistance_tolerance)},
         {"initial_soc", exact(cell.initial_soc_tolerance)},
         {"drift_v", exact(cell.drift_tolerance_v)}});
  return text;
}

}  // namespace bms::benchmark::truth
