// Random current profiles within a range of SOC, and random ambient temperatures. No profile depends on the voltage.
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

/// A start SOC from which the profile covers enough of the OCV curve.
double draw_start_soc(Profile profile, plant::Random& random);

struct ProfileRequest {
  Profile profile = Profile::hppc;
  double step_s = 1;
  double capacity_ah = 6;  ///< for the range of SOC
  double start_soc = 0.9, lowest_soc = 0.04, highest_soc = 0.96;
  double duration_s = 14'400;
  double current_scale = 1;                            ///< factor on the discharge rates of drives and pulses
  double fastest_charge = 2, fastest_discharge = 5.5;  ///< C-rates
};

/// True currents [A]. The profile begins with a rest and lasts duration_s, or less if it has an end of its own.
std::vector<double> draw_current_a(const ProfileRequest& request, plant::Random& random);

enum class Ambient { constant, step_and_back, wave };

/// Temperature [degrees C] of the surroundings, starting at start_c. step_and_back changes by swing_k in a ramp, stays
/// and returns.
std::vector<double> draw_ambient_c(Ambient ambient, double start_c, double swing_k, std::size_t count,
                                   plant::Random& random);

}  // namespace bms::benchmark::truth
