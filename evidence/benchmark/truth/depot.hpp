// A synthetic depot: trucks with a battery each, a shorter shift a day, cells that age at a different pace, and four
// planted faults, each in a truck of its own:
//
//   contact_intermittent  a cell's connection opens in bursts, from day 12 on
//   current_offset        the current sensor drifts, by 0.15 to 0.25 % of 1C a day
//   capacity_change       a weak cell from the first day: 12 to 16 % of the capacity lost, resistance 25 to 35 % higher
//   leakage               a self-discharging cell: 0.5 to 0.9 % of its charge a day
//
// All cells of a truck are of one type with one cell file; capacities differ by 0.3 %, resistances by 1 %. The charger
// fills the pack every night, to where the OCV is steep, and does not balance. The resistance of a battery grows by
// 0.005 to 0.05 % a day, its capacity falls by a third of that. Everything follows from the seed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "benchmark/truth/cases.hpp"
#include "benchmark/truth/concealed_cell.hpp"
#include "benchmark/truth/laboratory.hpp"

namespace bms::benchmark::truth {

struct DepotSize {
  std::size_t trucks = 50, cells = 16, days = 30;
  double hours = 3, step_s = 2;  ///< of a shift
};

struct PlantedFault {
  std::size_t truck = 0;
  std::size_t cell = 0;       ///< from 0; of the current sensor: 0
  bool whole_truck = false;   ///< every cell's recording shows it
  std::string cause;          ///< id of the diagnosis' catalogue
  std::size_t onset_day = 0;  ///< from 0
  double size = 0;            ///< ohm; A a day; lost share of the capacity; lost share of the charge a day
};

class Depot {
 public:
  /// At least 5 trucks, so that one is healthy.
  Depot(const DepotSize& size, std::uint64_t seed);

  const std::vector<PlantedFault>& faults() const { return faults_; }
  /// The cell file of a truck.
  const CalibratedCell& cell_file(std::size_t truck) const { return trucks_[truck].file; }
  /// All of it is measured except soc.
  Series recording(std::size_t truck, std::size_t cell, std::size_t day) const;

 private:
  struct Truck {
    HealthyCell cell;
    CalibratedCell file;
    Laboratory lab;
    double resistance_per_day = 0, capacity_per_day = 0;
    std::uint64_t seed = 0;
  };
  const PlantedFault* fault(std::size_t truck, std::size_t cell, const char* cause) const;
  World world(std::size_t truck, std::size_t cell, std::size_t day) const;

  DepotSize size_;
  std::vector<Truck> trucks_;
  std::vector<PlantedFault> faults_;
};

}  // namespace bms::benchmark::truth
