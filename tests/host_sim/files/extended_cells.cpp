// Cell files with one to four mechanisms of random strengths within their bounds.
//
//   extended_cells SEED FILE.toml
//
// Prints the mechanisms. The base is one of three built-in cells; every mechanism of the catalogue is drawn.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "files/cell_file.hpp"
#include "files/text_file.hpp"
#include "model/catalogue.hpp"
#include "model/extended.hpp"

namespace {

using bms::model::Parameter;

double draw(const Parameter& p, double neutral, double capacity_ah, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(0, 1);
  constexpr double longest_given = 1e6;  // a time of onset may be anywhere; here it is in the recording
  const double low = std::max(p.lower(capacity_ah), -longest_given), high = p.upper(capacity_ah);
  if (high > longest_given) return 3'600 * uniform(random);
  // small strengths as often as large ones
  const double end = uniform(random) < 0.5 && low < neutral ? low : high, share = std::pow(uniform(random), 2);
  return std::clamp(neutral + share * (end - neutral), low, high);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  std::mt19937_64 random(std::strtoull(argv[1], nullptr, 10));
  constexpr std::array bases = {"table9", "a123_26650", "nmc_lg_m50"};
  bms::files::CellFile cell = bms::files::read_cell(bases[random() % bases.size()]);
  cell.name = "extended";
  const std::size_t count = 1 + random() % 4;
  for (std::size_t n = 0; n < count; ++n) {
    bms::model::MechanismSetting setting =
        bms::model::default_setting(random() % bms::model::mechanism_count, cell.parameters);
    const bms::model::MechanismInfo& info = bms::model::catalogue[setting.index];
    for (std::size_t k = 0; k < info.parameters; ++k) {
      const Parameter& p = info.parameter[k];
      if (!p.is_reference_temperature)
        setting.value[k] = draw(p, setting.value[k], cell.parameters.capacity_ah, random);
    }
    bms::files::put_mechanism(cell, setting);
  }
  for (const auto& m : cell.mechanisms) std::printf("%s ", std::string(bms::model::catalogue[m.index].id).c_str());
  bms::files::write_file(argv[2], bms::files::cell_text(cell));
  return 0;
}
