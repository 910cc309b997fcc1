// Which readings count, with which noise, and the residual of a hypothesis.
#include "diagnosis/likelihood_model.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/likeliest_noise.hpp"
#include "diagnosis/sensor_end.hpp"
#include "diagnosis/simulation_run.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Noise& noise_limits = thresholds.noise;

/// A hysteresis of the cell file begins each recording at a position of its own, one that is found begins each later
/// recording so.
bool has_own_branch(const std::vector<MechanismSetting>& own, const std::vector<PreparedRecording>& records) {
  constexpr std::size_t hysteresis = model::mechanism_index_of<model::OcvHysteresis>;
  return records.size() > 1 ||
         std::any_of(own.begin(), own.end(), [](const MechanismSetting& s) { return s.index == hysteresis; });
}

}  // namespace

LikelihoodModel::LikelihoodModel(const model::CellParameters<>& cell, std::vector<MechanismSetting> own,
                                 std::vector<PreparedRecording> records, const NoiseModel& noise,
                                 const Loosened& loosened, const LearnedError& learned)
    : cell_(cell),
      tables_(model::prepare<double, model::max_intervals>(cell)),
      own_(std::move(own)),
      records_(std::move(records)),
      facts_(recording_facts(cell, records_)),
      learned_(learned),
      calibration_(cell, records_, has_own_branch(own_, records_), loosened, learned) {
  for (const PreparedRecording& r : records_) {
    if (r.size() < 2) throw std::invalid_argument("a recording with fewer than two rows");
    samples_ += r.size();
    checks_ += r.checks.size();
    set_row_noise(r);
  }
  set_noise(noise);
}

void LikelihoodModel::set_row_noise(const PreparedRecording& r) {
  std::vector<char>& usable = usable_.emplace_back(r.size(), 1);
  RowNoise& more = row_noise_.emplace_back(r.size());
  const double soc_error = noise_limits.soc_error_share * r.initial_soc_sigma, reach = noise_limits.ocv_slope_reach,
               r0_ohm = model::cell_detail::rc_value(cell_.rc, cell_.rc.r0_ohm, numerics.middle_soc);
  const SensorEnd end = sensor_end(r, noise_limits.quiet_c * cell_.capacity_ah, cell_.noise.voltage_v);
  double soc = r.initial_soc;  // held within 0..1: a count that has drifted outside says nothing about the slope
  std::uint8_t interval = 0;
  const auto ocv_v = [&](double at) { return model::look_up(tables_, at, interval).ocv_v; };
  for_each_row(r, cell_.capacity_ah, [&](const CountedRow& row) {
    const std::size_t k = row.k;
    if (!std::isfinite(r.voltage_v[k])) usable[k] = 0;
    // the first row under load: what flowed before is not known
    if (k == 0 && !(std::abs(r.current_a[k]) < noise_limits.start_current_c * cell_.capacity_ah)) usable[k] = 0;
    const double step_a = k > 0 ? row.current_a - row.previous_a : 0;
    more.white_v2[k] = std::pow(noise_limits.edge_jitter * r0_ohm * step_a, 2);
    if (k > 0) more.white_v2[k - 1] = std::max(more.white_v2[k - 1], more.white_v2[k]);
    more.edge_v2[k] = std::pow(noise_limits.edge_error * cell_.tolerance.resistance_fraction * r0_ohm * step_a, 2);
    if (k > 0) soc = std::clamp(soc + row.moved_soc, 0.0, 1.0);
    more.slow_v2[k] =
        std::pow(soc_error * (ocv_v(soc + reach) - ocv_v(soc - reach)) / (2 * reach), 2) + learned_.more_at(soc);
    more.white_v2[k] += std::pow(noise_limits.white_share_of_ocv, 2) * learned_.more_at(soc);
    if (end.holds(row.current_a)) more.white_v2[k] += end.spread_v * end.spread_v;
  });
}

std::vector<Whitener> LikelihoodModel::whiteners_for(const NoiseModel& noise) const {
  std::vector<Whitener> made;
  for (std::size_t r = 0; r < records_.size(); ++r)
    made.emplace_back(noise, records_[r].time_s, row_noise_[r], usable_[r]);
  return made;
}

void LikelihoodModel::set_noise(const NoiseModel& noise) {
  if (!whiteners_.empty() && noise == noise_) return;
  noise_ = noise;
  whiteners_ = whiteners_for(noise);
  nearby_.set(nullptr);
  latest_.set(nullptr);
}

std::vector<double> LikelihoodModel::costs_of_noise(const Columns& raw, std::span<const NoiseModel> noises,
                                                    const NoiseModel& nominal) const {
  std::vector<double> sums;
  for (const NoiseModel& noise : noises) sums.push_back(price_of_noise(noise, nominal));
  std::size_t row = 0;
  for (std::size_t r = 0; r < records_.size(); ++r) {
    const std::vector<double> of_record = minus_two_log_likelihoods(noises, records_[r].time_s, row_noise_[r],
                                                                    usable_[r], {raw.data() + row, records_[r].size()});
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += of_record[k];
    row += records_[r].size();
  }
  if (checks_ == 0) return sums;
  for (std::size_t k = 0; k < sums.size(); ++k) {
    Columns checks = raw.bottomRows(static_cast<Eigen::Index>(checks_));
    sums[k] += whiten_checks(checks, 0, noises[k]);
    sums[k] += checks.squaredNorm();
  }
  return sums;
}

