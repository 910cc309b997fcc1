// The components of battery, contactors and truck, and random ones within their tolerances.
//
// The values are those of the board's wiring table. What that table leaves open is chosen here and marked "chosen".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "plant/circuit/cell_string.hpp"
#include "plant/circuit/contactor.hpp"

namespace bms::plant {

/// The four contactors and relays in the order of their pins PC6 to PC9.
enum class Relay : std::size_t { main_plus, main_minus, precharge, charge };
constexpr std::size_t relays = 4;

/// From a node of the DC link to an analog pin: `upper` to the pin, `lower` to C0, `bias` to VDDA, a capacitor to C0.
struct Divider {
  double upper_ohm = 1e6, lower_ohm = 56e3, bias_ohm = 56e3, capacitance_f = 100e-9;
};

struct DcLinkParameters {
  double capacitance_f = 0.01, esr_ohm = 0.010;
  double bleeder_ohm = std::numeric_limits<double>::infinity();
  double start_v = 0;
  double idle_w = 0;                 ///< DC/DC converter
  double idle_from_v = 18;           ///< chosen: below it the DC/DC converter is off
  double lockout_v = 36;             ///< of the drive
  double recuperation_limit_v = 63;  ///< chosen: above it the drive stops to recuperate
};

struct ChargerParameters {
  double output_f = 1e-3;
  double output_ohm = 0.02;  ///< chosen
  double idle_v = 0;         ///< CH+ is held up at this voltage when the charger is idle
  double idle_a = 0.02;      ///< chosen: the current that holds it up
};

struct FrontEndInputs {
  double series_ohm = 10e3;
  double ld_ohm = 2e6, pack_ohm = 2e6;  ///< internal dividers
  double clamp_v = 0.5;                 ///< chosen: forward voltage of the diode from VSS
};

struct SupplyParameters {
  double vdda_v = 3.3;
  double coil_v = 12;
  double rail_ohm = 0;  ///< bad installation: VDDA falls by this times the part of the coil currents that is new
  double rail_recovery_s = 0.02;  ///< chosen: time in which the converter of the rail corrects for it
};

struct HallParameters {
  double gain = 1, supply_v = 5, offset_v = 0;  ///< offset at the output of the sensor
};

struct PrechargeResistor {
  double ohm = 50;
  double heat_capacity_j_per_k = 15, to_ambient_w_per_k = 0.3;  ///< chosen: a wire-wound resistor of 50 W class
  double ambient_c = 25;
};

/// To the frame of the truck, which is a node if a resistance is finite.
struct FrameLeaks {
  static constexpr double none = std::numeric_limits<double>::infinity();

  double string_ohm = none;                  ///< from a tap of the string of cells
  std::size_t cells_below = 0;               ///< the tap: this many cells are below it; all: the top of the string
  double plus_ohm = none, minus_ohm = none;  ///< from L+ and from L-: converters and motors

  bool any() const;
};

struct TruckParameters {
  std::vector<StringCell> cells = std::vector<StringCell>(16);
  MonotoneCurve ocv_v = table9_ocv_v();  ///< of each cell
  double fuse_ohm = 0.3e-3, shunt_ohm = 1e-4;
  double main_contact_ohm = 0.2e-3;  ///< of K1, K2 and K4
  double open_contact_ohm = 1e10;    ///< chosen; of all
  std::array<ContactorParameters, relays> relay = {};
  PrechargeResistor precharge = {};
  DcLinkParameters dc_link = {};
  ChargerParameters charger = {};
  FrontEndInputs front_end = {};
  Divider plus_divider = {}, minus_divider = {};
  SupplyParameters supply = {};
  std::array<HallParameters, 2> hall = {};
  FrameLeaks leaks = {};
  bool in_parallel = false;  ///< other batteries at the DC link: Truck::set_other_batteries()
  std::uint64_t seed = 1;    ///< of the times of the contactors
};

/// Typical values; the pre-charge relay is quicker than the contactors.
TruckParameters typical_world(std::size_t cells = 16);

struct WorldLimits {
  std::size_t cells = 16;
  double divider_tolerance = 0.01;
};
/// All tolerances of the wiring table drawn at random; the DC link holds any voltage from 0 to that of the battery.
TruckParameters random_world(std::uint64_t seed, const WorldLimits& limits = {});

}  // namespace bms::plant
