// Numbers that a verdict on a pack depends on. Chosen on development seeds of the simulated packs. Recordings of two
// real cars showed which rules were missing (impossible readings, shapes of the OCV, spread of the pack itself, delays
// below half a row), so they are no independent test of them; the final seed is one.
#pragma once

#include <array>
#include <cstddef>

#include "diagnosis/pack/causes.hpp"

namespace bms::diagnosis::pack {

/// The spread of one parameter over the cells of a pack.
struct Spread {
  double healthy;    ///< standard deviation of healthy cells, at least; the pack itself can show a larger one
  double fault;      ///< standard deviation of a faulty one
  double least;      ///< a smaller size is not worth a visit and is never named
  double example;    ///< size for the table of what can be separated
  double most;       ///< spread that a pack may show, over `healthy`
  double scale;      ///< relative error of a size: what all cells share is not known better
  double aged = 0;   ///< in a cell with a higher resistance: R0 and R1 do not grow alike; a joint changes neither
  double moved = 0;  ///< in a cell with another charge: errors of the cell file's curve and resistances do not cancel
  double late = 0;   ///< in a cell whose channel is late: what happened within the row is not known
};

struct PackThresholds {
  /// By parameter. Resistances of a joint are relative to R0 of the cell file at half charge.
  std::array<Spread, parameter_count> spread = {{
      {0.004, 0.06, 0.015, 0.04, 6, 0.05},      // charge: a balanced pack is good to 1 %
      {0.010, 0.15, 0.04, 0.12, 6, 0.1},        // capacity: cells of a batch differ by 1 %
      {0.0005, 0.03, 0.003, 0.02, 6, 0.1},      // leak: 1 % a month is healthy
      {0.03, 0.5, 0.12, 0.3, 4, 0.05, 0, 0.1},  // resistance
      {0.05, 0, 0, 0, 4, 0, 0.15, 0.1},         // polarisation: no cause of its own
      {0.05, 0, 0, 0, 4, 0, 0.3, 0.1},          // time constant
      {0.02, 0, 0, 0, 6, 0, 0.15, 0.15},        // tilt
      {0.02, 0.5, 0.12, 0.3, 5, 0.05},          // joint
      {0.001, 0.03, 0.004, 0.010, 12, 0.02},    // offset: what a monitor's datasheet states
      {0.0003, 0.01, 0.0015, 0.005, 1, 0.05},   // gain: as stated; what varies with the voltage is the slope
      {0.0005, 0, 0, 0, 8, 0},                  // slope: no cause of its own
      {0.01, 3, 0.1, 1, 1e6, 0.05},             // delay: channels may be read one after the other
      {0.02, 0, 0, 0, 3, 0},                    // temperature: 2 to 4 % per kelvin
      {0.015, 0, 0, 0, 1, 0},                   // heating: the law, and how much of the warmth is the load's
      {0.02, 0, 0, 0, 50, 0, 0, 0, 0.5},        // blur: of R0; follows from the times at which channels are read
      {0.0005, 0, 0, 0, 8, 0, 0, 0.001},        // shapes of the OCV curve: healthy cells age differently
      {0.0005, 0, 0, 0, 8, 0, 0, 0.001},
      {0.0005, 0, 0, 0, 8, 0, 0, 0.001},
      {0.0005, 0, 0, 0, 8, 0, 0, 0.001},
  }};
  /// Of the voltage's changes from row to row, that those of the current explain. Of means it is at most 0.4 if the
  /// load steps at random moments, cos^2(pi / n) of a load with a period of n rows, and 1 if it steps between rows.
  double single_readings = 0.7;
  double gap_steps = 1.5;  ///< times the usual time between rows, from which on rows are missing
  /// A step at any moment of a row: variance of its mean over the square of the step. A current that is another one in
  /// each row: the same over the square of its changes.
  double step_in_row = 1.0 / 12, new_in_row = 0.5;
  double seconds_per_hour = 3'600;
  double most_spread = 12;                          ///< of the spread that a pack may show, over that of healthy cells
  double outlying_share = 0.2, outlying_cells = 4;  ///< so many cells of a pack may be faulty in one parameter
  double hours_per_day = 24;
  std::size_t smooth_rows = 7;  ///< before and after, whose mean difference to the model is taken
  double instant_rows = 30;     ///< differences to the model that last longer are not steps within a row
  std::size_t blur_rows = 3;    ///< before and after: changes of the current over that time do not depend on the moment
  /// More cells than that with the same cause are no exceptions: the pack's spread is as large.
  double exceptions = 3, exceptions_share = 0.06;
  double wider = 1.5;            ///< factor on the spread then
  double fault_prior = 0.05;     ///< that any single cause is present somewhere in a pack
  double least_odds = 4;         ///< [ln] posterior odds from which on a cause is named
  double further_in_cell = 6;    ///< [ln] more for a further cause in the same cell,
  double share_of_first = 0.03;  ///< and this share of what the first one gained: its model is not better
  double healthy_sigmas = 2;     ///< of its spread, within which a parameter that is not named is healthy
  double negligible = 0.01;      ///< of a healthy spread: as good as none
  double alike_margin = 4;       ///< [ln] that does not separate two alike causes: no model is as exact as that
  double least_sigmas = 4;       ///< size over its standard deviation
  double ambiguous_from = 0.05;  ///< probability of another cause from which on the verdict is AMBIGUOUS
  double listed_from = 0.01;     ///< probability from which on another cause is listed
  std::size_t channel_group = 4, channel_sets = 3;  ///< neighbouring cells whose channels are searched together; causes
  std::size_t most_causes = 20;                     ///< of one pack
  std::size_t checkpoints = 32;                     ///< times at which the verdict is formed again
  double separable_odds = 3;                        ///< [ln] expected odds of the right cause against the other one