NoiseModel LikelihoodModel::likeliest_noise(const Columns& raw, const NoiseModel& nominal, double& cost) const {
  const LikeliestNoise likeliest = search_noise(
      nominal, checks_ > 0, [&](std::span<const NoiseModel> noises) { return costs_of_noise(raw, noises, nominal); });
  cost = likeliest.cost;
  return likeliest.noise;
}

std::size_t LikelihoodModel::used() const {
  std::size_t n = 0;
  for (const Whitener& w : whiteners_) n += w.used();
  return n;
}

Hypothesis LikelihoodModel::base() const { return {own_, own_.size(), {}}; }

std::vector<double> LikelihoodModel::voltage(const Hypothesis& h, const Eigen::VectorXd& u, std::size_t record,
                                             std::vector<double>* soc) const {
  return simulate(h, u, record, soc, nullptr);
}

std::vector<double> LikelihoodModel::simulate(const Hypothesis& h, const Eigen::VectorXd& u, std::size_t record,
                                              std::vector<double>* soc, std::vector<double>* checks) const {
  std::vector<double> v(records_[record].size());
  if (soc != nullptr) soc->resize(v.size());
  std::vector<model::MechanismValues<double>> values;
  for (const MechanismSetting& s : h.settings) values.push_back(s.value);
  const std::vector<double> unknowns(u.data(), u.data() + u.size());
  run<double>(
      values, h, AtUnknowns<double>{calibration_, unknowns}, record,
      [&](std::size_t k, double volt, const auto& simulation) {
        v[k] = volt;
        if (soc != nullptr) (*soc)[k] = simulation.soc();
      },
      [&](std::size_t, double expected) {
        if (checks != nullptr) checks->push_back(expected);
      });
  return v;
}

Columns LikelihoodModel::raw_residual(const Hypothesis& h, const Eigen::VectorXd& u) const {
  Columns e(static_cast<Eigen::Index>(samples()), 1);
  Eigen::Index row = 0;
  std::vector<double> checks;
  for (std::size_t r = 0; r < records_.size(); ++r) {
    const std::vector<double> v = simulate(h, u, r, nullptr, &checks);
    for (std::size_t k = 0; k < v.size(); ++k, ++row) {
      const double error_v = usable_[r][k] != 0 ? records_[r].voltage_v[k] - v[k] : 0;
      e(row, 0) = std::isfinite(error_v) ? error_v : runaway_v;
    }
  }
  for (const double expected : checks) e(row++, 0) = -expected;
  return e;
}

Eigen::VectorXd LikelihoodModel::residual(const Hypothesis& h, const Eigen::VectorXd& u) const {
  Columns e = raw_residual(h, u);
  whiten(e);
  return e.col(0);
}

void LikelihoodModel::whiten(Columns& columns) const { whiten(columns, whiteners_, noise_); }

double LikelihoodModel::whiten(Columns& columns, const std::vector<Whitener>& by, const NoiseModel& noise) const {
  Eigen::Index row = 0;
  for (std::size_t r = 0; r < records_.size(); ++r) {
    const auto rows = static_cast<Eigen::Index>(records_[r].size());
    by[r].whiten(columns.middleRows(row, rows));
    row += rows;
  }
  return checks_ > 0 ? whiten_checks(columns, row, noise) : 0;
}

double LikelihoodModel::whiten_checks(Columns& columns, Eigen::Index row, const NoiseModel& noise) const {
  double log_determinant = 0;
  for (const PreparedRecording& r : records_) {
    Eigen::VectorXd w = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(r.checks.size()));
    for (std::size_t j = 0; j < r.checks.size(); ++j) {
      const auto at = static_cast<Eigen::Index>(j);
      const Check& check = r.checks[j];
      const bool voltage = check.channel == Check::Channel::voltage;
      const double deviation = check.deviation(voltage ? noise.voltage_check : noise.current_check),
                   wider = deviation / check.deviation();
      columns.row(row + at) /= wider;
      log_determinant += 2 * std::log(wider);
      if (voltage) w[at] = cell_.tolerance.drift_v / deviation;
    }
    if (const double shared = w.squaredNorm(); shared > 0) {
      log_determinant += std::log1p(shared);
      auto rows = columns.middleRows(row, w.size());
      const Eigen::RowVectorXd along = w.transpose() * rows;
      rows -= ((1 - 1 / std::sqrt(1 + shared)) / shared) * w * along;
    }
    row += w.size();
  }
  return log_determinant;
}

}  // namespace bms::diagnosis
