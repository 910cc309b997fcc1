// Writes the generated tables of firmware/protection/README.md: protections and balancing. The cost on the board:
// tests/figures.
#include <cstdio>
#include <exception>
#include <numeric>
#include <string>

#include <fmt/format.h>

#include "files/committed_figures.hpp"
#include "protection/table_text.hpp"
#include "tests/firmware/protection/balancing_pack.hpp"

namespace bms::protection {
namespace {

std::string balancing_table() {
  std::string table =
      "| charging | cells to bleed | spread of soc at full charge, day 1 | day 6 | day 60 | charge bled in 60 days | "
      "of "
      "it in the last 10 |\n|---|---|---|---|---|---|---|\n";
  for (const Habit habit : {Habit::before_the_shift, Habit::after_the_shift}) {
    const auto row = [&](const char* what, const BleedRule& rule) {
      const BalancingFigures f = balance(pack_out_of_balance(1, 0.1), rule, 60, habit);
      const auto bled_ah = [&](int from) { return std::accumulate(f.bled_ah.begin() + from, f.bled_ah.end(), 0.0); };
      table += fmt::format("| {} | {} | {:.1f} % | {:.1f} % | {:.1f} % | {:.2f} Ah | {:.2f} Ah |\n",
                           habit == Habit::before_the_shift ? "just before the shift" : "right after the shift", what,
                           100 * f.spread.front(), 100 * f.spread[5], 100 * f.spread.back(), bled_ah(0), bled_ah(50));
    };
    row("none", [](const BalancedPack&, double) { return 0U; });
    row("by charge, sigma 0.2 %", ByCharge(0.002));
    row("by charge, sigma 0.5 %", ByCharge(0.005));
    row("5 mV above the lowest, at any voltage", ByVoltage(0));
    row("5 mV above the lowest, above 3.4 V", ByVoltage(3.4));
  }
  return table;
}

}  // namespace
}  // namespace bms::protection

int main() {
  using namespace bms;
  try {
    const std::string readme = BMS_SOURCE_DIR "/firmware/protection/README.md";
    files::replace_figures(readme, "table", protection::markdown(protection::protection_table(protection::forklift)));
    files::replace_figures(readme, "balancing", protection::balancing_table());
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "protection figures: {}\n", e.what());
    return 3;
  }
}
