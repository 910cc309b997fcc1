// What is more than chance over many recordings.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace bms::fleet {

/// NaN of nothing.
double median(std::vector<double> values);

/// Probability of at least `count` false alarms in `trials` recordings of one cell. mean: of a recording. correlation:
/// of two recordings of one cell, 0 to 1: a cell whose cell file does not fit gives false alarms again and again, which
/// is more dispersion than that of a binomial distribution. The distribution is beta-binomial.
double false_alarm_probability(std::size_t count, std::size_t trials, double mean, double correlation);

/// Smallest false discovery rate at which each hypothesis is accepted (Benjamini and Hochberg), in the order of
/// p_values. tests: number of all hypotheses; those that are not in the list have the p-value 1.
std::vector<double> false_discovery_rates(const std::vector<double>& p_values, std::size_t tests);

/// A reading of one day with its standard deviation.
struct Reading {
  double day = 0, value = 0, sigma = 0;
};

/// A weighted mean. Its sigma follows from the scatter around it, but is at least what half of the stated sigmas gives.
struct Mean {
  double value = 0, sigma = 0;
};
/// Nothing for fewer than 4 readings.
std::optional<Mean> mean_of(const std::vector<Reading>& readings);

/// value = level + per_day (day - middle).
struct Trend {
  double middle = 0, level = 0, level_sigma = 0;
  double per_day = 0, per_day_sigma = 0;
  double at(double day) const { return level + per_day * (day - middle); }
};

/// A weighted straight line. The slope's sigma follows from the scatter around the line, but is at least what half of
/// the stated sigmas gives: part of them is common to all readings. The level's sigma is at least the smallest stated
/// one. Nothing for fewer than 4 readings or 3 days.
std::optional<Trend> trend_of(const std::vector<Reading>& readings);

/// Days until a trend reaches a limit: likely, and where it is one sigma steeper or flatter.
struct Crossing {
  double day = 0, earliest = 0;
  std::optional<double> latest;  ///< nothing: perhaps never
};
/// Nothing if the slope does not lead to the limit with 3 sigma, or only after `most_days` from the trend's middle.
std::optional<Crossing> crossing_of(const Trend& trend, double limit, double most_days);

/// Whether a limit has a day: a crossing, or why it has no day.
enum class Outlook {
  forecast,      ///< crossing_of() has the day
  reached,       ///< by the trend, or without one by the last reading
  few_readings,  ///< fewer than fewest_readings
  short_time,    ///< a trend needs shortest_days
  no_slope,      ///< not towards the limit by 3 sigma
  far            ///< after most_days
};
inline constexpr std::size_t fewest_readings = 4;  ///< of a mean or a trend
inline constexpr double shortest_days = 3;
/// readings: at least one, ascending by day. trend: what trend_of() says of them.
Outlook outlook_of(const std::vector<Reading>& readings, const std::optional<Trend>& trend, double limit,
                   double most_days);

/// A value that is constant up to a day and then changes in proportion to time.
struct Onset {
  double day = 0;  ///< of the first change
  double per_day = 0;
  double before = 0;   ///< value up to that day
  double p_value = 1;  ///< of no change at all
};

/// The best onset. scatter: standard deviation of a reading from day to day, above 0; a reading with a sigma of its own
/// counts less. Nothing for fewer than 5 readings.
std::optional<Onset> onset_of(const std::vector<Reading>& readings, double scatter);

/// Of events on some days: the first day of a time with many, as the two rates before and after it make most probable.
/// happened: in order of time. Index of the first day; size() if nothing happened.
std::size_t first_of_many(const std::vector<bool>& happened);

/// Probability of false alarms as in `happened`, in order of time, or of more: as many in all, or as many since the day
/// from which there are many. The factors for that choice are in it.
double false_alarm_probability(const std::vector<bool>& happened, double mean, double correlation);

}  // namespace bms::fleet
