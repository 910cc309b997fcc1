#include "diagnosis/pack/unexplained.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

/// RMS of the residual's means over blocks of time.
double rms_of_blocks(const PackRecording& pack, const std::vector<double>& residual_v) {
  measurement::MeanSquare blocks;
  double sum = 0, count = 0, since_s = pack.time_s.front();
  for (std::size_t k = 0; k < residual_v.size(); ++k) {
    if (pack.time_s[k] - since_s > limits.unexplained.block_s) {
      if (count > 0) blocks.add(sum / count);
      sum = count = 0;
      since_s = pack.time_s[k];
    }
    if (!std::isfinite(residual_v[k])) continue;
    sum += residual_v[k];
    ++count;
  }
  if (count > 0) blocks.add(sum / count);
  return blocks.root();
}

}  // namespace

std::vector<UnexplainedCell> unexplained_cells(const PackRecording& pack, const std::vector<CellFit>& fits,
                                               const std::vector<std::size_t>& explained, double& usual_v) {
  constexpr const PackThresholds::Unexplained& u = limits.unexplained;
  std::vector<double> rms, logs, apart;
  for (const CellFit& fit : fits) {
    rms.push_back(rms_of_blocks(pack, fit.residual_v));
    logs.push_back(std::log(std::max(rms.back(), limits.noise.least_v)));
  }
  usual_v = measurement::median(rms);
  std::vector<UnexplainedCell> cells;
  if (fits.size() < u.cells) return cells;
  const double middle = measurement::median(logs);
  for (const double l : logs) apart.push_back(std::abs(l - middle));
  const double scale = measurement::median(apart) / abs_median_of_normal;
  for (std::size_t c = 0; c < fits.size(); ++c) {
    const bool large =
        rms[c] > u.least_v && 2 * (logs[c] - middle) > std::log(u.ratio) && logs[c] - middle > u.scales * scale;
    const bool known = std::find(explained.begin(), explained.end(), c) != explained.end();
    if (large && !known) cells.push_back({c, rms[c], usual_v});
  }
  return cells;
}

}  // namespace bms::diagnosis::pack
