// Every number that a verdict depends on. What belongs to one mechanism alone stands in
// inference/diagnosis/mechanisms/, what decides on a law without a known cause in law_thresholds.hpp, what healthy
// recordings decide in healthy_thresholds.hpp, what only keeps the arithmetic stable in numerics.hpp.
//
// Costs and gains are differences of -2 log posterior (docs/diagnosis_method.md): an effect of x standard deviations
// gains x^2. Currents in multiples of the capacity per hour end in _c (1C), shares and states of charge are fractions.
//
// Origin. "Development split": set on the concealed cases of `benchmark development 1`. Where no other origin is
// given, a number is from the first development split and was not derived again.
#pragma once

#include <array>
#include <cstddef>

#include "diagnosis/healthy_thresholds.hpp"

namespace bms::diagnosis {

struct Thresholds {
  /// Is the recording usable at all? Wide limits: a fault of the recording exceeds them by far.
  struct RecordingFaults {
    double volts_at_most = 100;          ///< [V] median above it: the file is in millivolts; no single cell has 100 V
    double amperes_times_limit = 60;     ///< largest current over the cell's limit above it: milliamperes
    double outside_limits_v = 0.8;       ///< [V] beyond the cell's voltage limits a reading is a dropout
    std::size_t few_readings = 20;       ///< dropouts or spikes up to this number are removed and reported
    std::size_t rows_per_reading = 500;  ///< or one of them in so many rows; more is a fault
    double spike_v = 0.25;               ///< [V] from the mean of both neighbours
    double spike_neighbours_v = 0.01;    ///< [V] by which the neighbours differ at most
    double spike_current_step_c = 0.05;  ///< [C] by which the current moves at most
    std::size_t stuck_rows_loaded = 8;   ///< rows with equal voltage while the current moves by stuck_swing_c
    double stuck_swing_c = 0.25;         ///< [C]
    std::size_t stuck_rows = 60;         ///< the same for small movements of the current; on a flat OCV at constant
                                         ///< current a good reading stands still as well
    double stuck_small_swing_c = 0.02;   ///< [C]
    double stuck_times_usual = 12;       ///< and longer than this times the usual run of equal readings
    double usual_run_quantile = 0.99;    ///< which of the runs of equal readings is the usual one
    std::size_t runs_for_usual = 200;    ///< runs needed to know it
    double stuck_at_most_s = 45;         ///< [s] in total, or
    double stuck_at_most_share = 0.004;  ///< of the recording; more is a fault
    double charge_c = 0.02;              ///< [C] a charge at constant voltage begins above it
    double charge_zero_c = 0.002;        ///< [C] and ends at 0: a reading may lie so far below
    std::size_t charge_parts = 4;        ///< of the stretch, from one to the next of which its mean current falls
    double unchanged_c = 0.01;           ///< [C] by which the current differs at both ends of a step in which a logger
                                         ///< that writes on change saw none
    std::size_t unchanged_steps = 20;    ///< such steps needed,
    double unchanged_share = 0.95;       ///< and share of all long steps: a logger that stops in a drive comes back at
                                         ///< another current
    double unchanged_longer = 1.05;      ///< times the longest such step: the logger's clock is not exact
    double gap_steps = 10;               ///< a step of the clock longer than this times the median is a gap,
    double gap_at_least_s = 5;           ///< [s] if it is this long
    double gap_load_c = 0.05;            ///< [C] current next to it from which charge is lost
    double gaps_lose_soc = 0.02;         ///< soc that the gaps may have moved; above it is a fault
    std::size_t gaps_at_most = 2;        ///< number of gaps under load; more are a fault
    double edge_c = 0.15;                ///< [C] step of the current at which the sign is checked
    std::size_t edges_for_sign = 2;      ///< number of steps needed
    double inverted_correlation = -0.5;  ///< of current and voltage steps
    std::size_t inverted_edges = 7;      ///< more than so many of
    std::size_t inverted_of = 10;        ///< so many steps go the wrong way
    double same_current = 0.1;           ///< by which a constant current may differ,
    double inverted_soc = 0.2, inverted_v = 0.15;  ///< [soc, V] that it moves, the voltage the wrong way: no OCV does
  };

