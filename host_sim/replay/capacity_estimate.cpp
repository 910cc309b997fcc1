#include "replay/capacity_estimate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "estimator/persistent_errors.hpp"
#include "model/cell.hpp"
#include "model/one_rc.hpp"
#include "replay/judgement.hpp"
#include "replay/simulation.hpp"

namespace bms::replay {

namespace {

constexpr double table_v = 0.010;         ///< hysteresis and the table's own error
constexpr double resistance_share = 0.3;  ///< of the drop under current, which age and cold change
constexpr double stretch_soc = 0.01, stretch_s = 900;
constexpr double least_ratio = 0.5, most_ratio = 1.3;
constexpr int tried_ratios = 161, tried_starts = 241;
constexpr std::size_t most_stretches = 400;
constexpr double shared_soc = 0.2;  ///< over which the error of the table and of the resistances changes
constexpr std::size_t ocv_points = 1'101;
constexpr double soc_low = -0.05, soc_high = 1.05;
constexpr double known_to = 0.06;         ///< relative standard deviation
constexpr double worst_fit = 3;           ///< chi2 for each stretch
constexpr double longest_unknown_s = 72;  ///< 2 % of a capacity at 1C
constexpr double gain_share = 0.01;       ///< of the current sensor: the capacity is only as good as the charge
constexpr double differs_sigmas = 3, differs_by = 0.05;

/// A part of the log: the charge counted until its middle, and the open-circuit voltage that was seen there.
struct Stretch {
  double charge_ah = 0, ocv_v = 0, sigma_v = 0;
};

class Stretches {
 public:
  explicit Stretches(const ReplayResult& r)
      : r_(r), cell_(model::prepare<double, model::max_intervals>(r.cell.parameters)) {}

  std::vector<Stretch> all() {
    const measurement::Recording& rec = r_.recording;
    double charge_ah = 0, from_ah = 0, from_s = rec.time_s.front(), current_a = 0;
    for (std::size_t k = 0; k < rec.rows(); ++k) {
      const double hours = k == 0 ? 0 : (rec.time_s[k] - rec.time_s[k - 1]) / 3'600;
      if (!std::isnan(rec.current_a[k])) current_a = rec.current_a[k];
      charge_ah += current_a * hours;
      const bool over = std::abs(charge_ah - from_ah) > stretch_soc * r_.cell.parameters.capacity_ah ||
                        rec.time_s[k] - from_s > stretch_s;
      if (over) {
        end();
        from_ah = charge_ah;
        from_s = rec.time_s[k];
      }
      add(k, charge_ah, current_a, current_a * hours);
    }
    end();
    return std::move(list_);
  }

 private:
  /// moved_ah: since the row before.
  void add(std::size_t k, double charge_ah, double current_a, double moved_ah) {
    const EstimateRow e = r_.track.rows[k];
    constexpr std::uint32_t unusable =
        estimator::voltage_missing | estimator::voltage_implausible | estimator::voltage_stuck;
    if ((e.flags & unusable) != 0 || std::isnan(r_.recording.voltage_v[k])) return;
    // An extended cell file's mechanisms have no value of their own in a row, but are part of the prediction. That is
    // of the state before this row's voltage corrected it, everything else of the one after.
    const bool predicted = !r_.cell.mechanisms.empty();
    const double counted_ah = r_.counted_capacity_ah.value_or(r_.cell.parameters.capacity_ah),
                 before = k == 0 ? e.soc : r_.track.rows[k - 1].soc + moved_ah / counted_ah;
    const auto at = model::look_up(cell_, predicted ? before : e.soc, interval_);
    const double rested_v = model::OneRc<double>::voltage({}, at, {0, 0});
    const double drop_v = predicted ? e.voltage_predicted_v - rested_v
                                    : model::OneRc<double>::voltage({}, at, {current_a, 0}) - rested_v + e.v_rc_v;
    sum_.charge_ah += charge_ah;
    sum_.ocv_v += r_.recording.voltage_v[k] - drop_v;
    sum_.sigma_v += std::abs(drop_v);
    ++count_;
  }
  void end() {
    if (count_ == 0) return;
    const double n = count_;
    const double tolerance_v = std::max(table_v, r_.cell.parameters.tolerance.ocv_v);
    list_.push_back({sum_.charge_ah / n, sum_.ocv_v / n, std::hypot(tolerance_v, resistance_share * sum_.sigma_v / n)});
    sum_ = {};
    count_ = 0;
  }

