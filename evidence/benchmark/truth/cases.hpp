// Concealed cases: a recording of a cell or an instrument with an effect that the cell file does not describe, or of a
// healthy one.
//
// A case follows from (split, seed, index) alone and is the same on one machine (libm, compiler). No development case
// is a final case. The composition repeats every 20 cases: 6 nulls, 8 singles, 3 pairs, 2 outside the catalogue, 1 data
// fault. Each kind goes through all its effects evenly. Nothing here may come from model/, estimator/,
// inference/identification/ or inference/diagnosis/.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace bms::benchmark::truth {

/// The cell file of the case: a calibrated 1RC table in the form of Table 9.
struct CalibratedCell {
  double capacity_ah = 0;
  /// b0[k] + b1[k] soc holds in [soc[k], soc[k+1]). The curve rises; pieces meet within 1e-6 V.
  std::vector<double> ocv_soc, ocv_b0_v, ocv_b1_v;
  std::vector<double> rc_soc, r0_ohm, r1_ohm, c1_f;
  double ocv_tolerance_v = 0.0015, resistance_tolerance = 0.02, initial_soc_tolerance = 0.005,
         drift_tolerance_v = 0.001;
};

/// Measured values, except soc, which is true. current_a > 0 charges; it is the mean over the interval that ends at
/// time_s.
struct Series {
  std::vector<double> time_s, current_a, voltage_v, temperature_c /* may be empty */, soc;
  std::vector<double> terminal_v{};  ///< of a test plan: true voltage at the cell's own terminals
};

enum class CaseKind { null, single, pair, outside, data_fault };
inline constexpr std::array case_kinds = {"null", "single", "pair", "outside", "data_fault"};
inline const char* name_of(CaseKind kind) { return case_kinds[static_cast<std::size_t>(kind)]; }

struct Answer {
  CaseKind kind = CaseKind::null;
  std::vector<std::string> ids;   ///< of the catalogue; a short name for an outside effect or a data fault
  std::vector<double> strengths;  ///< one per id, in detection limits (detection_scale.hpp); empty: null or data fault
  double strength = 0;            ///< of the weaker effect
  double start_s = 0, end_s = 0;  ///< first and last time at which the effect exceeds 20 % of its maximum
  double soc_from = 0, soc_to = 1;  ///< smallest and largest true SOC at these times
  double effect_rms_v = 0;          ///< voltage with the effect minus without it, for the same measured current
  double noise_floor_v = 0;         ///< RMS of what noise, drift and converter add to the voltage
  std::string profile;
  std::vector<double> amplitudes;   ///< one per id, in the unit that the effect's file states
  bool repeats_in_holdout = true;   ///< false: the effect comes at other times in the hold-out
  std::vector<std::string> laws;    ///< outside the catalogue: each of them names the effect rightly
  double holdout_effect_rms_v = 0;  ///< as effect_rms_v, in the hold-out
};

/// A test that is run on purpose. Columns of equal length.
struct TestPlan {
  double step_s = 1, start_soc = 0.95;
  std::vector<double> current_a;      ///< true; [0] is 0
  std::vector<double> ambient_c;      ///< NaN: the temperature of the laboratory
  std::vector<double> source_v;       ///< voltage of a source that is connected instead of the cell; NaN: the cell
  bool measures_temperature = false;  ///< even if the recording of the case has no temperature
};

struct Case {
  std::string name;  ///< contains nothing about the answer
  CalibratedCell cell;
  double given_initial_soc = 0;    ///< the initial SOC that the diagnosis is given
  double holdout_initial_soc = 0;  ///< true to 0.5 %
  Series recording, holdout;
  Answer answer;
  /// A later test on the same cell and instruments with the same effects; empty for data faults.
  std::function<Series(const TestPlan&)> run_test;
};

enum class Split { development, final };

std::size_t case_count(Split split);
Case make_case(Split split, std::uint64_t seed, std::size_t index);

/// An effect outside the catalogue with 2 to 8 detection limits; all of them in turn, without an end. The random stream
/// is another one than that of make_case.
Case make_outside_case(Split split, std::uint64_t seed, std::size_t index);

}  // namespace bms::benchmark::truth
