#include "experiments/experiment.hpp"

#include <iterator>

#include "experiments/designs.hpp"
#include "experiments/profile_builder.hpp"

namespace bms::experiments {

namespace {

constexpr double almost_full = 0.95;

constexpr Experiment table[] = {
    {"rest_30s", "pulses of 10 s and rests of 30 s, 20 minutes around one state of charge",
     [](ProfileBuilder& cell) { short_pulses(cell, 30); }},
    {"rest_18s", "the same with rests of 18 s", [](ProfileBuilder& cell) { short_pulses(cell, 18); }},
    {"rest_5s", "the same with rests of 5 s", [](ProfileBuilder& cell) { short_pulses(cell, 5); }},
    {"high_1m_low_30s",
     "bursts of 1 min at HIGH and 30 s at LOW current, discharge and charge, 20 minutes around one state of charge",
     [](ProfileBuilder& cell) { long_bursts(cell, 60, 30); }},
    {"high_30s_low_30s", "the same with 30 s and 30 s", [](ProfileBuilder& cell) { long_bursts(cell, 30, 30); }},
    {"high_30s_low_1m", "the same with 30 s and 1 min", [](ProfileBuilder& cell) { long_bursts(cell, 30, 60); }},
    {"ocv_1h_rest", "from full to empty and back in ten steps, with rests of 1 h",
     [](ProfileBuilder& cell) { ocv_test(cell, 3'600); }},
    {"ocv_10min_rest", "the same with rests of 10 min", [](ProfileBuilder& cell) { ocv_test(cell, 600); }},
    {"forklift_shift",
     "eight hours of an electric forklift: driving, lifting, regeneration, breaks with opportunity charge",
     forklift_shift},
    // those below distinguish causes, short ones first
    {"fast_pulses", "pulses of 5 s at 1C, ten minutes, logged ten times a second", fast_pulses, almost_full,
     "Charge the cell full, discharge it by 10 % and charge it by 5 %, let it rest for one hour; log ten times a "
     "second.",
     0.1},
    {"zero_current", "contactor open for 20 minutes: the current sensor then reads only its own offset", zero_current,
     almost_full,
     "Open the contactor where the profile has a current_ref_a, continue logging, and keep that column (0 A) in "
     "the recording."},
    {"shunt_check", "charge and discharge at nearly 1C with a trusted ammeter in series, half an hour", shunt_check,
     almost_full,
     "Charge the cell full, discharge it by 10 % and charge it by 5 %; put a trusted ammeter or shunt in series and "
     "enter its "
     "readings as current_ref_a in place of the profile's values."},
    {"terminal_check",
     "charge and discharge at nearly 1C with a trusted ammeter in series and a voltmeter on the cell's own "
     "terminals, half an hour",
     terminal_check, almost_full,
     "Charge the cell full, discharge it by 10 % and charge it by 5 %; put a trusted ammeter in series and a "
     "voltmeter on the "
     "cell's own terminals and enter their readings as current_ref_a and voltage_ref_v."},
    {"meter_check",
     "contactor open for half an hour, the voltage sense wires alternately on two voltages of a reference source",
     meter_check, almost_full,
     "Open the contactor; put the voltage sense wires on a reference source where the profile has a voltage_ref_v, "
     "and keep both reference columns in the recording, with the readings of a trusted meter."},
    {"rate_steps", "pulses of three rates and two durations, discharge and charge, at five states of charge",
     rate_steps, almost_full,
     "Charge the cell full, discharge it by 10 % and charge it by 5 %, let it rest for one hour; log once a second "
     "or faster."},
    {"climate_steps", "small pulses at 25, 10 and again 25 degrees C, then heating by the current", climate_steps,
     almost_full,
     "Put the cell into a climate chamber set as temperature_c says, and log the cell's own temperature; begin at 95 "
     "%, reached by charging and after a rest of one hour."},
    {"full_cycle", "slow discharge into the lower knee and slow charge into the upper one, with rests", full_cycle,
     almost_full,
     "Charge the cell full, discharge it by 10 % and charge it by 5 %, let it rest for one hour; connect no other "
     "load."},
    {"loops_and_rests",
     "loops of three sizes at three rates, each level from above and from below, with rests of 40 minutes",
     loops_and_rests, almost_full,
     "Charge the cell full, discharge it by 10 % and charge it by 5 %, let it rest for one hour; log through all "
     "rests."},
    {"charge_turns", "charge and discharge by half of the capacity five times between two visits of the lower knee",
     charge_turns, almost_full,
     "Charge the cell full, discharge it by 10 % and charge it by 5 %, let it rest for one hour; open the contactor "
     "where the "
     "profile has a current_ref_a and keep that column in the recording."},
    {"long_rest_open", "contactor open for 8 hours between two visits of the lower knee", long_rest_open, almost_full,
     "Charge the cell full, discharge it by 10 % and charge it by 5 %, let it rest for one hour; open the contactor "
     "where the "
     "profile has a current_ref_a, continue logging, and keep that column in the recording."},
};

}  // namespace

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all(std::begin(table), std::end(table));
  return all;
}

const Experiment* find_experiment(std::string_view name) {
  for (const Experiment& e : experiments()) {
    if (e.name == name) return &e;
  }
  return nullptr;
}

std::optional<std::vector<ProfileRow>> experiment(std::string_view name, const ExperimentOptions& options) {
  const Experiment* e = find_experiment(name);
  if (e == nullptr) return std::nullopt;
  ProfileBuilder builder(options);
  e->build(builder);
  return builder.sampled(options.capacity_ah, options.step_s);
}

}  // namespace bms::experiments
