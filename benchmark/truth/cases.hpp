// Concealed cases: a recording of a cell or an instrument that has something the cell file does not know, or has
// nothing at all.
//
// A case is made from (split, seed, index) alone, the same on one machine (libm), and no development case is a final
// case. The composition repeats every 20 cases: 6 nulls, 8 singles, 3 pairs, 2 outside the catalogue, 1 data fault;
// singles and the others go through all their effects evenly. Nothing here may come from model/, estimator/,
// identification/ or diagnosis/.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace bms::benchmark::truth {

/// What the maker of the cell file believed: a calibrated 1RC table (Table 9's form).
struct CalibratedCell {
  double capacity_ah = 0;
  std::vector<double> ocv_soc, ocv_b0_v,
      ocv_b1_v;  ///< b0[k] + b1[k] soc in [soc[k], soc[k+1]); rising, pieces meet within 1e-6 V
  std::vector<double> rc_soc, r0_ohm, r1_ohm, c1_f;
  double ocv_tolerance_v = 0.0015, resistance_tolerance = 0.02, initial_soc_tolerance = 0.005,
         drift_tolerance_v = 0.001;
};

/// As measured, but soc, which is true. current_a > 0 charges and is the mean over the interval that ends at time_s.
struct Series {
  std::vector<double> time_s, current_a, voltage_v, temperature_c /* may be empty */, soc;
  std::vector<double> terminal_v{};  ///< of an errand: at the cell's own terminals, true
};

inline constexpr std::array case_kinds = {"null", "single", "pair", "outside", "data_fault"};

struct Answer {
  std::string kind;               ///< one of case_kinds
  std::vector<std::string> ids;   ///< of the contract; outside the catalogue and for a data fault a short name
  std::vector<double> strengths;  ///< one per id, in detection limits (yardstick.hpp); empty for nulls and data faults
  double strength = 0;            ///< of the weaker one
  double start_s = 0, end_s = 0;  ///< hull of where the effect is above 20 % of its largest, in time ...
  double soc_from = 0, soc_to = 1;  ///< ... and in true soc
  double effect_rms_v = 0;          ///< of the voltage with less without, for the same measured current
  double noise_floor_v = 0;         ///< rms of what noise, drift and converter did to the voltage
  std::string profile;
  std::vector<double> amplitudes;  ///< one per id: the parameter that was scaled, in the unit of effects.hpp
};

/// What somebody drives a cell through on purpose. Columns of equal length.
struct TestPlan {
  double step_s = 1, start_soc = 0.95;
  std::vector<double> current_a;      ///< true; [0] is 0
  std::vector<double> ambient_c;      ///< NaN: as warm as the laboratory happens to be
  std::vector<double> source_v;       ///< what the voltage channel is connected to in place of the cell; NaN: the cell
  bool measures_temperature = false;  ///< even if the case's recording does not
};

struct Case {
  std::string name;  ///< says nothing about the answer
  CalibratedCell cell;
  double believed_initial_soc = 0, holdout_initial_soc = 0;  ///< the latter is true to 0.5 %
  Series recording, holdout;
  Answer answer;
  std::function<Series(const TestPlan&)>
      run_test;  ///< the same cell and instruments with the same effects, later; empty for data faults
};

enum class Split { development, final };

std::size_t case_count(Split split);
Case make_case(Split split, std::uint64_t seed, std::size_t index);

}  // namespace bms::benchmark::truth
