#include <cmath>

#include "benchmark/truth/packs.hpp"

namespace bms::benchmark::truth {

namespace {

void add(std::string& text, double value, int decimals) {
  if (!std::isfinite(value)) return;
  std::string digits = std::to_string(value);  // six decimals
  digits.resize(digits.size() - static_cast<std::size_t>(6 - decimals));
  text += digits;
}

}  // namespace

std::string csv_of(const PackSeries& s) {
  std::string text = "time_s,current_a";
  for (std::size_t c = 0; c < s.cell_v.size(); ++c) text += ",v_" + std::to_string(c + 1);
  for (std::size_t m = 0; m < s.sensor_c.size(); ++m) text += ",t_" + std::to_string(m + 1);
  text += s.pack_v.empty() ? "\n" : ",pack_voltage_v\n";
  for (std::size_t k = 0; k < s.time_s.size(); ++k) {
    add(text, s.time_s[k], 1);
    text += ',';
    add(text, s.current_a[k], 4);
    for (const auto& v : s.cell_v) add(text += ',', v[k], 5);
    for (const auto& t : s.sensor_c) add(text += ',', t[k], 2);
    if (!s.pack_v.empty()) add(text += ',', s.pack_v[k], 4);
    text += '\n';
  }
  return text;
}

}  // namespace bms::benchmark::truth
