#include "workflow/likeliest_start.hpp"

#include <algorithm>
#include <cmath>

#include "files/cell_file.hpp"
#include "measurement/thinned_recording.hpp"
#include "replay/simulation.hpp"

namespace bms::workflow {

namespace {

constexpr double known_sigma = 0.03;                     ///< of a start that a fit finds from its first voltage
constexpr double sigmas = 3;                             ///< searched on either side
constexpr double coarse_step = 0.01, fine_step = 0.002;  ///< of the search, in SOC
constexpr double clear_gain = 9;                         ///< three standard deviations
constexpr std::size_t most_rows = 2'000;                 ///< of the simulated recording
constexpr double least_error_v = 1e-3;

/// What speaks against a start: open-loop errors in standard deviations of the model, each counted once in its
/// correlation time, and the distance to the start from the first voltage.
class StartCost {
 public:
  StartCost(const measurement::Recording& recording, const files::CellFile& cell, const StartSoc& from)
      : recording_(measurement::thinned(recording, most_rows)), cell_(cell), from_(from) {
    const auto& p = cell.parameters;
    error_v_ = std::max(least_error_v, std::hypot(p.noise.model_v, p.tolerance.ocv_v));
    const double duration_s = recording.time_s.back() - recording.time_s.front();
    parts_ = std::max(1.0, duration_s / std::max(1.0, p.noise.model_correlation_s));
  }

  double operator()(double soc) const {
    double sum = 0;
    std::size_t k = 0, count = 0;
    replay::simulate({.cell = tables_,
                      .capacity_ah = cell_.parameters.capacity_ah,
                      .mechanisms = cell_.mechanisms,
                      .time_s = {recording_.time_s.data(), recording_.rows()},
                      .current_a = {recording_.current_a.data(), recording_.rows()},
                      .temperature_c = {recording_.temperature_c.data(), recording_.temperature_c.size()},
                      .initial_soc = soc},
                     [&](const replay::SimulatedRow& row) {
                       const double error_v = recording_.voltage_v[k++] - row.voltage_v;
                       if (!std::isfinite(error_v)) return;
                       sum += error_v * error_v;
                       ++count;
                     });
    if (count == 0) return 0;
    const double mean_v2 = sum / static_cast<double>(count), off = (soc - from_.soc) / from_.sigma;
    return parts_ * mean_v2 / (error_v_ * error_v_) + off * off;
  }

 private:
  measurement::Recording recording_;
  const files::CellFile& cell_;
  StartSoc from_;
  replay::HostCell<double> tables_ = model::prepare<double, model::max_intervals>(cell_.parameters);
  double error_v_ = 0, parts_ = 1;
};

/// The best of the starts from `low` to `high`.
double best_between(const StartCost& cost, double low, double high, double by) {
  double best = low, least = cost(low);
  for (double soc = low + by; soc <= high; soc += by) {
    const double here = cost(soc);
    if (here >= least) continue;
    least = here;
    best = soc;
  }
  return best;
}

}  // namespace

StartSoc likeliest_start(const measurement::Recording& recording, const files::CellFile& cell, const StartSoc& from) {
  if (from.given || from.sigma <= known_sigma || recording.rows() < 2) return from;
  const StartCost cost(recording, cell, from);
  const auto limited = [](double soc) { return std::clamp(soc, 0.0, 1.0); };
  const double coarse =
      best_between(cost, limited(from.soc - sigmas * from.sigma), limited(from.soc + sigmas * from.sigma), coarse_step);
  const double best = best_between(cost, limited(coarse - coarse_step), limited(coarse + coarse_step), fine_step);
  if (cost(from.soc) - cost(best) < clear_gain) return from;
  return {best, from.sigma, false};
}

}  // namespace bms::workflow