  const ReplayResult& r_;
  HostCell<double> cell_;
  std::uint8_t interval_ = 0;
  Stretch sum_;
  int count_ = 0;
  std::vector<Stretch> list_;
};

/// The OCV of the cell file, from its clamped range on with a steep end: no cell is emptier than empty.
class Ocv {
 public:
  explicit Ocv(const files::CellFile& cell) {
    const auto prepared = model::prepare<double, model::max_intervals>(cell.parameters);
    std::uint8_t interval = 0;
    for (std::size_t k = 0; k < table_.size(); ++k) {
      const double soc = soc_low + (soc_high - soc_low) * static_cast<double>(k) / (ocv_points - 1.0);
      const double inside = std::clamp(soc, 0.0, 1.0);
      constexpr double steep_v = 20;  // for each unit of SOC
      table_[k] = model::OneRc<double>::voltage({}, model::look_up(prepared, inside, interval), {0, 0}) +
                  steep_v * (soc - inside);
    }
  }
  double operator()(double soc) const {
    const double at = (std::clamp(soc, -1.0, 2.0) - soc_low) / (soc_high - soc_low) * (ocv_points - 1.0);
    const auto k = static_cast<std::size_t>(std::clamp(at, 0.0, ocv_points - 2.0));
    return table_[k] + (at - static_cast<double>(k)) * (table_[k + 1] - table_[k]);
  }

 private:
  std::array<double, ocv_points> table_{};
};

/// Every n-th, so that a log of a year takes no longer.
std::vector<Stretch> thinned(const std::vector<Stretch>& all) {
  std::vector<Stretch> list;
  const std::size_t every = all.size() / most_stretches + 1;
  for (std::size_t k = 0; k < all.size(); k += every) list.push_back(all[k]);
  return list;
}

/// What a stretch says beyond the stretches before it. Errors are in units of sigma_v. A part of them comes and goes,
/// the rest is shared with the stretches nearby: a Kalman filter of that rest, the same for every capacity.
struct Weight {
  double decays = 0;     ///< what is left of the shared error since the stretch before
  double gain = 0;       ///< of the shared error
  double deviation = 1;  ///< standard deviation of the error less what was expected
};

std::vector<Weight> weights_of(const std::vector<Stretch>& list, double file_ah) {
  constexpr double own = estimator::uncorrelated_share, shared = 1 - own;
  std::vector<Weight> weights;
  double known = shared;  // variance of the shared error
  for (std::size_t k = 0; k < list.size(); ++k) {
    Weight w;
    const double moved_ah = k == 0 ? 0 : std::abs(list[k].charge_ah - list[k - 1].charge_ah);
    w.decays = std::exp(-moved_ah / (shared_soc * file_ah));
    known = shared + w.decays * w.decays * (known - shared);
    w.gain = known / (known + own);
    w.deviation = std::sqrt(known + own);
    known *= 1 - w.gain;
    weights.push_back(w);
  }
  return weights;
}

double chi2_of(const std::vector<Stretch>& list, const std::vector<Weight>& weights, const Ocv& ocv, double capacity_ah,
               double soc0) {
  constexpr double far = 3;  // sigmas from where on a stretch counts linearly: a single odd one does not decide
  double chi2 = 0, shared = 0;
  for (std::size_t k = 0; k < list.size(); ++k) {
    const Stretch& s = list[k];
    shared *= weights[k].decays;
    const double off = (ocv(soc0 + s.charge_ah / capacity_ah) - s.ocv_v) / s.sigma_v - shared,
                 most = far * weights[k].deviation, z = std::abs(off) / weights[k].deviation,
                 used = z < far ? off : std::copysign(most, off);
    chi2 += z < far ? z * z : far * (2 * z - far);
    shared += weights[k].gain * used;
  }
  return chi2;
}

std::size_t count(const Estimates& rows, std::uint32_t flag, std::size_t& first) {
  std::size_t found = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if ((rows.flags(k) & flag) == 0) continue;
    if (found++ == 0) first = k;
  }
  return found;
}

/// Time for which no current is known [s].
double unknown_s(const ReplayResult& r) {
  constexpr std::uint32_t unknown = estimator::time_gap | estimator::current_missing | estimator::current_implausible;
  double sum_s = 0;
  for (std::size_t k = 1; k < r.track.rows.size(); ++k) {
    if ((r.track.rows.flags(k) & unknown) != 0) sum_s += r.recording.time_s[k] - r.recording.time_s[k - 1];
  }
  return sum_s;
}

/// By how much a current of the log may be off all the time [A]: what the filter found, and how sure it is of that;
/// else what the cell file allows.
double offset_a(const ReplayResult& r) {
  const double allowed_a = r.cell.parameters.noise.current_offset_a;
  if (!r.soc.current_offset_a) return allowed_a;
  return std::min(allowed_a, std::hypot(*r.soc.current_offset_a, *r.soc.current_offset_sigma_a));
}

/// What contradicts most likely.
std::string cause_of(const ReplayResult& r) {
  if (capacity_differs(r)) return "the capacity of the cell file";
  const auto& offset = r.soc.current_offset_a;
  if (offset && std::abs(*offset) > 2 * *r.soc.current_offset_sigma_a) return "an offset of the current sensor";
  for (const measurement::Warning& w : r.recording.warnings) {
    if (w.id == "charge_exceeds_capacity") return "the capacity of the cell file, or an offset of the current sensor";
  }
  if (r.prior) return "the initial state of charge that was given, or the cell file";
  return r.capacity ? "an offset of the current sensor, or the cell file" : "the capacity or another cell file";
}

}  // namespace

