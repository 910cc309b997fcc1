// Cells with drawn parameters, and recordings of them.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "experiments/experiment.hpp"
#include "plant/truth_cell.hpp"

namespace bms::plant {

/// A cell between 2 and 400 Ah: circuit over SOC, LFP or NMC, and of some a hysteresis.
struct SimulatedCell {
  int number = 0;
  bool nmc = false;
  double half_gap_v = 0;  ///< of the hysteresis
  CellParameters parameters;
  std::array<double, 6> pulse_soc = {};  ///< at which its six pulse experiments begin

  double capacity_ah() const { return parameters.capacity_ah; }
  /// name: "r0_ohm", "r1_ohm", "c1_f".
  double truth(const std::string& name, double soc) const;
};

/// The same for the same number and family. Of every forty, twelve are NMC; numbers 5, 18 and 31 have a hysteresis.
SimulatedCell simulated_cell(int number, std::uint64_t family = 1);

/// The cell of Table 9 in another size.
SimulatedCell table9_of(double capacity_ah);

struct CoveredSoc {
  double low = 1, high = 0;
};

/// Writes a recording of a profile, which ends at the first rest below stop_soc. noisy: voltage and current have the
/// noise of an instrument.
CoveredSoc record(const SimulatedCell& of, const std::vector<bms::experiments::ProfileRow>& profile, double from_soc,
                  double stop_soc, bool noisy, std::uint64_t seed, const std::filesystem::path& file);

/// C/20 with an hour of rest before and after. direction: -1 discharge, 1 charge.
std::vector<bms::experiments::ProfileRow> slow_profile(double capacity_ah, double direction);

}  // namespace bms::plant
