// Loads of packs whose logs have slow rows: four kinds, with changes from one second to hours.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "benchmark/truth/random_functions.hpp"

namespace bms::benchmark::truth {

enum class PackLoad {
  shift,       ///< drives, brakes and lifts of seconds, with breaks
  road,        ///< stop and go, with braking back into the battery
  appliances,  ///< of a home: switched at random for seconds to hours, with sun by day
  pump         ///< on and off with a period of its own, next to a constant load
};
inline constexpr std::array all_pack_loads = {PackLoad::shift, PackLoad::road, PackLoad::appliances, PackLoad::pump};
std::string_view name_of(PackLoad load);

struct LoadRequest {
  PackLoad load = PackLoad::shift;
  double step_s = 0.1, duration_s = 28'800;
  double capacity_ah = 6, start_soc = 0.9, lowest_soc = 0.12, highest_soc = 0.95;
  double fastest_charge = 1, fastest_discharge = 2;  ///< C-rates
};

/// True currents [A]: a rest of minutes, then the load; at the lower end of the range a charge with rests around it.
std::vector<double> draw_load_a(const LoadRequest& request, plant::Random& random);

}  // namespace bms::benchmark::truth