bool capacity_differs(const ReplayResult& r) {
  if (!r.capacity) return false;
  const double by = std::abs(r.capacity->value_ah - r.cell.parameters.capacity_ah);
  return by > differs_sigmas * r.capacity->std_ah && by > differs_by * r.cell.parameters.capacity_ah;
}

std::optional<CapacityEstimate> estimate_capacity(const ReplayResult& r) {
  const std::vector<Stretch> list = thinned(Stretches(r).all());
  if (list.size() < 3 || unknown_s(r) > longest_unknown_s) return std::nullopt;
  const Ocv ocv(r.cell);
  const double file_ah = r.cell.parameters.capacity_ah;
  const std::vector<Weight> weights = weights_of(list, file_ah);
  std::vector<std::pair<double, double>> chi2;  // capacity, -2 ln of its probability
  double best = INFINITY;
  for (int c = 0; c < tried_ratios; ++c) {
    const double ratio = least_ratio * std::pow(most_ratio / least_ratio, c / (tried_ratios - 1.0));
    std::array<double, tried_starts> of_start{};
    double lowest = INFINITY, sum = 0;
    for (int s = 0; s < tried_starts; ++s) {
      const double soc0 = s / (tried_starts - 1.0);
      of_start[static_cast<std::size_t>(s)] = chi2_of(list, weights, ocv, ratio * file_ah, soc0);
      lowest = std::min(lowest, of_start[static_cast<std::size_t>(s)]);
    }
    for (const double of : of_start) sum += std::exp((lowest - of) / 2);
    chi2.emplace_back(ratio * file_ah, lowest - 2 * std::log(sum));
    best = std::min(best, lowest);
  }
  const auto check = [](double value) {
    if (!std::isfinite(value))
      throw std::runtime_error("the capacity is not a finite number, so that there is no answer");
  };
  check(best);
  if (best > worst_fit * static_cast<double>(list.size())) return std::nullopt;
  double least = INFINITY, weight = 0, mean = 0, square = 0;
  for (const auto& [ah, of] : chi2) least = std::min(least, of);
  for (const auto& [ah, of] : chi2) {
    const double w = std::exp((least - of) / 2);
    weight += w;
    mean += w * ah;
    square += w * ah * ah;
  }
  mean /= weight;
  const double spread = std::sqrt(std::max(0.0, square / weight - mean * mean));
  const auto [lowest, highest] = std::ranges::minmax(list, {}, &Stretch::charge_ah);
  const double counted_ah = highest.charge_ah - lowest.charge_ah,
               drift_ah = offset_a(r) * r.recording.duration_s() / 3'600;
  const double sigma = std::hypot(spread, gain_share * mean, mean * drift_ah / std::max(1e-9, counted_ah));
  check(mean);
  check(sigma);
  const bool at_bound = mean - 2 * spread < least_ratio * file_ah || mean + 2 * spread > most_ratio * file_ah;
  if (at_bound || sigma > known_to * mean) return std::nullopt;
  return CapacityEstimate{mean, sigma};
}

