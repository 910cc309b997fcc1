// The designs behind the names in experiment.hpp. Each appends its profile to a builder.
#pragma once

namespace bms::experiments {

class ProfileBuilder;

// paper_designs.cpp
/// Short pulses of two amplitudes, discharge and charge, with rests between them.
void short_pulses(ProfileBuilder& cell, int rest_s);
/// Long bursts without rests: HIGH and LOW current, discharge and then charge.
void long_bursts(ProfileBuilder& cell, int high_s, int low_s);
/// From full to empty and back in ten steps each way, with a rest after each step.
void ocv_test(ProfileBuilder& cell, int rest_s);

// forklift_shift.cpp
void forklift_shift(ProfileBuilder& truck);

// diagnostic_designs.cpp
void meter_check(ProfileBuilder& cell);
void shunt_check(ProfileBuilder& cell);
void terminal_check(ProfileBuilder& cell);
void fast_pulses(ProfileBuilder& cell);
void zero_current(ProfileBuilder& cell);
void long_rest_open(ProfileBuilder& cell);
void charge_turns(ProfileBuilder& cell);
void full_cycle(ProfileBuilder& cell);
void loops_and_rests(ProfileBuilder& cell);
void rate_steps(ProfileBuilder& cell);
void climate_steps(ProfileBuilder& cell);

}  // namespace bms::experiments