  /// Noise that exists before any hypothesis.
  struct Noise {
    double white_share_of_ocv = 0.2;       ///< white noise at least, as a share of tolerance.ocv_v: no model is better
    double quiet_c = 0.01;                 ///< [C] step of the current below which second differences show the noise
    std::size_t second_differences = 100;  ///< needed; with fewer the cell file's noise.voltage_v holds
    double fast_correlation_s = 60;        ///< [s] of the fast part
    double slow_correlation_s = 3'600;     ///< [s] of the slow part
    double white_at_least_v = 5e-5;        ///< [V]
    double fast_at_least_v = 5e-4;         ///< [V] of the fast part
    double slow_at_least_v = 5e-4;         ///< [V] of the slow part, before slow_times_drift
    double slow_times_drift = 1.3;         ///< standard deviation of the slow part over tolerance.drift_v
    double edge_jitter = 0.05;          ///< share of a current step's R0 voltage that the reading next to it may miss:
                                        ///< voltage and current are never read at exactly the same moment
    double edge_error = 0.4;            ///< share of tolerance.resistance_fraction that differs from step to step
    double soc_error_share = 0.3;       ///< soc error of the OCV table as a share of the start's standard deviation
    double ocv_slope_reach = 0.01;      ///< soc around the counted one over which the OCV slope is taken
    double start_current_c = 0.01;      ///< [C] above it the first row is not used: the load before is unknown
    double amplitude_log_sigma = 0.15;  ///< of the prior of a noise amplitude above its nominal value, in ln: a factor
                                        ///< of 2 costs 21, of 4 85, of 10 240. Development split
    double same_amplitude = 1.25;       ///< two noise models whose amplitudes differ by less are the same
  };

  /// Priors of mechanisms' parameters, besides what the catalogue knows of them (model::Parameter::typical).
  struct Priors {
    double rarity = 0.5;   ///< of a strength beyond what is common: sigma over the common size
    double tail = 3;       ///< of these sigmas beyond which the cost grows as the logarithm: faults of instruments have
                           ///< no largest usual size
    double log_sigma = 1;  ///< of a shape, in ln: a factor of e between its default and an unusual value
  };

  /// Removal of sensor noise from the current at constant load. Without it 7 of 11 healthy recordings had a finding,
  /// with it 1 of 11 (development split).
  struct CurrentDenoising {
    std::size_t block_rows = 30;    ///< in which the noise is measured
    std::size_t blocks = 5;         ///< needed
    double calm_quantile = 0.2;     ///< of the blocks' noise: the calm ones show the sensor
    std::size_t reach_rows = 30;    ///< averaged to either side
    double neighbour_sigma = 4.5;   ///< a neighbour differs by no more than this times the noise
    double neighbours = 4;          ///< more rows than this are averaged, or the reading stays
    double noise_times_file = 1.5;  ///< the noise is at most this times the cell file's noise.current_a
  };

  /// Steps between readings that a converter makes.
  struct Quantisation {
    std::size_t steps = 20;        ///< needed
    double step_quantile = 0.02;   ///< of the steps: the converter's own is among the smallest
    double grid_tolerance = 0.15;  ///< of a step, for a reading on the grid
    std::size_t on_grid = 3;       ///< more than so many of
    std::size_t on_grid_of = 5;    ///< so many changed readings lie on the grid
  };

