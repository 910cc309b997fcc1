// Two to four boards of stm32f405_80v at one DC link, each with the image of BMS_PARALLEL, its own cells and contactors
// (truck_world.hpp), and the bus between them at CAN2.
//
// Each world solves the whole circuit: its own battery in detail, the others by their Thevenin equivalent, and the same
// load. Worlds exchange these and the frames of the bus every 5 ms. The truck obeys the largest AllowedCurrent that it
// receives, as firmware/parallel/README.md says.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/firmware/charger_models.hpp"
#include "tests/firmware/world/operating.hpp"
#include "tests/firmware/world/truck_world.hpp"

namespace bms::world {

/// What a battery sends on the bus, read by the bits of firmware/can/parallel_bus.dbc.
struct SeenPresence {
  bool any = false;
  double at_ms = -1;
  unsigned state = 0, leader = 0, granted = 0;
  double open_circuit_v = 0, current_a = 0, discharge_a = 0, charge_a = 0;
};

/// 24 cells of a truck and the image for one battery of a group, with a profile of a charger.
const Pack& parallel_pack(const std::string& vehicle_profile = "none");

inline constexpr unsigned group_incomplete = 49;  ///< number of this fault
/// What firmware/parallel/README.md states: equalising current, true difference of the OCVs at a closing.
inline constexpr double most_equalising_a = 35, most_apart_v = 0.7;

/// Sets node and number in a service session. Returns true if the battery has taken them.
bool set_group(TruckWorld& world, std::int32_t node, std::int32_t batteries);

class Group {
 public:
  struct Battery {
    WorldSetup setup;
    std::int32_t node = 1, batteries = 2;  ///< in its flash
  };

  /// Batteries as they come from the workshop, before their first sample.
  explicit Group(const std::vector<Battery>& batteries, const std::string& vehicle_profile = "none");

  void run_ms(double ms);
  /// Returns the milliseconds until the condition holds, or a negative value.
  template <class Condition>
  double run_until(const Condition& holds, double within_ms) {
    for (double ms = 0; ms < within_ms; ms += slice_ms) {
      if (holds()) return ms;
      run_ms(slice_ms);
    }
    return holds() ? within_ms : -1;
  }
  std::size_t connected() const;
  void request(Request wanted);
  double allowed_discharge_a() const { return allowed_a().first; }
  double load_a() const { return load_a_; }  ///< < 0 recuperates
  /// True OCV of all cells of a battery.
  double open_circuit_v(std::size_t k) const;
  /// Draws nothing, withdraws the request, and waits until all are open.
  bool key_off();

  std::vector<std::unique_ptr<TruckWorld>> worlds;
  std::vector<bool> on_the_bus, powered;
  std::vector<SeenPresence> presence;
  double demand_a = 0;          ///< of the driver; < 0 recuperates. The truck draws what it is allowed of it
  double truck_follows_ms = 0;  ///< it obeys a limit so much later
  /// Largest magnitude of a battery's current while the truck draws nothing, and largest current over its own limit.
  double largest_equalising_a = 0, largest_use = 0;
  /// Largest current between the batteries if the load ended in this moment.
  double largest_sudden_a = 0;
  /// Longest time that a battery has been above 1.05 of the limit that it sends [ms].
  double longest_over_ms = 0;
  std::size_t joined = 0;  ///< closings of a battery next to another one
  /// Largest difference of the true OCVs at the closing of a battery next to another one [V].
  double largest_closing_difference_v = 0;
  double slice_ms = 5;
  /// On the truck's bus, and at the DC link through the charger contactors. nullptr: none.
  firmware::Charger* charger = nullptr;
  std::array<std::size_t, 4> to_charger{};  ///< frames for it that each battery has sent

 private:
  void pass_frames();
  void pass_sources();
  void watch();
  void watch_closing(std::size_t k);
  void watch_limit(std::size_t k);
  std::pair<double, double> allowed_a() const;  ///< discharge and charge
  double followed_a();
  double charger_a();

  std::vector<bool> was_connected_;
  std::vector<double> over_ms_;
  std::deque<std::pair<double, double>> allowed_before_;
  double load_a_ = 0, no_load_ms_ = 0;
};

/// State, faults and Presence of each battery, for a message.
std::string text_of(const Group& group);

}  // namespace bms::world