  struct Noise {
    double quiet_c = 0.01;                    ///< [C] step of the current below which second differences show the noise
    double white_v = 0.001;                   ///< if there are too few quiet rows
    double fast_v = 0.0005, slow_v = 0.0005;  ///< starting values
    double unknown_edge = 5;  ///< factor on edge_share, as learned, from which on the current of a reading is unknown
    double longest_constant_s = 10;  ///< between rows with equal currents, for a current that was constant
    double edge_share = 0.01;        ///< of R0 times a step of the current: error at the step, before it is learned
    double ocv_axis = 0.001;         ///< error of the OCV's SOC axis between cells
    double lowest_soc = 0.04, highest_soc = 0.98;  ///< beyond, the curve of the cell file is not to be trusted:
    double beyond_axis = 0.5;                      ///< error of the axis as a share of the distance
    double beyond_resistance = 20;                 ///< relative error of the resistances over the distance
    double track_soc = 0.006;   ///< error of the state of charge that all cells share: it matters where slopes differ
    double ocv_reach = 0.02;    ///< difference in SOC over which errors of the OCV curve become independent
    double shape_share = 0.02;  ///< error of a resistance's course, as a share of what a fault adds to it
    double jitter_s = 0.002;    ///< of the sampling
    std::size_t cells = 8;      ///< from which the noise is learned
    double misfit = 1.5;        ///< mean square over the expected one from which on a channel has a noise of its own
    int rounds = 3;             ///< of such a channel's noise and fit
    std::array<double, 4> factors = {2, 1.41, 1.19, 1.09};  ///< of the search, in this order
    double least_v = 2e-5, most_v = 0.1;                    ///< of each part
  } noise;

