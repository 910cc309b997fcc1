// The data that a battery has stored, collected from its frames: the last faults with the readings at that time, use,
// throughput, extremes, resets and CAN errors. The battery sends them in parts when it is asked (Command: stored data
// in firmware/can/greybox_bms.dbc).
//
// Part k below 16 is fault k, 0 the newest, in three frames. Part 16 + c is the number of resets of cause c, with one
// more frame in the first five. Part 23 + k is action k of a service session in two frames; older firmware has none. A
// fault that is stored meanwhile shifts the others; their numbers show it, and the
// faults are then collected again.
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "monitor/bus_state.hpp"

namespace bms::monitor {

inline constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

struct StoredFault {
  std::uint32_t code = 0;  ///< of the message StoredFault
  std::string name;        ///< "contactor welded"
  std::uint32_t time_s = 0;
  double soc = not_known, current_a = not_known;                          ///< fraction from 0 to 1; > 0 charges
  double cell_voltage_max_v = not_known, cell_voltage_min_v = not_known;  ///< NaN: not known, as all readings
  double temperature_max_c = not_known, temperature_min_c = not_known;
  /// Since 1970 UTC, if the battery's calendar clock was set; otherwise time_s is the time in operation.
  bool has_calendar_time() const { return time_s >= 946'684'800; }
};

/// What somebody has done in a service session.
struct StoredAction {
  std::uint32_t code = 0;                                       ///< of the message StoredAction; 0: none
  std::string name;                                             ///< "clear faults"
  std::uint32_t time_s = 0, operator_number = 0, argument = 0;  ///< time as that of a fault
};

struct StoredExtreme {
  double cell_voltage_v = not_known, temperature_c = not_known, current_a = not_known;
};

/// Name and number.
struct StoredCount {
  std::string name;
  double count = 0;
};

class StoredData {
 public:
  static constexpr std::size_t faults = 16, causes = 7, actions = 16, first_action = faults + causes,
                               parts = first_action + actions;

  /// message: what bus.receive() has returned. Returns true for a message of the stored data.
  bool receive(const BusState& bus, std::size_t message);

  bool complete() const { return !missing(); }
  /// All that firmware without service sessions has.
  bool complete_but_for_actions() const;
  struct Parts {
    std::size_t first = 0, count = 0;
  };
  /// From the first part that is not complete to the last one.
  std::optional<Parts> missing() const;
  std::size_t missing_parts() const;

  // Valid when complete().
  std::vector<StoredFault> stored_faults() const;    ///< oldest first
  std::vector<StoredAction> stored_actions() const;  ///< oldest first
  double fault_count = not_known;                    ///< of all faults so far
  double operating_s = not_known, cycles = not_known, charged_ah = not_known, discharged_ah = not_known;
  StoredExtreme lowest, highest;
  std::array<StoredCount, causes> resets;
  std::string can_state;
  std::vector<StoredCount> can_errors;

 private:
  struct Collected {
    StoredFault fault;
    std::uint32_t number = 0;
    std::bitset<3> frames;  ///< received
  };
  bool has(std::size_t part) const;
  bool receive_fault(const BusState& bus, std::string_view message);
  bool receive_action(const BusState& bus, std::string_view message);
  void receive_count(const BusState& bus);

  struct CollectedAction {
    StoredAction action;
    std::bitset<2> frames;  ///< received
  };
  std::array<Collected, faults> fault_;
  std::array<CollectedAction, actions> action_;
  std::optional<std::uint32_t> newest_;  ///< number of fault 0
  std::bitset<causes> counts_;
  std::bitset<5> others_;  ///< use, throughput, lowest, highest, CAN errors
};

/// A row for each fault, oldest first.
std::string csv_of(const StoredData& data);
/// One JSON object. source: where the data came from.
std::string json_of(const StoredData& data, const std::string& source);
/// Lines for a person.
std::string summary_of(const StoredData& data);

}  // namespace bms::monitor
