// Experiments by name: what to drive a cell through, as numbers. Writing them to a file is tool/command_experiment's;
// which of them would tell two causes apart is asked by diagnosis/next_experiment.
//
// A design is one function in experiment.cpp that lays out a course, in multiples of the 1C current and whole seconds,
// and one line in the table there. Sampling is common to all: row k holds the mean current over the step_s that end at
// time_s, rounded to 1 mA, so the charge of a course does not depend on the step. Row 0, at time 0, is 0 A; a last step
// not filled is left out.
//
// |current_a| <= capacity_ah, rounded up to the next mA: Table 2 of the paper, 1C continuous either way. The same name,
// options and seed give the same rows on every machine: integers for chance and time, plain IEEE arithmetic (no fused
// multiply-add) for the rest. No I/O.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

namespace bms::experiments {

/// What the equipment does in the interval that ends at time_s.
struct ProfileRow {
  double time_s;
  double current_a;                     ///< mean, > 0 charges
  double temperature_c = std::nan("");  ///< of the climate chamber; NaN: as it comes
  bool contactor_open = false;          ///< all the while: what the current sensor reads is its own
  bool ammeter = false;                 ///< a trusted one in series, to be read
  bool voltmeter = false;               ///< a trusted one on the cell's own terminals, to be read
  double source_v =
      std::nan("");  ///< at time_s the voltage sense wires are on a reference source of this voltage; NaN: on the cell

  /// What is known of the current beside what the sensor reads: 0 with the contactor open, as set with an ammeter; else
  /// NaN.
  double current_ref_a() const { return contactor_open ? 0 : ammeter ? current_a : std::nan(""); }
};

struct ExperimentOptions {
  double capacity_ah = 6;    ///< the paper's cell; its 1C current scales every current of the course
  std::uint64_t seed = 1;    ///< for designs with chance in them
  double step_s = 1;         ///< rounded to milliseconds, at least one
  double high_c_rate = 1;    ///< amplitude of pulses; the paper does not publish its own. 0..1
  double low_c_rate = 0.25;  ///< of what LOW means in high_*_low_*. 0..1
};

class ProfileBuilder;

struct Experiment {
  std::string_view name;
  std::string_view description;
  void (*build)(ProfileBuilder&);
  double start_soc = std::nan("");    ///< where it wants to begin; NaN: wherever the cell is
  std::string_view instruction = {};  ///< to the technician: what to prepare and what to log; empty: run it
  double step_s = 1;                  ///< longest interval at which logging it makes sense
};

const std::vector<Experiment>& experiments();

/// nullptr when there is no experiment of that name.
const Experiment* find_experiment(std::string_view name);

/// Nothing when there is no experiment of that name.
std::optional<std::vector<ProfileRow>> experiment(std::string_view name, const ExperimentOptions& options = {});

}  // namespace bms::experiments
