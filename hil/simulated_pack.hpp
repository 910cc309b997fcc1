// The pack that a board under test believes it measures: cells in series by a cell file, no two alike, a load behind
// contactors, and the sensors. Truth and readings apart, so that what the board says can be judged.
//
//   cells     model/extended.hpp in double precision, each with its own capacity and state of charge, drawn from a seed
//   link      the load's capacitance: rises over the pre-charge resistor, follows the pack while both contactors are
//   closed, falls else sensors   white noise; what is broken of them: hil/injection.hpp
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "files/cell_file.hpp"
#include "measurement/pack_sample.hpp"
#include "model/extended.hpp"

namespace bms::hil {

inline constexpr std::size_t max_cells = 16;

struct PackSpread {
  std::uint32_t seed = 1;
  double soc = 0.01, capacity = 0.01;  ///< one sigma between cells
  double voltage_noise_v = 0.001, current_noise_a = 0.01, temperature_noise_c = 0.05;
};

/// What the contactors are told; as ContactorState on CAN.
struct ContactorCommand {
  bool main_plus = false, main_minus = false, precharge = false;

  /// Whether current can flow; welded: main+ does not open.
  constexpr bool conducts(bool welded) const { return (main_plus || welded) && main_minus; }
};

/// The link's voltage after a time with the contactors so.
double dc_link_voltage_after(double dc_link_v, double pack_v, const ContactorCommand& closed, bool welded,
                             double duration_s);

class SimulatedPack {
 public:
  SimulatedPack(const files::CellFile& cell, std::size_t cells, double initial_soc, const PackSpread& spread);

  /// demand_a: what load or charger would have; flows while both main contactors are closed. welded: main+ does not
  /// open.
  void run(double demand_a, const ContactorCommand& closed, bool welded, double temperature_c, double duration_s);

  double current_a() const { return current_a_; }
  double dc_link_v() const { return dc_link_v_; }
  double soc() const;  ///< mean of the cells
  double voltage_v(std::size_t cell) const { return voltage_v_[cell]; }
  double pack_v() const;
  std::size_t cells() const { return simulations_.size(); }

  /// As the sensors read it; of what a board has no sensor for, nothing.
  measurement::PackSample<max_cells> read(std::uint64_t time_us, double temperature_c);

 private:
  model::Cell<double, model::max_intervals> tables_;
  std::vector<model::OpenLoopSimulation<double>> simulations_;
  std::vector<double> voltage_v_;
  std::mt19937_64 random_;
  PackSpread spread_;
  double capacity_ah_, time_s_ = 0, current_a_ = 0, dc_link_v_ = 0;
};

}  // namespace bms::hil