  /// The control hypothesis: how far the base parameters may move.
  struct Calibration {
    double soc_lowest = -0.1, soc_highest = 1.1;       ///< range of the knots
    double ocv_at_least_v = 2e-4;                      ///< [V] tolerance of the OCV at least
    double resistance_at_least = 2e-3;                 ///< tolerance of the resistances at least, as a fraction
    double ocv_knots_soc = 0.05;                       ///< distance of the OCV's knots
    double r0_knots_soc = 0.1;                         ///< of R0's
    double rc_knots_soc = 0.2;                         ///< of R1's and C1's
    double r1_times = 2, c1_times = 4;                 ///< tolerance of R1 and C1 over that of R0
    double first_node_soc = 0.2, last_node_soc = 0.9;  ///< a table that ends inside stands for these as well
    double beyond_nodes_soc = 0.1;                     ///< beyond the outermost node within which the error doubles
    double corner_width_soc = 0.025;                   ///< half width of a rounded corner of the OCV, at most
    double corner_share = 6;  ///< change of slope times half width over this is the corner's sigma. A curve that is
                              ///< round over a quarter of the pieces passes at change times width / 4: 1.5 sigma
    double capacity_sigma = 0.005;       ///< of the capacity, as a fraction
    double gain_sigma = 0.002;           ///< of the current sensor's gain
    double offset_at_most_c = 1e-3;      ///< [C] sigma of the wander of the current sensor's zero, at most
    double offset_knots = 12;            ///< per recording at most
    double initial_soc_at_least = 1e-4;  ///< sigma of the start at least
    double branch_sigma = 0.577;         ///< of the branch position at the start of a recording: of a uniform
                                         ///< distribution between -1 and 1
    double known_alone = 0.5;  ///< identified standard deviation of R0 and of R1 over their value above which only
                               ///< their sum is known: rows too far apart to distinguish them
    double share_sigma_at_most = 3;  ///< of R0's share in the sum, in its logit
  };

  /// Moved base parameters written back into a cell file's tables.
  struct MovedTables {
    double corner_sigma = 0.3;                               ///< a corner moved by more gets two edges of its own
    double edges_apart_soc = 0.004, nodes_apart_soc = 0.02;  ///< between entries, so that a table stays readable
    double slope_share = 0.9;  ///< of the slope that may be taken away: the OCV goes on rising
    double resistance_lowest_ohm = 1e-5, resistance_highest_ohm = 0.5;  ///< as the cell file's reader accepts
  };

  /// What counts as a rest, an edge, a turn of the charge (recording_facts.hpp).
  struct Facts {
    double rest_c = 0.02;      ///< [C] below it the cell rests; in wording only
    double moving_c = 0.02;    ///< [C] above it a reading counts as load
    double edge_c = 0.05;      ///< [C] step of the current
    double rate_c = 0.05;      ///< [C] above it currents are sorted by size; in wording only
    double rate_ratio = 1.33;  ///< of two sizes of current; in wording only
    double turn_soc = 0.01;    ///< charge that goes back before its direction has turned; in wording only
    double rail_c = 0.2;       ///< [C] the largest current at least, to see a sensor's end
    double rail_share = 0.9;   ///< of the largest current that is near the end
    std::size_t rail_rows = 4, rail_runs = 2;  ///< rows near it and separate visits needed
    double stands_within = 0.005;              ///< of the largest current within which a reading stands at its end
    std::size_t stands_before = 3;             ///< rows of a visit there before its voltage counts
    std::size_t stands_rows = 8;               ///< rows there, after others there, that are needed
    double stands_noise = 5;                   ///< times its noise by which the voltage goes on moving there
    double one_current_within = 0.1;           ///< from their median within which currents are one size
    double one_current_share = 0.98;           ///< of the loaded rows with it: the rest are the load's ends
    std::size_t one_current_edges = 6;         ///< steps of the current at most: more show the resistance by themselves
  };

  /// NOT_TESTABLE: below these nothing can be said of any mechanism.
  struct Information {
    std::size_t readings = 50;     ///< usable voltages
    double duration_s = 300;       ///< [s]
    std::size_t loaded_rows = 10;  ///< rows with load
    double current_span_c = 0.02;  ///< [C] between the smallest and the largest reading
  };

