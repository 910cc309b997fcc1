// Instrument and contact faults of known size, put into a real recording.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "measurement/recording.hpp"

namespace bms::proof {

void put_voltage_offset(measurement::Recording& recording, double offset_v);
void put_current_offset(measurement::Recording& recording, double offset_a);
void put_current_gain(measurement::Recording& recording, double error);
/// The current never reads more than the limit.
void put_clipping(measurement::Recording& recording, double limit_a);
/// A contact resistance from a row on.
void put_contact(measurement::Recording& recording, double ohm, std::size_t first_row);
/// A contact resistance in bursts of 5 to 30 s with 1 to 7 minutes between them, as of a loose plug.
void put_contact_in_bursts(measurement::Recording& recording, double ohm);

/// A fault of the catalogue with three sizes. Sizes scale with the capacity where their unit is that of a current
/// (per Ah) or of a resistance (times Ah).
struct InjectedFault {
  std::string_view id;         ///< of the mechanism that is right
  std::array<double, 3> size;  ///< of its first parameter; of clipping: share of the largest current that is read
  void (*put)(measurement::Recording& recording, double size, double capacity_ah);
  double (*first_parameter)(double size, double capacity_ah);  ///< nullptr: the size is not compared
};

extern const std::array<InjectedFault, 8> injected_faults;

/// Returns true if a real instrument or contact can be that wrong: the first parameter is within its bounds. What is
/// beyond cannot be named.
bool is_within_bounds(const InjectedFault& fault, double size, double capacity_ah);

}  // namespace bms::proof
