// Experiments by name: current profiles to apply to a cell. `bms experiment` writes them; the diagnosis asks which of
// them would distinguish two causes.
//
// A design is one function (designs.hpp) that builds a profile in multiples of the 1C current and whole seconds, and
// one line of the table in experiment.cpp. All designs are sampled alike: row k contains the mean current over the
// step_s that end at time_s, rounded to 1 mA, so the charge of a profile does not depend on the step. Row 0 at time 0
// is 0 A. A last incomplete step is left out.
//
// |current_a| <= capacity_ah, rounded up to the next mA: Table 2 of the paper, 1C continuous in both directions. The
// same name, options and seed give the same rows on every machine: integers for random numbers and time, plain IEEE
// arithmetic (no fused multiply-add) for the rest. No I/O.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

namespace bms::experiments {

/// State of the equipment in the interval that ends at time_s.
struct ProfileRow {
  double time_s;
  double current_a;                     ///< mean, > 0 charges
  double temperature_c = std::nan("");  ///< of the climate chamber; NaN: not controlled
  bool contactor_open = false;          ///< during the whole interval; the sensor then reads its own offset
  bool ammeter = false;                 ///< a trusted ammeter in series is read
  bool voltmeter = false;               ///< a trusted voltmeter on the cell's own terminals is read
  double source_v = std::nan("");       ///< at time_s the sense wires are on a source of this voltage; NaN: on the cell

  /// Known current, independent of the sensor: 0 with the contactor open, the set current with an ammeter, otherwise
  /// NaN.
  double current_ref_a() const {
    if (contactor_open) return 0;
    return ammeter ? current_a : std::nan("");
  }
};

struct ExperimentOptions {
  double capacity_ah = 6;    ///< the paper's cell; its 1C current scales every current of the profile
  std::uint64_t seed = 1;    ///< of designs with random parts
  double step_s = 1;         ///< rounded to milliseconds, at least one
  double high_c_rate = 1;    ///< amplitude of pulses, 0..1; not published in the paper
  double low_c_rate = 0.25;  ///< LOW current of high_*_low_*, 0..1
};

class ProfileBuilder;

struct Experiment {
  std::string_view name;
  std::string_view description;
  void (*build)(ProfileBuilder&);
  double start_soc = std::numeric_limits<double>::quiet_NaN();  ///< required initial SOC; NaN: any
  std::string_view instruction = {};  ///< to the technician: preparation and logging; empty: none
  double step_s = 1;                  ///< longest useful sampling step
};

const std::vector<Experiment>& experiments();

/// Null if there is no experiment of this name.
const Experiment* find_experiment(std::string_view name);

/// Empty if there is no experiment of this name.
std::optional<std::vector<ProfileRow>> experiment(std::string_view name, const ExperimentOptions& options = {});

}  // namespace bms::experiments