  /// Signatures: which mechanism is worth a fit, and how small it could be and still be found.
  struct Screening {
    double worth_a_fit = 5;          ///< first-order gain below which a mechanism is not fitted
    std::size_t fits = 6;            ///< at most, of mechanisms added to what is there
    std::size_t rivals = 5;          ///< at most, of mechanisms in the place of another
    double rival_share = 0.1;        ///< of the gain of the mechanism that a rival's first-order gain must reach
    double per_unknown = 2;          ///< gain that noise alone gives to every unknown after the first
    double limit_margin = 1.28;      ///< standard deviations of a strength above the smallest that is named, from which
                                     ///< it is named in 9 of 10 recordings
    double limits_in_bounds = 2;     ///< a limit is stated where so many times its size is within the bounds
    double start_share = 0.6;        ///< a fit begins within this share of the bounds
    std::size_t moments = 40;        ///< onsets tried of a contact that has changed
    std::size_t moments_margin = 2;  ///< of them left out at each end of the recording
    double near_onset_s = 120;       ///< [s] around a contact's change where a burst is part of that change
  };

  /// Bursts of a loose contact.
  struct Bursts {
    std::array<std::size_t, 6> lengths_rows = {2, 4, 8, 16, 32, 64};  ///< of stretches tried
    std::size_t overlap = 4;                                          ///< stretches begin every length / overlap rows
    std::size_t tail_rows = 40;       ///< in which the whitener's response to a stretch has decayed
    std::size_t fewest_rows = 3;      ///< in total: one bad reading is not a contact
    double loaded_share = 0.35;       ///< of the loaded rows at most: bursts are the exception
    double loaded_current = 0.02;     ///< of the largest current, above which a row is loaded
    double edge_current = 0.2;        ///< of the largest current: a step next to which the model itself may be off
    std::size_t near_edge_rows = 64;  ///< around such a step
    double edge_chance = 0.01;        ///< probability below which bursts come with the steps of the current: how a
                                      ///< cell answers a step. 5 of 5 in a healthy recording (development split)
    double control_times = 2;         ///< gain over that of stretches that ask for less resistance, which no
                                      ///< contact has
    std::array<double, 9> resistance_quantiles = {0.05, 0.15, 0.25, 0.35, 0.5, 0.65, 0.75, 0.85, 0.95};  ///< tried
  };

  /// Model selection.
  struct Decision {
    double detected = 26;           ///< gain over the calibration that chance reaches in 1 of 216 healthy
                                    ///< recordings (development split)
    double per_unknown = 3;         ///< cost of every unknown after the first
    double per_burst = 12;          ///< cost of every burst: its two ends were sought
    double hopeless = 80;           ///< a rival this far behind the best is not fitted to the end
    double tie = 7;                 ///< rivals this close cannot be distinguished
    double inseparable = 0.97;      ///< correlation of signatures above which two mechanisms are one class
    double tie_inseparable = 30;    ///< within a class rivals this close are all named: they differ by how well
                                    ///< an equation fits, not by what was seen
    double better_start = 1;        ///< by which the same mechanisms from another start must be better
    double better_rival = 0.5;      ///< by which another mechanism must be better to replace one
    double faint = 52;              ///< gain, twice `detected`, below which a cause must explain its share: 2 of
                                    ///< 144 healthy recordings had such a finding (development split)
    double noticeable = 0.02;       ///< share of the error by which one of several causes moves the voltage, or
    double noticeable_gain = 0.05;  ///< of the gain of all together: the mean square of a short effect is small
    double contact_wander = 0.025;  ///< share of a resistance that a contact wanders in one discharge: the most between
                                    ///< its first and last tenth in 41 discharges of NASA B0005, B0025, B0029, B0038
                                    ///< and B0042 with two voltmeters. A slow cause next to it must explain more
    double end_share = 1.0 / 12;    ///< of a discharge at one current, in which a contact that acts there alone is not
                                    ///< distinguished from the knee: the place that in_one_place looks at
    double own_sigmas = 2;          ///< a strength within so many of its standard deviations of none is not named
    double capacity_lost_alone = 0.3;  ///< loss of capacity that no ageing makes without
    double resistance_grown = 0.1;     ///< so much more resistance or polarisation
    double stages_closer = 0.15;       ///< by which the stages of the OCV lie closer together without
                                       ///< so much less capacity: no electrode is used less otherwise
    double slides_apart_soc = 0.6;     ///< between the two slides of an OCV
    double trades = 0.8;               ///< correlation of two strengths of which the recordings know the sum alone
    double in_one_place = 0.5;     ///< share of what a cause gains from the readings above which it has one place, a
                                   ///< twelfth of a recording, if the rest gains less than `detected`. Most of it:
                                   ///< not tuned. Without healthy data 29 of 68 healthy discharges of NASA cells
                                   ///< had a cause, with it 4; of 49 with effects it costs 1 (development split)
    double gross_v = 0.1;          ///< [V] RMS error above which a cell is never called healthy, whatever the tolerance
    double certain_times = 10;     ///< of the error that healthy recordings show or the tolerance states, above which
                                   ///< something is wrong, also if all that speaks for a cause lies in one place.
                                   ///< The error of healthy ones where none was is larger by a factor of 3 (RMS;
                                   ///< second halves of eight A123 drives)
    double error_may_grow = 1.15;  ///< of the error without the start's and the sensor's own unknowns, by adding
                                   ///< a cause,
    double error_may_grow_v = 3e-4;  ///< [V] plus this
  };

