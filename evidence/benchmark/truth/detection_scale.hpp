// How visible a voltage difference is on a recording. The strength of an effect is stated in this unit.
//
//   noise     white + Ornstein-Uhlenbeck (1.5 mV, 60 s) + Ornstein-Uhlenbeck (1 mV, 1 h)
//   nuisance  OCV hats every 5 % of SOC, 1.5 mV; R0 hats every 20 %, 2 %; R1 5 %; start SOC 0.5 %; current offset 0.03
//   %
//             of 1C; capacity (and current gain) 0.2 %. For the last three the cell itself is simulated, with its
//             overvoltages.
//   lambda    d' P d, P the inverse of the covariance of both;  strength = sqrt(lambda) / 4.76
//
// At strength 1, a test with one false alarm in 2,000 (1 % over some 23 hypotheses) finds the effect nine times out of
// ten. A Kalman filter of both drifts whitens the noise in one pass; the nuisance columns pass through the same filter.
#pragma once

#include <memory>
#include <vector>

#include "benchmark/truth/concealed_cell.hpp"

namespace bms::benchmark::truth {

class DetectionScale {
 public:
  /// healthy: the trace of the cell without any effect under the stimulus. white_v: sigma of the white noise.
  DetectionScale(const HealthyCell& cell, const Stimulus& stimulus, const CellTrace& healthy, double white_v);
  ~DetectionScale();

  /// In detection limits.
  double strength(const std::vector<double>& difference_v) const { return overlap_root(difference_v, difference_v); }
  /// -1 to 1: similarity of two differences after the nuisances have been removed.
  double cosine_similarity(const std::vector<double>& a_v, const std::vector<double>& b_v) const;

 private:
  double overlap_root(const std::vector<double>& a_v, const std::vector<double>& b_v) const;
  struct Columns;
  std::unique_ptr<Columns> columns_;
};

}  // namespace bms::benchmark::truth
