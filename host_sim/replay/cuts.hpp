// Trials of the estimator's start: a recording with soc_ref is cut at many places, and the estimator starts at each of
// them with a state of charge that is right, wrong or unknown. Figures over all cuts show how fast it recovers, and
// whether its standard deviation is honest.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "replay/cut_calibration.hpp"
#include "replay/replay.hpp"

namespace bms::replay {

/// How the estimator starts at a cut.
struct CutStart {
  const char* id;
  const char* title;
  bool known;    ///< otherwise it starts from the first voltage alone
  double off;    ///< error of the initial SOC, >= 0. Its sign alternates; where the SOC would leave 0..1 it is turned
  double sigma;  ///< standard deviation that the estimator is given
  bool drawn = false;  ///< the errors are quantiles of a normal distribution with this sigma, each at one cut
};
/// A start that is exactly right is better than the sigma that it is given; only one that is drawn shows whether sigma
/// is too wide.
inline constexpr std::array cut_starts{CutStart{"right", "right, sigma 2 %", true, 0, 0.02},
                                       CutStart{"drawn", "drawn from sigma 2 %", true, 0, 0.02, true},
                                       CutStart{"wrong_20", "20 % wrong, sigma 20 %", true, 0.2, 0.2},
                                       CutStart{"wrong_30", "30 % wrong, sigma 30 %", true, 0.3, 0.3},
                                       CutStart{"confident", "20 % wrong, sigma 2 %", true, 0.2, 0.02},
                                       CutStart{"unknown", "unknown", false, 0, 0}};

/// Times after a cut from which errors are counted [s].
inline constexpr std::array<double, 3> cut_from_s{300, 1'800, 7'200};

/// Shares of the rows inside two sigma below which a run is counted.
inline constexpr std::array<double, 2> cut_inside_limits{0.7, 0.9};

/// The run from one cut to the end of the recording.
struct CutRun {
  double from_s = 0;  ///< time of the cut in the recording
  double duration_s = 0;
  std::size_t rows = 0;                     ///< with a reference
  std::array<double, 3> rmse{}, largest{};  ///< of the SOC, from cut_from_s; NaN: the recording ends before
  std::array<double, 3> inside{};           ///< share of the rows inside one, two, three sigma
  double median_ratio = 0;                  ///< median of |error| / sigma
  double median_sigma = 0;
  std::optional<double> knee_s;       ///< time from the cut until the SOC has crossed a knee of the OCV
  double rmse_after_knee = 0;         ///< later than that and than half an hour; NaN: the recording ends before
  std::optional<double> recovered_s;  ///< time from the cut until the truth stays inside two sigma for half an hour
};

/// All cuts with one kind of start.
struct CutFigures {
  CutStart start{};
  std::vector<CutRun> runs;
  std::array<double, 3> median_rmse{}, worst_rmse{}, largest{};              ///< over the runs, from cut_from_s
  double median_rmse_after_knee = std::numeric_limits<double>::quiet_NaN();  ///< of CutRun::rmse_after_knee
  std::array<double, 3> inside{};                                            ///< over all rows of all runs
  double worst_inside = 0;                                                   ///< two sigma, of the worst run
  std::array<std::size_t, 2> cuts_below{};  ///< runs with a smaller share inside two sigma than cut_inside_limits
  double median_ratio = 0;                  ///< median of |error| / sigma over all rows of all runs
  double median_sigma = 0;
  /// Share of the runs that are inside two sigma again within half an hour of the first knee or four hours of the
  /// cut. A run that ends before both, and is not, does not count.
  double recovered = 0;
  Calibrations calibration{};  ///< of all rows of all runs
};

struct CutResult {
  std::string recording, cell;
  std::size_t cuts = 0;
  std::vector<CutFigures> starts;
};

/// SOCs at which the OCV turns from flat to steep: edges where the slope, averaged over 3 % of charge on each side,
/// changes by a factor of 2.5 or more.
std::vector<double> ocv_knees(const model::CellParameters<>& parameters);

/// Runs all starts at `cuts` places, equally spaced in time, on two threads. Throws BadInput if the recording has no
/// soc_ref.
CutResult run_cuts(const files::CellFile& cell, const measurement::Recording& recording, std::size_t cuts,
                   ScalarKind scalar = ScalarKind::float32);

/// Heading and rows of a Markdown table: one row for each start.
std::string cut_heading();
std::string cut_rows(const CutResult& result);

/// Markdown: one row for each start over the cuts of all results. Each cut counts once.
std::string cut_summary(const std::vector<CutResult>& results);

}  // namespace bms::replay