  /// Is what was found enough?
  struct Adequacy {
    double explained = 0.8;             ///< share of the gain that a cause must explain
    double explained_by_bursts = 0.98;  ///< the same for a mechanism that is free to come and go
    double unexplained = 40;            ///< gain of generic columns from which something unknown is there
    double far_out = 0.003;             ///< share of the whitened residual beyond 4 sigma. 0.001 at most in 144
                                        ///< healthy recordings, 0.1 where a converter sticks (development split)
  };

  /// Probabilities that are reported.
  struct Probability {
    double temper = 1.5;    ///< log likelihoods are divided by it: they are too sure of themselves
    double at_most = 0.93;  ///< so many verdicts were right where nothing came near (development split)
  };

  /// Columns without physics over the residual of the best hypothesis.
  struct ResidualTest {
    double free_v = 0.02;             ///< [V] prior standard deviation of a generic voltage
    double fine_share = 0.25;         ///< of it, for the columns with many knots
    double gain_per_freedom = 1.6;    ///< subtracted per degree of freedom: what noise alone gains, with a margin
    double gain_of_frequencies = 14;  ///< what the best of some hundred frequencies gains on noise
    std::size_t time_knots = 30, time_current_knots = 6, soc_knots = 8, soc_fine_knots = 24, soc_current_knots = 4,
                voltage_knots = 30;
    std::array<double, 6> memory_s = {4, 15, 60, 250, 1'000, 4'000};  ///< [s] time constants of the load's memory
    double heading_soc = 0.02;                                        ///< charge over which the direction is remembered
    double heat_s = 1'500;                                            ///< [s] over which the load's heat is remembered
    std::array<double, 5> leaps_v = {0.002, 0.004, 0.008, 0.016, 0.032};  ///< [V] of a reading that follows in leaps
    double frequency_resolution = 160;     ///< neighbouring frequencies differ by at most 1 / this
    std::size_t frequencies = 640;         ///< at most
    std::size_t frequency_neighbours = 6;  ///< on either side, for the load's usual power
    double load_power_times = 3;   ///< the load's power at a frequency over its usual one: a profile that repeats
                                   ///< itself has the period, so a small error of the model has it too
    double periods = 4;            ///< in the recording at least
    double highest_hz = 0.02;      ///< [Hz]
    double highest_per_row = 0.1;  ///< and this per row
    double line_spacing = 0.5;     ///< of frequencies, in units of 1 / duration
    double far_sigma = 4;          ///< beyond it a whitened residual is far out; also the winsorising limit
    std::size_t rows = 100;        ///< needed for far_out and fast_excess
  };

