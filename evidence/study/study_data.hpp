// Data sets of the study: experiments run on a simulated cell, and parts of them.
//
// The simulated cell is the plant (evidence/plant/), whose circuit is the paper's. On request it also has what the
// paper's equations leave out: hysteresis and a slow polarisation. Both are written here from their differential
// equations, independent of model/, which the diagnosis uses:
//
//   dh/dt = decay |I| / (3600 C_n) (sgn I - h)        du/dt = (R_slow I - u) / tau_slow        V += half_gap h + u
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "identification/data.hpp"
#include "identification/ocv_rest_test.hpp"

namespace bms::study {

/// A data set, and the states of charge that it covers.
struct StudyData {
  std::string name;
  identification::Data data;
  double soc_from = 0;              ///< at the start
  double soc_min = 1, soc_max = 0;  ///< of all samples
  double middle_soc() const { return (soc_min + soc_max) / 2; }
};

/// What the equations of the paper leave out. Zero: not there.
struct LeftOut {
  double half_gap_v = 0;
  double decay = 40;  ///< a charge of C_n / decay covers 63 % of the way from one branch to the other
  double slow_ohm = 0, slow_s = 1'200;
};

/// A simulated cell, its instruments, and the currents of the experiments, which the paper does not publish.
struct Bench {
  LeftOut left_out;
  double start_branch = 0;  ///< h at the start of pulse experiments: -1 after a discharge, 0 in the middle
  double r0_factor = 1, r1_factor = 1, c1_factor = 1;
  double short_c_rate = 1;  ///< of pulses with rests (Fig. 10)
  double long_c_rate = 1;   ///< HIGH current of the bursts (Fig. 11)
  double low_share = 0.25;  ///< LOW over HIGH
  double ocv_c_rate = 1;    ///< of the pulses of the OCV test (Fig. 4)
  double voltage_noise_v = 0.001, current_noise_a = 0.010, current_offset_a = 0;
  double pulse_step_s = 1, ocv_step_s = 1;  ///< sampling
};

/// Runs of the plant by itself, without what the equations leave out and without noise. Benches that differ in nothing
/// else share them. Not for several threads at once.
class PlantRuns {
 public:
  struct Row {
    double time_s = 0, current_a = 0, soc = 0, voltage_v = 0;
  };
  using Run = std::shared_ptr<const std::vector<Row>>;

  /// The run of this key; computed once.
  template <class Compute>
  Run of(const std::string& name, const std::vector<double>& numbers, const Compute& compute) {
    Run& run = runs_[{name, numbers}];
    if (!run) run = std::make_shared<const std::vector<Row>>(compute());
    return run;
  }

 private:
  std::map<std::pair<std::string, std::vector<double>>, Run> runs_;
};

/// Runs an experiment (evidence/experiments/experiment.hpp) on the simulated cell, until its SOC falls below stop_soc.
StudyData run_on_bench(const std::string& experiment, double soc_from, const Bench& bench, std::uint64_t seed,
                       double stop_soc = -1, PlantRuns* runs = nullptr);

/// An OCV test from full to empty, and back if asked for, in `steps` steps each way, with ten minutes of rest after
/// each.
StudyData run_ocv_test(int steps, const Bench& bench, std::uint64_t seed, bool and_back, PlantRuns* runs = nullptr);

/// A current of one's own, sampled every second: the mean of each second.
StudyData run_currents(const std::string& name, const std::vector<double>& current_a, double soc_from,
                       const Bench& bench, std::uint64_t seed);

/// A current that alternates between two levels, between leading and trailing rests of a minute. Times need not be
/// whole seconds.
struct TwoLevels {
  double first_a = 0, first_s = 0, second_a = 0, second_s = 0, duration_s = 0;
};
StudyData run_two_levels(const std::string& name, const TwoLevels& levels, double soc_from, const Bench& bench,
                         std::uint64_t seed, PlantRuns& runs);

/// The discharging half of an OCV test between two states of charge, counted with the nominal capacity.
StudyData window(const StudyData& whole, const std::string& name, double high_soc, double low_soc);

/// The OCV of the simulated cell in the middle between its branches.
double true_ocv_v(double soc);

}  // namespace bms::study
