// The pack that a board under test measures: cells in series, contactors, DC link and sensors. The true values and the
// readings are separate, so that the messages of the board can be judged.
//
//   cells     model/extended.hpp in double precision; capacity and state of charge of each cell are drawn from a seed
//   DC link   capacitance of the load: charges through the pre-charge resistor, follows the pack while both main
//             contactors are closed, and discharges otherwise
//   sensors   white noise; their faults are injected by host_sim/hil/injection.hpp
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "files/cell_file.hpp"
#include "measurement/pack_sample.hpp"
#include "model/extended.hpp"
#include "plant/link_poles.hpp"

namespace bms::hil {

inline constexpr std::size_t max_cells = 32;

/// Standard deviations, between the cells and of the sensors' noise.
struct PackSpread {
  std::uint32_t seed = 1;
  double soc = 0.01, capacity = 0.01;  ///< fractions
  double voltage_noise_v = 0.001, current_noise_a = 0.01, temperature_noise_c = 0.05;
};

/// Which contactors the board commands to close, as in the message ContactorState.
struct ContactorCommand {
  bool main_plus = false, main_minus = false, precharge = false;

  /// Returns true if load current can flow. `welded`: main+ does not open.
  constexpr bool conducts(bool welded) const { return (main_plus || welded) && main_minus; }
  constexpr bool connects_plus(bool welded) const { return main_plus || precharge || welded; }
};

/// DC-link voltage after `duration_s` with these contactors.
double dc_link_voltage_after(double dc_link_v, double pack_v, const ContactorCommand& closed, bool welded,
                             double duration_s);

class SimulatedPack {
 public:
  SimulatedPack(const files::CellFile& cell, std::size_t cells, double initial_soc, const PackSpread& spread);

  /// Simulates `duration_s`. `demand_a`, the current of load or charger (> 0 charges), flows only while the contactors
  /// conduct. `welded`: main+ does not open.
  void run(double demand_a, const ContactorCommand& closed, bool welded, double temperature_c, double duration_s);

  double current_a() const { return current_a_; }
  double dc_link_v() const { return dc_link_v_; }
  double soc() const;  ///< mean of the cells
  double voltage_v(std::size_t cell) const { return voltage_v_[cell]; }
  double pack_v() const;
  std::size_t cells() const { return simulations_.size(); }

  /// Readings with sensor noise. Cells that the pack does not have stay without a reading.
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
