#include "diagnosis/law_evidence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string_view>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/generic_columns.hpp"
#include "diagnosis/law_thresholds.hpp"
#include "diagnosis/residual_projection.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"
#include "numerics/in_parallel.hpp"
#include "numerics/symmetric_eigen.hpp"

namespace bms::diagnosis {

namespace {

constexpr const EvidenceThresholds& evidence_limits = law_thresholds.law;
constexpr const LeapThresholds& leap_limits = law_thresholds.leaps;

/// A form of a law: neighbouring columns.
struct LawForm {
  const char *law, *depends_on;
  Eigen::Index first, count;
  bool outside_catalogue = false;  ///< no mechanism of the catalogue has it
};

/// Of a family of generic columns. What depends on the charge and the direction is hysteresis: a law of the OCV.
struct FamilyForm {
  std::string_view family;
  const char *law, *depends_on;
  bool outside_catalogue = false;
};
constexpr std::array<FamilyForm, 7> family_forms = {{
    {"the state of charge and the direction", "ocv", "soc"},
    {"the state of charge", "ocv", "soc"},
    {"the voltage itself", "voltage", "voltage", true},
    {"the load at a state of charge", "ohmic", "soc"},
    {"how far the voltage has moved: a reading that follows in leaps", "voltage", "voltage", true},
    {"the time", "", "time"},
    {"the load at a time", "ohmic", "time"},
}};

constexpr std::size_t fast_sizes = evidence_limits.fast_s.size(), slow_sizes = evidence_limits.slow_s.size(),
                      late_rows = evidence_limits.late_rows;

/// Columns that the generic ones do not have. For each time constant: of the load before.
namespace column {
constexpr auto fast_count = static_cast<Eigen::Index>(fast_sizes), slow_count = static_cast<Eigen::Index>(slow_sizes),
               late_count = 2 * static_cast<Eigen::Index>(late_rows);
constexpr Eigen::Index bent = 0,         // the load's size times the load
    fast = bent + 1,                     // the load before, within a minute
    slow = fast + fast_count,            // within hours
    ahead = slow + slow_count,           // a part of the cell whose charge is ahead, or behind
    slow_size = ahead + 2 * slow_count,  // the load before, whatever its direction, and the charging
    warm = slow_size + 2 * slow_count,   // measured temperature, alone and with the load
    heated = warm + 2,                   // heat of the load, with the load
    late = heated + 1,                   // the load of neighbouring rows
    charged = late + late_count,         // charge that was counted wrongly: in, out, with the time
    discharged = charged + 1, elapsed = discharged + 1, all = elapsed + 1;
}  // namespace column

constexpr std::array<LawForm, 9> extra_forms = {{
    {"ohmic", "current", column::bent, 1},
    {"fast", "time", column::fast, column::fast_count},
    {"slow", "time", column::slow, column::slow_count},
    {"slow", "soc", column::ahead, 2 * column::slow_count},
    {"slow", "current", column::slow_size, 2 * column::slow_count, true},
    {"temperature", "temperature", column::warm, 2},
    {"temperature", "time", column::heated, 1},
    {"timing", "current", column::late, column::late_count},
    {"charge", "time", column::charged, column::all - column::charged},
}};

/// Filters of the load, one per time constant.
template <std::size_t N>
void follow_load(std::array<double, N>& state, const std::array<double, N>& time_s, double duration_s, double target) {
  for (std::size_t t = 0; t < N; ++t) state[t] += (1 - std::exp(-duration_s / time_s[t])) * (target - state[t]);
}

/// All of one recording. largest_a: of all recordings.
void fill_law_columns(const LikelihoodModel& likelihood, const HypothesisFit& fit, std::size_t n, double largest_a,
                      Eigen::Ref<Columns> rows) {
  const PreparedRecording& r = likelihood.records()[n];
  const auto table = model::prepare<double, model::max_intervals>(likelihood.cell());
  const auto ocv_v = [&](double at) { return model::look_up(table, at).ocv_v; };
  constexpr double shift = evidence_limits.ahead_soc, small = evidence_limits.slope_soc;
  std::vector<double> soc;
  static_cast<void>(likelihood.voltage(fit.hypothesis, fit.calibration, n, &soc));
  std::array<double, fast_sizes> fast_load{};
  std::array<double, slow_sizes> slow_load{}, slow_magnitude{}, slow_charging{};
  std::vector<double> loads;
  double heat = 0, charged = 0, discharged = 0;
  const double hours = std::max(r.duration_s(), 1.0);
  for_each_row(r, likelihood.cell().capacity_ah, [&](const CountedRow& row) {
    const auto k = static_cast<Eigen::Index>(row.k);
    const double load = row.current_a / largest_a, dt = row.duration_s,
                 slope = (ocv_v(soc[row.k] + small) - ocv_v(soc[row.k] - small)) / (2 * small);
    loads.push_back(load);
    follow_load(fast_load, evidence_limits.fast_s, dt, load);
    follow_load(slow_load, evidence_limits.slow_s, dt, load);
    follow_load(slow_magnitude, evidence_limits.slow_s, dt, std::abs(load));
    follow_load(slow_charging, evidence_limits.slow_s, dt, std::max(load, 0.0));
    heat += (1 - std::exp(-dt / thresholds.residual.heat_s)) * (load * load - heat);
    (row.moved_soc > 0 ? charged : discharged) += row.moved_soc;
    const auto put = [&](Eigen::Index at, double value) { rows(k, at) = thresholds.residual.free_v * value; };
    put(column::bent, std::abs(load) * load);
    for (std::size_t t = 0; t < fast_sizes; ++t) put(column::fast + static_cast<Eigen::Index>(t), fast_load[t]);
    for (std::size_t t = 0; t < slow_sizes; ++t) {
      const auto at = static_cast<Eigen::Index>(t);
      put(column::slow + at, slow_load[t]);
      for (const Eigen::Index side : {0, 1}) {
        const double moved = (side == 0 ? shift : -shift) * slow_load[t];
        rows(k, column::ahead + 2 * at + side) = ocv_v(soc[row.k] + moved) - ocv_v(soc[row.k]);
      }
      put(column::slow_size + 2 * at, slow_magnitude[t]);
      put(column::slow_size + 2 * at + 1, slow_charging[t]);
    }
    const double kelvin = r.temperature_c.empty() || !std::isfinite(r.temperature_c[row.k])
                              ? 0
                              : (r.temperature_c[row.k] - evidence_limits.middle_c) / evidence_limits.swing_k;
    put(column::warm, kelvin);
    put(column::warm + 1, kelvin * load);
    put(column::heated, heat * load);
    put(column::charged, slope * charged);
    put(column::discharged, slope * discharged);
    put(column::elapsed, slope * (r.time_s[row.k] - r.time_s.front()) / hours);
  });
  for (std::size_t k = 0; k < loads.size(); ++k) {
    for (std::size_t by = 1; by <= late_rows; ++by) {
      const double before = loads[k - std::min(k, by)], after = loads[std::min(k + by, loads.size() - 1)];
      const auto at = column::late + 2 * static_cast<Eigen::Index>(by - 1);
      rows(static_cast<Eigen::Index>(k), at) = thresholds.residual.free_v * (before - loads[k]);
      rows(static_cast<Eigen::Index>(k), at + 1) = thresholds.residual.free_v * (after - loads[k]);
    }
  }
}

Columns law_columns(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  Columns columns = Columns::Zero(static_cast<Eigen::Index>(likelihood.samples()), column::all);
  double largest_a = numerics.grid.current_least_a;
  for (const PreparedRecording& r : likelihood.records()) {
    for (const double a : r.current_a) {
      if (std::isfinite(a)) largest_a = std::max(largest_a, std::abs(a));
    }
  }
  Eigen::Index first = 0;
  for (std::size_t n = 0; n < likelihood.records().size(); ++n) {
    const auto rows = static_cast<Eigen::Index>(likelihood.records()[n].size());
    fill_law_columns(likelihood, fit, n, largest_a, columns.middleRows(first, rows));
    first += rows;
  }
  return columns;
}

/// With the width of the prior that has the most evidence.
double evidence_of(const Eigen::MatrixXd& gram, const Eigen::VectorXd& toward) {
  const numerics::SymmetricEigen eigen = numerics::symmetric_eigen(gram);
  const Eigen::VectorXd power = eigen.values.cwiseMax(0.0),
                        along = (eigen.vectors.transpose() * toward).array().square();
  double best = 0;
  for (double width = evidence_limits.narrowest; width <= evidence_limits.widest; width *= 2) {
    const double s2 = width * width;
    const Eigen::ArrayXd grown = 1 + s2 * power.array();
    best = std::max(best, (s2 * along.array() / grown).sum() - grown.log().sum());
  }
  return best;
}

void add_evidence(std::vector<LawEvidence>& found, const char* law, const char* depends_on, double gain,
                  bool outside_catalogue) {
  auto same =
      std::find_if(found.begin(), found.end(), [&](const LawEvidence& e) { return std::string_view(e.law) == law; });
  if (same == found.end()) same = found.insert(found.end(), {law, depends_on, 0, 0});
  if (outside_catalogue) same->outside_catalogue = std::max(same->outside_catalogue, gain);
  if (gain <= same->gain) return;
  same->depends_on = depends_on;
  same->gain = gain;
}

/// Of the frequency that explains most, less what the best of so many explains by chance.
double evidence_of_a_wave(const LikelihoodModel& likelihood, const ResidualProjection& projection) {
  const std::vector<double> all_hz = strange_frequencies(likelihood.records().front());
  constexpr std::size_t at_once = numerics.grid.frequencies_at_once;
  std::vector<double> best((all_hz.size() + at_once - 1) / at_once);
  numerics::in_parallel(best.size(), [&](std::size_t k) {
    const std::size_t first = k * at_once, count = std::min(at_once, all_hz.size() - first);
    Columns white = sine_columns(likelihood, std::span(all_hz).subspan(first, count));
    white *= thresholds.residual.free_v;
    likelihood.whiten(white);
    const ResidualProjection::Products products = projection.of(white);
    for (std::size_t f = 0; f < count; ++f) {
      const Eigen::Index at = 2 * static_cast<Eigen::Index>(f);
      best[k] = std::max(best[k], evidence_of(products.gram(at, 2), products.toward().segment(at, 2)));
    }
  });
  double most = 0;
  for (const double b : best) most = std::max(most, b);
  return std::max(0.0, most - 2 * std::log(std::max<double>(1, static_cast<double>(all_hz.size()))));
}

}  // namespace

bool another_law_explains_more(const std::vector<LawEvidence>& laws, double gain, double remaining) {
  double outside_catalogue = 0;
  for (const LawEvidence& e : laws) outside_catalogue = std::max(outside_catalogue, e.outside_catalogue);
  return remaining > 0 && outside_catalogue > gain - remaining - thresholds.decision.tie;
}

bool follows_in_leaps(const PreparedRecording& r) {
  std::vector<double> read, moves;
  for (const double v : r.voltage_v) {
    if (!std::isfinite(v)) continue;
    if (!read.empty() && v != read.back()) moves.push_back(std::abs(v - read.back()));
    read.push_back(v);
  }
  if (moves.size() < leap_limits.moves) return false;
  // one that moves in every row follows a load that does
  if (static_cast<double>(read.size() - moves.size()) < leap_limits.stands * static_cast<double>(read.size()))
    return false;
  std::sort(read.begin(), read.end());
  std::vector<double> gaps;
  for (std::size_t k = 1; k < read.size(); ++k) {
    if (read[k] - read[k - 1] > leap_limits.same_v) gaps.push_back(read[k] - read[k - 1]);
  }
  if (gaps.empty()) return false;
  const double resolution_v = measurement::upper_median(gaps),
               least_v = measurement::quantile(moves, leap_limits.least_quantile);
  // a noisy channel has small moves as well; one with coarse steps moves by one of them
  return least_v > leap_limits.steps * resolution_v &&
         least_v > leap_limits.of_median * measurement::upper_median(moves);
}

bool is_read_in_leaps(const std::vector<PreparedRecording>& records) {
  return std::any_of(records.begin(), records.end(), follows_in_leaps);
}

std::vector<LawEvidence> law_evidence(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  const ResidualProjection projection(likelihood, fit);
  std::vector<LawEvidence> found;
  GenericColumns generic = generic_columns(likelihood, fit);
  likelihood.whiten(generic.columns);
  const ResidualProjection::Products of_generic = projection.of(generic.columns);
  for (const ColumnFamily& f : generic.families) {
    const auto form = std::find_if(family_forms.begin(), family_forms.end(),
                                   [&](const FamilyForm& x) { return x.family == f.depends_on; });
    if (form == family_forms.end()) continue;
    add_evidence(found, form->law, form->depends_on,
                 evidence_of(of_generic.gram(f.first, f.count), of_generic.toward().segment(f.first, f.count)),
                 form->outside_catalogue);
  }
  Columns more = law_columns(likelihood, fit);
  likelihood.whiten(more);
  const ResidualProjection::Products of_more = projection.of(more);
  for (const LawForm& f : extra_forms)
    add_evidence(found, f.law, f.depends_on,
                 evidence_of(of_more.gram(f.first, f.count), of_more.toward().segment(f.first, f.count)),
                 f.outside_catalogue);
  add_evidence(found, "voltage", "time", evidence_of_a_wave(likelihood, projection), true);
  std::sort(found.begin(), found.end(), [](const LawEvidence& a, const LawEvidence& b) { return a.gain > b.gain; });
  return found;
}

}  // namespace bms::diagnosis