  /// Where a mismatch lies.
  struct Location {
    std::size_t rows_per_outlier = 500;  ///< the largest of so many rows does not count as the peak
    double peak_over_energy = 25;        ///< energy above peak / this belongs to a span: a fifth of the amplitude
    double spans_apart = 0.1;            ///< of the recording; spans closer than that are one
    double edge_c = 0.1;                 ///< [C] step of the current from which time is counted
    double regime_share = 0.7;           ///< of the energy, which a regime holds
    double regime_sharper = 1.25;        ///< energy share over time share from which a regime is reported
  };

  /// Readings of trusted instruments.
  struct References {
    double covers = 0.9;           ///< share of the rows from which a trusted instrument takes the place of the own
    double check_at_most_s = 300;  ///< [s] readings averaged to one check
    double filter_share = 0.1;     ///< of a stretch at its start, where a filtered channel may still move
    double still_v = 0.02, still_c = 0.02;  ///< [V], [C] by which a reference moves within a check
    double unsteady_share = 0.05;           ///< of an instrument's error that differs from time to time
    double meter_v = 3e-4, meter_c = 3e-5;  ///< [V], [C] standard deviation of a trusted voltmeter and ammeter
  };

  /// What the current sensor reads in rests after a discharge (idle_reading.hpp).
  struct IdleReading {
    double beginning_s = 10;               ///< [s] of a rest at its start, where a filtered channel may still move
    std::size_t readings = 30;             ///< of a rest at least
    std::size_t rests = 2;                 ///< at least
    std::size_t zeros_of_no_reading = 10;  ///< exact zeros in a row: the instrument does not measure
    double alike = 0.5;                    ///< of the reading by which the rests may differ
    double charge_at_most = 0.05;          ///< of the capacity, in all rests: more is charged
    double true_current_c = 2e-4;   ///< [C] standard deviation of what may really flow: a charge of 1 % in 50 h that
                                    ///< nobody wants
    double resolution_share = 0.3;  ///< of the sensor's step, standard deviation of a mean of few different readings
  };

  /// The next experiment.
  struct Design {
    double separates = 40;      ///< expected gain from which two hypotheses are separated: more than
                                ///< Decision::tie_inseparable, because no forecast is exact
    std::size_t rivals = 8;     ///< hypotheses compared at most, the finding included
    double rows = 1'500;        ///< of a simulated course at most: a coarse one is enough to choose by
    double survey_step_s = 10;  ///< [s] step by which the courses' durations are compared
    double soc_lowest = 0.02, soc_highest = 0.99;  ///< that the cell may reach
    double capacity_lost = 0.995;                  ///< share of the capacity below which the course is made smaller
    double initial_soc_at_least = 1e-4;            ///< sigma of the start
    double alike = 0.98;                         ///< correlation of the charges from which a recording follows a course
    double carried_out_share = 0.95;             ///< of a course's duration that is in the recording
    double scale_least = 0.3, scale_most = 1.5;  ///< recorded charge over that of a course for the nominal capacity
    double idle_c = 0.02;                        ///< [C] reading of a sensor of which no current flows
  };

  /// Which causes can be distinguished (isolability.hpp).
  struct Isolability {
    double times_limit = 2;           ///< size of a cause, in its detection limits
    std::size_t moments = 12;         ///< at which a contact that changes is compared
    double trusted_readings = 1'500;  ///< of a second instrument in a recording, at most
  };

  RecordingFaults recording;
  Noise noise;
  Priors priors;
  CurrentDenoising denoising;
  Quantisation quantisation;
  Calibration calibration;
  MovedTables tables;
  Facts facts;
  Information information;
  Screening screening;
  Bursts bursts;
  Decision decision;
  Adequacy adequacy;
  Probability probability;
  ResidualTest residual;
  Location location;
  References references;
  IdleReading idle_reading;
  Design design;
  Isolability isolability;
  HealthyThresholds healthy;
  ModelToleranceThresholds model_tolerance;
};

inline constexpr Thresholds thresholds{};

}  // namespace bms::diagnosis