files::CellFile counted_cell(const ReplayResult& r) {
  files::CellFile cell = r.cell;
  if (!r.counted_capacity_ah || !r.capacity) return cell;
  cell.parameters.capacity_ah = *r.counted_capacity_ah;
  model::Noise& noise = cell.parameters.noise;
  const double error = r.capacity->std_ah / r.capacity->value_ah;
  if (noise.errors_are_states)
    noise.current_gain = std::min(std::hypot(noise.current_gain, error), model::accepted::most_gain);
  return cell;
}

bool count_with_estimated_capacity(ReplayResult& r, const measurement::SampleList& samples,
                                   const std::optional<measurement::StartingPoint>& start) {
  if (!capacity_differs(r)) return false;
  r.counted_capacity_ah = r.capacity->value_ah;
  Track by_file = std::exchange(r.track, run_on_host(counted_cell(r), samples, start, r.scalar, Timing::none));
  r.track.steps_per_second = by_file.steps_per_second;
  const auto again = estimate_capacity(r);
  if (!again || std::abs(again->value_ah - r.capacity->value_ah) > differs_sigmas * r.capacity->std_ah ||
      judge(r).impossible) {
    r.track = std::move(by_file);
    r.counted_capacity_ah.reset();
    return false;
  }
  evaluate(r);
  return true;
}

std::vector<std::string> reasons_of(const ReplayResult& r) {
  constexpr std::array texts = {
      std::pair{estimator::soc_contradicted, "the voltages contradict the counted charge"},
      std::pair{estimator::voltage_rejected, "a voltage is far from every one that the cell file explains"},
      std::pair{estimator::voltage_missing, "a voltage is missing"},
      std::pair{estimator::voltage_stuck, "the voltage does not move while the current does"},
      std::pair{estimator::current_missing, "a current is missing"},
      std::pair{estimator::time_gap, "time is missing: the charge of a gap is uncertain"},
      std::pair{estimator::current_beyond_limits, "the current is beyond the range of the cell file"}};
  std::vector<std::string> reasons;
  for (const auto& [flag, text] : texts) {
    std::size_t first = 0;
    const std::size_t rows = count(r.track.rows, flag, first);
    if (rows == 0) continue;
    std::string reason = fmt::format("From {:.0f} s on {} ({} samples)",
                                     r.recording.time_s[first] - r.recording.time_s.front(), text, rows);
    if (flag == estimator::soc_contradicted) reason += "; likely cause: " + cause_of(r);
    reasons.push_back(reason + ".");
  }
  if (capacity_differs(r)) {
    reasons.push_back(
        fmt::format("The cell holds {:.3g} Ah (standard deviation {:.2g} Ah), not the {:.3g} Ah of its file{}.",
                    r.capacity->value_ah, r.capacity->std_ah, r.cell.parameters.capacity_ah,
                    r.counted_capacity_ah ? "; its charge is counted with that" : ""));
  }
  return reasons;
}

}  // namespace bms::replay
