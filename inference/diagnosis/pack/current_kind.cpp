#include "diagnosis/pack/current_kind.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

/// By row: the median over the cells of the change since the row before. One bad channel does not change it.
std::vector<double> changes_v(const PackRecording& pack) {
  std::vector<double> changes(pack.rows(), no_value), of_cells;
  for (std::size_t k = 1; k < pack.rows(); ++k) {
    of_cells.clear();
    for (const auto& v : pack.cell_v) of_cells.push_back(v[k] - v[k - 1]);
    changes[k] = measurement::median(of_cells);
  }
  return changes;
}

/// Squares and products of changes of the current and the voltage from row to row.
struct Changes {
  double aa = 0, av = 0, vv = 0, rows = 0;
  double two_rows_aa = 0, two_rows = 0;  ///< of the current over two rows

  double explained() const { return aa > 0 && vv > 0 && av > 0 ? av * av / (aa * vv) : 0; }
};

Changes changes_of(const PackRecording& pack) {
  const std::vector<double> dv = changes_v(pack);
  const std::vector<double>& a = pack.current_a;
  Changes c;
  for (std::size_t k = 1; k < pack.rows(); ++k) {
    const double da = a[k] - a[k - 1];
    if (!std::isfinite(da + dv[k])) continue;
    c.aa += da * da;
    c.av += da * dv[k];
    c.vv += dv[k] * dv[k];
    ++c.rows;
    if (k + 1 >= pack.rows() || !std::isfinite(a[k + 1])) continue;
    c.two_rows_aa += (a[k + 1] - a[k - 1]) * (a[k + 1] - a[k - 1]);
    ++c.two_rows;
  }
  return c;
}

}  // namespace

void find_current_kind(PackRecording& pack, double capacity_ah) {
  const Changes c = changes_of(pack);
  pack.single_readings = c.two_rows > 0 && c.explained() > limits.single_readings;
  pack.count_walk = 0;
  if (!pack.single_readings) return;
  const double square_a2 = c.aa / c.rows, two_rows_a2 = c.two_rows_aa / c.two_rows;
  std::vector<double> steps_s;
  for (std::size_t k = 1; k < pack.rows(); ++k) steps_s.push_back(pack.time_s[k] - pack.time_s[k - 1]);
  pack.usual_step_s = measurement::median(steps_s);
  const double independent = std::clamp(2 - two_rows_a2 / square_a2, 0.0, 1.0);
  const double share = (1 - independent) * limits.step_in_row + independent * limits.new_in_row;
  pack.count_walk = std::sqrt(share * square_a2 * pack.usual_step_s / limits.seconds_per_hour) / capacity_ah;
}

double mean_current_a(const PackRecording& pack, std::size_t k) {
  const double now_a = pack.current_a[k];
  if (!pack.single_readings || k == 0 || !std::isfinite(pack.current_a[k - 1])) return now_a;
  const bool is_gap = pack.time_s[k] - pack.time_s[k - 1] > limits.gap_steps * pack.usual_step_s;
  return is_gap ? now_a : (pack.current_a[k - 1] + now_a) / 2;
}

}  // namespace bms::diagnosis::pack
