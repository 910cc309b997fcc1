// Physical causes of the published protections: what has to happen at a cell, the shunt, a sensor, a wire or the front
// end.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/firmware/world/operating.hpp"
#include "tests/firmware/world/promise.hpp"

namespace bms::world {

/// Sets the quantity of a row to a value.
using SetQuantity = std::function<void(TruckWorld&, double)>;

/// How the quantity of a row is set, or nothing if the row has no such quantity.
SetQuantity actuator_of(const Row& row);

/// What holds for longer than a moment, for rows without a quantity.
struct Cause {
  unsigned bit;
  std::string name;
  std::function<void(TruckWorld&)> happens;
  double within_s;         ///< until the fault must be published, without the delay of its row
  bool blind = false;      ///< the front end does not measure any more
  std::uint64_t also = 0;  ///< faults that may follow from the same cause
  std::function<void(TruckWorld&)> each_second = {};
  bool needs_current = false;   ///< has no effect while no current flows
  bool no_temperature = false;  ///< of any sensor: temperature lost then forbids charging
};
/// Of a pack of so many cells: more than 16 have two chips.
std::vector<Cause> other_causes(std::size_t cells);

/// A fault that is there before, while another one is caused.
struct Background {
  std::string name;
  std::function<void(TruckWorld&)> happens;
  std::uint64_t faults;  ///< that it may raise
};
std::vector<Background> backgrounds();

}  // namespace bms::world
