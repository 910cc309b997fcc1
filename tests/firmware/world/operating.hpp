// Packs, images and operating states of the truck for the scenarios.
#pragma once

#include <filesystem>
#include <string>

#include "tests/firmware/world/truck_world.hpp"

namespace bms::world {

/// Cells like table9 of another capacity: currents scale with it, resistances with its inverse.
struct Pack {
  double capacity_ah = 6, limit_a = 6;
  std::size_t cells = 16;
  std::filesystem::path image;
};
/// Builds the image of the forklift board, or of stm32f405_80v, for this pack, if it is not there yet.
Pack pack_of(double capacity_ah, std::size_t cells = 16, const std::string& vehicle_profile = "none");
/// The same with an insulation monitor at PA6.
Pack pack_with_insulation_monitor(std::size_t cells);
/// Cells of a small forklift, and the cell whose thresholds firmware/protection/README.md prints.
inline constexpr double truck_ah = 100, printed_ah = 6;

/// Components at random within their tolerances, with dividers of 0.1 %. The supply rail does not react to the coils.
WorldSetup random_setup(const Pack& pack, std::uint64_t seed);
/// Typical components, with a bleeder of 10 kohm, and half charged cells.
WorldSetup typical_setup(const Pack& pack, std::uint64_t seed = 1);

enum class Operating { off, standby, drive, recuperate, charge };
const char* name_of(Operating state);

inline constexpr double start_limit_ms = 20'000;
/// A closing of a main contact with this voltage across it counts as a closing on an empty DC link.
inline constexpr double closing_limit_v = 8;

/// Requests, and waits until the contacts are closed; then the current flows. Returns why it did not work, or "".
std::string bring_to(TruckWorld& world, const Pack& pack, Operating state);
/// Current of the drive [A]; > 0 recuperates.
void set_drive_a(TruckWorld& world, double current_a);
void set_charger_a(TruckWorld& world, double current_a);
/// Key off: the request ends at once, the drive and the charger 0.3 s later, and a load of `standby_a` goes on. Returns
/// the milliseconds until both main contacts are open, or a negative value.
double key_off(TruckWorld& world, double within_ms = 8'000, double standby_a = 0);

/// Published faults and closings in the wrong moment, for a message.
std::string summary(const TruckWorld& world);

}  // namespace bms::world
