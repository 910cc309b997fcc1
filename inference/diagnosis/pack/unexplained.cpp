#include "diagnosis/pack/unexplained.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

/// Of the residual's means over blocks of time: RMS, and the same over what is expected of them.
struct Lasting {
  double rms_v, over_expected;
};

Lasting lasting_of(const PackRecording& pack, const CellFit& fit) {
  measurement::MeanSquare blocks_v, ratios;
  double sum_v = 0, sum_v2 = 0, count = 0, since_s = pack.time_s.front();
  const auto end_block = [&] {
    if (count > 0) {
      const double mean_v = sum_v / count, white_v2 = fit.noise.white_v * fit.noise.white_v;
      blocks_v.add(mean_v);
      ratios.add(mean_v / std::sqrt((sum_v2 + white_v2) / count));
    }
    sum_v = sum_v2 = count = 0;
  };
  for (std::size_t k = 0; k < fit.residual_v.size(); ++k) {
    if (pack.time_s[k] - since_s > limits.unexplained.block_s) {
      end_block();
      since_s = pack.time_s[k];
    }
    if (!std::isfinite(fit.residual_v[k])) continue;
    sum_v += fit.residual_v[k];
    sum_v2 += fit.lasting_v2[k];
    ++count;
  }
  end_block();
  return {blocks_v.root(), ratios.root()};
}

}  // namespace

std::vector<UnexplainedCell> unexplained_cells(const PackRecording& pack, const std::vector<CellFit>& fits,
                                               const std::vector<std::size_t>& explained, double& usual_v) {
  std::vector<Lasting> all;
  std::vector<double> rms_v;
  for (const CellFit& fit : fits) {
    all.push_back(lasting_of(pack, fit));
    rms_v.push_back(all.back().rms_v);
  }
  usual_v = measurement::median(rms_v);
  std::vector<UnexplainedCell> cells;
  for (std::size_t c = 0; c < fits.size(); ++c) {
    const bool large =
        all[c].rms_v > limits.unexplained.least_v && all[c].over_expected > limits.unexplained.over_expected;
    const bool known = std::find(explained.begin(), explained.end(), c) != explained.end();
    if (large && !known) cells.push_back({c, all[c].rms_v, usual_v});
  }
  return cells;
}

}  // namespace bms::diagnosis::pack
