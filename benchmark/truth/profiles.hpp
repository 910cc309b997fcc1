// What a cell is put through: true currents by chance, kept within a range of soc. Nothing is regulated by voltage.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "benchmark/truth/random_functions.hpp"

namespace bms::benchmark::truth {

enum class Profile {
  forklift_shift,
  drive_discharge,
  drive_two_way,
  hppc,
  full_cycle,
  minor_loops,
  multi_rate,
  many_cycles,
  storage
};
inline constexpr std::array all_profiles = {Profile::forklift_shift, Profile::drive_discharge, Profile::drive_two_way,
                                            Profile::hppc,           Profile::full_cycle,      Profile::minor_loops,
                                            Profile::multi_rate,     Profile::many_cycles,     Profile::storage};
std::string name_of(Profile profile);

/// Enough of the curve to begin with for this profile.
double draw_start_soc(Profile profile, plant::Random& random);

struct ProfileRequest {
  Profile profile = Profile::hppc;
  double step_s = 1;
  double capacity_ah = 6;  ///< for keeping within the range
  double start_soc = 0.9, lowest_soc = 0.04, highest_soc = 0.96;
  double duration_s = 14'400;
  double current_scale = 1;                            ///< times the discharge rates of drives and pulses
  double fastest_charge = 2, fastest_discharge = 5.5;  ///< C-rates
};

/// Begins with a rest; as long as duration_s or, where a programme has an end, shorter.
std::vector<double> draw_current_a(const ProfileRequest& request, plant::Random& random);

enum class Ambient { constant, step_and_back, wave };

/// Of the surroundings [degrees C], starting at start_c; step_and_back goes by swing_k in ramps, stays and returns.
std::vector<double> draw_ambient_c(Ambient ambient, double start_c, double swing_k, std::size_t count,
                                   plant::Random& random);

}  // namespace bms::benchmark::truth