  struct Channels {
    double glitch_v = 0.05;         ///< beyond the movement of the model around it
    std::size_t moved_rows = 12;    ///< before and after, in which the model may move as far as the reading
    std::size_t glitch_rows = 150;  ///< before and after, whose median is compared
    double moving_steps = 3;        ///< steps of the converter by which the model moves, so that a reading must change
    double moving_at_least_v = 0.003;
    std::size_t moving_rows = 12;           ///< at least
    double held_share = 0.34;               ///< of moving rows without a change, from which on a channel is held
    double most_channels = 0.5;             ///< share from which on it is the pack's way of reading
    double lag_from_s = -3, lag_to_s = 30;  ///< searched,
    double lag_rows = 12;          ///< and at least so many rows late: monitors are slow in rows, not in seconds
    double lag_gain = 0.1;         ///< share of the error that a lag must explain
    double late_rows = 1.5;        ///< from which on a lag is certain
    double grouped_share = 0.25;   ///< more channels than that are a group that is read later
    double least_rows_late = 0.5;  ///< of a delay that is named: less is a matter of the sampling
    double staggered_rows = 0.07;  ///< spread of sampling times that is reported: cells that differ look like less
    double staggered_sigmas = 6;   ///< the same over its standard deviation
    double missing_share = 0.2;    ///< of readings
    double step_c = 0.05;          ///< [C] step of the current for an apparent resistance
  } channels;

  /// When channels are read, from steps of the current that stand alone.
  struct SamplingTimes {
    double step_c = 0.1;           ///< [C] of the current, at least
    double quiet_share = 0.05;     ///< of the step: changes of the current in the two rows before and after
    double beginning = 0.02;       ///< of the step in the mean of its row, so that it is not a step of the next one
    double uneven = 0.1;           ///< of the times between rows
    std::size_t least_steps = 50;  ///< that stand alone
    double least_share = 0.5;      ///< their squares over those of all changes from row to row
    double least_seen = 0.1, most_seen = 0.97;  ///< of the steps, by the usual channel
    std::size_t parts = 20;                     ///< of the jackknife
    double rows_after = 1.5;                    ///< from a step to the row after its own, on average
  } sampling_times;

  /// Of a cell with more resistance.
  struct SelfHeating {
    double per_k = 0.03;  ///< that the resistances of a cell fall, as the published 2 to 4 %
  } self_heating;

  /// Of the current sensor.
  struct Sign {
    std::size_t most_rows_late = 6;                   ///< of the voltages
    std::array<std::size_t, 2> joined_rows = {3, 8};  ///< for slow changes
    std::size_t least_changes = 30;                   ///< of the current
    double least_correlation = 0.3;                   ///< of changes of voltage and current, against each other
    double share_of_cells = 0.75;                     ///< that must show it
  } sign;

  struct Sensors {
    double healthy_k = 1.2;          ///< difference of a temperature sensor to the median, at the start
    std::size_t start_rows = 60;     ///< whose median is the start
    double odds = 6;                 ///< [ln] posterior odds of a fault of this sensor against none of it
    double middle_k = 2, end_k = 1;  ///< the middle of a pack against its ends, an end against the middle: at rest
    double course_parameters = 2;    ///< of this course that few sensors show
    double fault_k = 20;             ///< standard deviation of a faulty one
    double least_k = 3;
    std::size_t least_sensors = 3;                        ///< two sensors do not show which one is wrong
    std::size_t many_sensors = 5;                         ///< from which on they show their own spread
    std::size_t most_sensors = 63, most_faulty = 3;       ///< of the search for sets of faulty ones
    double pack_gain = 0.004, pack_offset_share = 0.002;  ///< healthy voltmeter of a pack
    double pack_joint_share = 0.1;  ///< of the cells' resistance: cables and contactors within the pack's voltage
    double pack_sigmas = 5;         ///< times the healthy spread, from which on it is named
    double parallel_v = 0.002;      ///< error of a cell's channel that all cells share
  } sensors;

  /// Of the mean of the cells against the cell file. Sizes in C: of the current that charges the cell in an hour.
  struct Shared {
    static constexpr int ocv_waves = 6, resistance_waves = 3, charge_waves = 4;
    double block_s = 10, block_rows = 6;  ///< length of a block, at least
    double longest_gap_s = 600, longest_step_s = 60, least_hours = 0.5;
    double start_soc = 0.05;                                 ///< standard deviation of the start
    double healthy_offset_c = 0.0012, healthy_gain = 0.004;  ///< of a current sensor
    double healthy_capacity = 0.01;                          ///< of all cells, against the cell file
    double resistance = 1, per_k = 0.03, resistance_wave = 0.03;
    /// Of R1 next to R0: fast rows show both. Slow ones show only their sum, and a cell of any age has the file's ratio
    /// about; from this share of R1 on that shows within a row, over R0.
    double polarisation = 1, slow_polarisation = 0.3, slow_from = 0.1;
    /// The cells may be others than that of the file: errors of its OCV, over its tolerance, all as probable.
    std::array<double, 5> ocv_factors = {1, 2, 4, 8, 16};
    double another_cell = 3;    ///< RMS of these errors over the tolerance, from which on the file is of another cell
    double lead_rows = 1;       ///< standard deviation of the time between a row's mean current and its voltages
    double least_factor = 0.3;  ///< of the resistances against the cell file
    double fault_offset_c = 0.03, fault_gain = 0.1, fault_capacity = 0.15;
    double least_offset_c = 0.004, least_gain = 0.02, least_capacity = 0.04, most_capacity = 0.5;
    double no_walk = 1e-9;                           ///< [SOC] of a count that does not walk
    double soc_axis = 0.003, soc_walk = 0.0015;      ///< error of the SOC; the same after an hour
    double slope_reach = 0.005;                      ///< [SOC] over which the slope of the OCV is taken
    double most_offset_c = 0.04, search_soc = 0.02;  ///< of the search for a start: range, steps of the charge
    double most_start = 0.06, start_step = 0.01;
    double white_v = 0.0005, fast_v = 0.001, slow_v = 0.001;  ///< before the noise is learned
    int iterations = 8;
  } shared;

  /// Of intermittent sense wires.
  struct Wires {
    double least_v = 0.005;       ///< of a leap: less is within what a slow channel and noise can do
    double sigmas = 8;            ///< the same, of the usual changes from row to row
    double digits = 6;            ///< the same, of half a digit of a coarse reading
    double least_digit_v = 1e-6;  ///< less is how a double is rounded
    double single_cell = 0.5;     ///< change of the sum over the leap: it is 1 if one cell's channel alone leaps
    double most_along = 0.15;  ///< by which sum or the next cells change with the leaps; balancing: by a third or more
    double least_sigma_v = 0.0005;  ///< of a size
    double same_level = 0.25;       ///< of the leap: such levels are one
    std::size_t least_rows = 30, least_steps = 8;
    std::size_t rows = 5, rows_of_one_leap = 20;  ///< that are bad, at least: fewer are single odd readings
    std::size_t named = 3;                        ///< stretches with their times
  } wires;

  /// Of the residual of a fit, by the cell's state of charge.
  struct Misfit {
    static constexpr std::size_t bins = 20;
    double prior_rows = 100;  ///< that have the expected noise
  } misfit;

  struct Unexplained {
    double block_s = 300;      ///< over which differences are averaged
    double over_expected = 5;  ///< RMS of such means over what the pack's noise lasts
    double least_v = 0.002;    ///< RMS of such means that is worth a look
    std::size_t cells = 6;     ///< for a spread over the cells, at least
  } unexplained;

  /// Of the progress that is shown.
  struct Shares {
    double channels = 0.1, first = 0.4, noise = 0.5, second = 0.7, third = 0.9;
  } done;

  struct Fit {
    int iterations = 4, halvings = 3;
    int scale_rounds = 12, widenings = 16;
    double most_charge = 0.08, charge_step = 0.01, most_capacity = 0.3, capacity_step = 0.05;  ///< starting points
    std::size_t starting_rows = 600;
    double converged = 0.05;  ///< gain in cost
    double most_soc_step = 0.5;
  } fit;
};

inline constexpr PackThresholds limits{};

/// Constants of the normal distribution.
inline constexpr double abs_median_of_normal = 0.6745, chi_square_median = 0.4549;
/// Standard deviation of a uniform distribution over its width.
inline constexpr double sigma_of_uniform = 0.2887;

}  // namespace bms::diagnosis::pack
