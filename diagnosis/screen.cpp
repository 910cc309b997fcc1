#include "diagnosis/screen.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "diagnosis/bursts.hpp"
#include "diagnosis/decision.hpp"
#include "diagnosis/residual_projection.hpp"

namespace bms::diagnosis {

namespace {

using model::catalogue;
using model::Role;

/// Shapes at which signatures are taken: every combination is one probe.
std::vector<double> shape_grid(std::string_view id, double capacity_ah) {
  if (id == "ocv_hysteresis") return {12, 30, 80, 220};
  if (id == "slow_polarisation") return {120, 400, 1'300, 4'500};
  if (id == "fast_polarisation") return {0.5, 1.5, 4, 12};
  if (id == "charge_transfer") return {0.2 * capacity_ah, 0.7 * capacity_ah, 2.5 * capacity_ah};
  if (id == "self_heating") return {200, 900, 3'000};
  if (id == "current_clipping") return {0.02, 0.15, 0.5};
  return {};
}

/// How near to the moment of a contact's step its own imprecision reaches.
constexpr double beside_step_s = 120;

/// Strength small enough to be linear, for the derivatives of places by it.
constexpr double probing_share = 0.02;

struct Excitation {
  double current_max_a = 0, current_span_a = 0, throughput_soc = 0, soc_span = 0, soc_min = 1, soc_max = 0;
  double temperature_min_c = 1e9, temperature_max_c = -1e9, charged_soc = 0, moving_s = 0, duration_s = 0, step_s = 1;
  std::size_t levels = 0, edges = 0;
  bool temperature = false;
};

Excitation excitation_of(const LikelihoodModel& evidence) {
  Excitation x;
  double low_a = 1e9, high_a = -1e9;
  std::vector<double> steps;
  for (const PreparedRecording& r : evidence.records()) {
    double soc = r.initial_soc, known_a = 0;
    x.temperature = x.temperature || !r.temperature_c.empty();
    for (std::size_t k = 0; k < r.size(); ++k) {
      const double before_a = known_a;
      if (std::isfinite(r.current_a[k])) known_a = r.current_a[k];
      low_a = std::min(low_a, known_a);
      high_a = std::max(high_a, known_a);
      if (k > 0) {
        const double dt_s = r.time_s[k] - r.time_s[k - 1],
                     moved = known_a * dt_s / (3'600 * evidence.cell().capacity_ah);
        steps.push_back(dt_s);
        soc += moved;
        x.throughput_soc += std::abs(moved);
        x.charged_soc += std::max(moved, 0.0);
        if (std::abs(known_a) > 0.01 * evidence.cell().capacity_ah) x.moving_s += dt_s;
        if (std::abs(known_a - before_a) > 0.05 * evidence.cell().capacity_ah) ++x.edges;
      }
      x.soc_min = std::min(x.soc_min, soc);
      x.soc_max = std::max(x.soc_max, soc);
      if (!r.temperature_c.empty() && std::isfinite(r.temperature_c[k])) {
        x.temperature_min_c = std::min(x.temperature_min_c, r.temperature_c[k]);
        x.temperature_max_c = std::max(x.temperature_max_c, r.temperature_c[k]);
      }
    }
    x.duration_s += r.duration_s();
  }
  x.current_max_a = std::max(std::abs(low_a), std::abs(high_a));
  x.current_span_a = high_a - low_a;
  x.soc_span = x.soc_max - x.soc_min;
  if (!steps.empty()) {
    std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
    x.step_s = steps[steps.size() / 2];
  }
  return x;
}

/// The largest current, where it is reached often enough to show whether the sensor ends there.
std::optional<double> rail_a(const LikelihoodModel& evidence) {
  double largest = 0;
  for (const PreparedRecording& r : evidence.records()) {
    for (const double a : r.current_a) {
      if (std::isfinite(a)) largest = std::max(largest, std::abs(a));
    }
  }
  if (largest < 0.2 * evidence.cell().capacity_ah) return std::nullopt;
  std::size_t near = 0, runs = 0;
  for (const PreparedRecording& r : evidence.records()) {
    bool inside = false;
    for (const double a : r.current_a) {
      const bool now = std::isfinite(a) && std::abs(a) > 0.9 * largest;
      near += now ? 1 : 0;
      runs += now && !inside ? 1 : 0;
      inside = now;
    }
  }
  return near >= 4 && runs >= 2 ? std::optional(largest) : std::nullopt;
}

}  // namespace

std::vector<MechanismSetting> probe_settings(const LikelihoodModel& evidence, std::size_t mechanism) {
  const double capacity_ah = evidence.cell().capacity_ah;
  const model::MechanismInfo& info = catalogue[mechanism];
  std::vector<double> shapes = shape_grid(info.id, capacity_ah);
  const bool shaped = !shapes.empty();
  if (!shaped) shapes = {0};
  std::vector<MechanismSetting> settings;
  for (const double shape : shapes) {
    MechanismSetting& setting = settings.emplace_back(model::default_setting(mechanism, capacity_ah));
    for (std::size_t k = 0; k < info.parameters; ++k) {
      const model::Parameter& parameter = info.parameter[k];
      if (parameter.role == Role::shape && shaped) setting.value[k] = shape;
      if (parameter.role == Role::strength && parameter.low >= 0)
        setting.value[k] = 1e-6 * parameter.upper(capacity_ah);
      if (info.id == "ocv_hysteresis" && k == 0) setting.value[k] = probing_share * parameter.upper(capacity_ah);
      if (info.id == "current_clipping" && parameter.name == "limit_a")
        setting.value[k] = rail_a(evidence).value_or(setting.value[k]);
    }
  }
  return settings;
}

std::optional<std::string> not_testable(const LikelihoodModel& evidence, const Hypothesis& given,
                                        std::size_t mechanism) {
  const Excitation x = excitation_of(evidence);
  const std::string_view id = catalogue[mechanism].id;
  const double c_rate = evidence.cell().capacity_ah;
  const bool temperature = x.temperature && x.temperature_max_c > x.temperature_min_c - 1e-9;
  const double span_k = temperature ? x.temperature_max_c - x.temperature_min_c : 0;
  const double away_k =
      temperature ? std::max(std::abs(x.temperature_max_c - 25), std::abs(x.temperature_min_c - 25)) : 0;
  const auto needs_current = [&](double c) { return x.current_max_a < c * c_rate; };
  const bool follows = given.find(mechanism_index("temperature_resistance")) != nullptr ||
                       given.find(mechanism_index("entropic_ocv")) != nullptr;

  if (id == "temperature_resistance" || id == "entropic_ocv" || id == "temperature_sensor") {
    if (!temperature) return "no temperature was recorded";
    if (id == "temperature_sensor" && !follows) return "the cell file has nothing that follows the temperature";
    if (id == "temperature_resistance" && std::max(span_k, away_k) < 3)
      return fmt::format("temperature is within {:.1f} K of the cell file's 25 degrees C", away_k);
    if (id == "entropic_ocv" && span_k < 4 && away_k < 8) return fmt::format("temperature spans {:.1f} K", span_k);
  }
  // the same recording, whatever the current: beside each other they would grow without bounds
  const auto trusted = [&] {
    return std::any_of(evidence.records().begin(), evidence.records().end(),
                       [](const PreparedRecording& r) { return !r.checks.empty(); });
  };
  for (const auto& [one, other] : {std::pair{"leakage", "current_offset"}, std::pair{"current_offset", "leakage"}}) {
    if (id == one && given.find(mechanism_index(other)) != nullptr && !trusted())
      return fmt::format("without a trusted ammeter it cannot be told from {}, which is there", other);
  }
  if (id == "self_heating" && needs_current(0.5)) return "the current is too small to heat the cell";
  if (id == "charge_transfer" && needs_current(0.5)) return "the current is too small to bend the overvoltage";
  if (id == "fast_polarisation" && x.step_s > 3) return fmt::format("a sample every {:g} s is too slow", x.step_s);
  if (id == "channel_skew" && (x.edges < 5 || x.step_s > 20)) return "too few steps of the current";
  if ((id == "direction_asymmetry" || id == "coulombic_loss") && x.charged_soc < 0.01) return "the cell is not charged";
  if (id == "current_clipping" && !rail_a(evidence)) return "the largest current is reached too seldom";
  if (id == "initial_soc" && std::none_of(evidence.records().begin(), evidence.records().end(),
                                          [](const PreparedRecording& r) { return r.initial_soc_given; })) {
    return "no initial state of charge was given";
  }
  if ((id == "capacity_change" || id == "ocv_shape") && x.soc_span < 0.1)
    return fmt::format("the state of charge spans {:.0f} %", 100 * x.soc_span);
  if (id == "ocv_hysteresis" && x.throughput_soc < 0.03) return "too little charge is moved";
  if ((id == "resistance_growth" || id == "contact_step" || id == "contact_intermittent" || id == "current_gain" ||
       id == "polarisation_growth" || id == "slow_polarisation") &&
      needs_current(0.05)) {
    return "no current to speak of";
  }
  if (x.duration_s < 600 &&
      (id == "leakage" || id == "slow_polarisation" || id == "coulombic_loss" || id == "current_offset"))
    return "the recording is too short";
  return std::nullopt;
}

double Screen::corrected(double gain, std::size_t unknowns) { return gain - (static_cast<double>(unknowns) - 1) * 2.0; }

double Screen::gain_of(const std::vector<Eigen::Index>& columns, Eigen::VectorXd* strengths) const {
  const auto n = static_cast<Eigen::Index>(columns.size());
  Eigen::MatrixXd g(n, n);
  Eigen::VectorXd b(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    b[i] = toward_[columns[static_cast<std::size_t>(i)]];
    for (Eigen::Index j = 0; j < n; ++j)
      g(i, j) = gram_(columns[static_cast<std::size_t>(i)], columns[static_cast<std::size_t>(j)]);
  }
  for (Eigen::Index i = 0; i < n; ++i) g(i, i) *= 1 + 1e-6, g(i, i) += 1e-12;
  const Eigen::VectorXd x = g.ldlt().solve(b);
  if (strengths != nullptr) *strengths = x;
  return std::max(0.0, b.dot(x));
}

Screen::Screen(const LikelihoodModel& evidence, const HypothesisFit& around, const std::vector<std::size_t>& over) {
  const double capacity_ah = evidence.cell().capacity_ah;
  const Hypothesis& h = around.hypothesis;
  std::vector<Probe> probes;
  std::vector<Columns> blocks;
  Eigen::Index count = 0;

  for (const std::size_t mechanism : over) {
    if (h.find(mechanism) != nullptr || not_testable(evidence, h, mechanism)) continue;
    const model::MechanismInfo& info = catalogue[mechanism];
    if (info.id == "contact_intermittent" || info.id == "contact_step") continue;  // below
    for (const MechanismSetting& setting : probe_settings(evidence, mechanism)) {
      const Hypothesis probe = with(h, setting);
      Probe p;
      std::vector<ParameterRef> by;
      for (std::size_t k = 0; k < info.parameters; ++k) {
        const model::Parameter& parameter = info.parameter[k];
        const bool place = parameter.role == Role::place && info.id == "ocv_hysteresis";
        if (parameter.role == Role::strength || place) {
          p.parameters.push_back(k);
          by.push_back({probe.settings.size() - 1, k});
        }
      }
      p.setting = setting;
      p.first = count;
      count += static_cast<Eigen::Index>(by.size());
      blocks.push_back(evidence.derivatives(probe, around.calibration, by));
      probes.push_back(std::move(p));
    }
  }

  // a contact that changes at a moment: one column per moment
  const std::size_t step = mechanism_index("contact_step");
  const bool wants_step = std::find(over.begin(), over.end(), step) != over.end() && h.find(step) == nullptr &&
                          !not_testable(evidence, h, step);
  if (wants_step) {
    const PreparedRecording& r = evidence.records().front();
    constexpr std::size_t moments = 40;
    Columns steps = Columns::Zero(static_cast<Eigen::Index>(evidence.samples()), moments);
    for (std::size_t m = 0; m < moments; ++m) {
      const std::size_t onset = (m + 2) * r.size() / (moments + 4);
      for (std::size_t k = onset; k < r.size(); ++k) {
        if (std::isfinite(r.current_a[k]))
          steps(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(m)) = r.current_a[k];
      }
      // later recordings have it from their start
      Eigen::Index row = static_cast<Eigen::Index>(r.size());
      for (std::size_t n = 1; n < evidence.records().size(); ++n) {
        for (const double a : evidence.records()[n].current_a) {
          if (std::isfinite(a)) steps(row, static_cast<Eigen::Index>(m)) = a;
          ++row;
        }
      }
      probes.push_back({{step, {0, r.time_s[onset]}, {}}, {0}, count++});
    }
    evidence.whiten(steps);
    blocks.push_back(std::move(steps));
  }

  // project out the base parameters and what is in the fit already
  Columns all(static_cast<Eigen::Index>(evidence.samples()), count);
  Eigen::Index at = 0;
  for (const Columns& block : blocks) {
    all.middleCols(at, block.cols()) = block;
    at += block.cols();
  }
  const LeftOver left(evidence, around);
  LeftOver::Products products = left.of(all);
  gram_ = std::move(products.gram);
  toward_ = std::move(products.toward);

  std::map<std::size_t, std::size_t> of;  // mechanism -> candidate
  for (const Probe& p : probes) {
    const model::MechanismInfo& info = catalogue[p.setting.index];
    std::vector<Eigen::Index> columns(p.parameters.size());
    std::iota(columns.begin(), columns.end(), p.first);
    Eigen::VectorXd found;
    double gain = gain_of(columns, &found);
    // a strength that cannot be negative
    const model::Parameter& first = info.parameter[p.parameters[0]];
    const bool one_sided = first.low >= 0 && first.role == Role::strength;
    if (one_sided && found[0] + p.setting.value[p.parameters[0]] < 0) gain = 0;
    gain = corrected(
        gain, p.parameters.size() + (shape_grid(info.id, capacity_ah).empty() && p.setting.index != step ? 0 : 1));
    if (!of.contains(p.setting.index)) {
      of[p.setting.index] = candidates_.size();
      candidates_.push_back({p.setting.index, p.setting, {}, -std::numeric_limits<double>::infinity(), 0});
      best_.push_back(p);
    }
    Candidate& c = candidates_[of[p.setting.index]];
    // its strength alone, its places free
    Eigen::MatrixXd g(static_cast<Eigen::Index>(columns.size()), static_cast<Eigen::Index>(columns.size()));
    for (Eigen::Index i = 0; i < g.rows(); ++i) {
      for (Eigen::Index j = 0; j < g.cols(); ++j) g(i, j) = gram_(p.first + i, p.first + j);
      g(i, i) = g(i, i) * (1 + 1e-6) + 1e-12;
    }
    const double deviation = std::sqrt(std::max(g.inverse()(0, 0), 0.0));
    if (c.limit == 0 || 4.76 * deviation < c.limit) c.limit = 4.76 * deviation;
    if (gain > c.gain) {
      c.gain = gain;
      c.start = p.setting;
      best_[of[p.setting.index]] = p;
      if (info.id == "ocv_hysteresis") {
        const double m0 = p.setting.value[0], m = std::clamp(found[0] + m0, 0.001, 0.06);
        c.start.value[0] = m;
        c.start.value[2] = std::clamp(found[1] * m0 / m, -1.0, 1.0);
        c.start.value[3] = std::clamp(found[2] * m0 / m, -1.0, 1.0);
      } else if (info.id == "temperature_resistance") {
        // a small energy of all of R0 is the usual one of a share
        const double of_all = std::clamp(found[0], 0.0, info.parameter[0].high), usual = info.parameter[0].typical;
        c.start.value[0] = std::max(of_all, usual);
        c.start.value[3] = std::clamp(of_all / usual, info.parameter[3].low, 1.0);
        c.start.value[1] = std::clamp(found[1], 0.0, 0.6 * info.parameter[1].high);
      } else {
        for (std::size_t k = 0; k < p.parameters.size(); ++k) {
          const model::Parameter& parameter = info.parameter[p.parameters[k]];
          const double low = parameter.lower(capacity_ah), high = parameter.upper(capacity_ah);
          c.start.value[p.parameters[k]] =
              std::clamp(found[static_cast<Eigen::Index>(k)], std::max(low, -0.6 * std::abs(low)), 0.6 * high);
        }
      }
    }
  }

  // bursts of a loose contact
  const std::size_t loose = mechanism_index("contact_intermittent");
  if (std::find(over.begin(), over.end(), loose) != over.end() && h.find(loose) == nullptr &&
      !not_testable(evidence, h, loose)) {
    Candidate c{loose, {loose, {}, {}}, {}, 0, 0};
    std::size_t bursts = 0;
    double sum_ohm = 0, in_s = 0;
    Columns column = Columns::Zero(static_cast<Eigen::Index>(evidence.samples()), 1);
    Eigen::Index row = 0;
    for (std::size_t r = 0; r < evidence.records().size(); ++r) {
      const PreparedRecording& record = evidence.records()[r];
      std::vector<double> e = evidence.voltage(h, around.calibration, r);
      for (std::size_t k = 0; k < e.size(); ++k) e[k] = record.voltage_v[k] - e[k];
      double found_ohm = 0;
      c.bursts.push_back(find_bursts(record, e, evidence.whitener(r), found_ohm));
      // where a contact has changed for good, the rows beside that moment are no burst
      if (const MechanismSetting* changed = h.find(step)) {
        std::erase_if(c.bursts.back(), [&](const model::Span& s) {
          return s.end_s > changed->value[1] - beside_step_s && s.start_s < changed->value[1] + beside_step_s;
        });
      }
      bursts += c.bursts.back().size();
      sum_ohm = std::max(sum_ohm, found_ohm);
      std::size_t next = 0;
      for (std::size_t k = 0; k < record.size(); ++k, ++row) {
        const auto& spans = c.bursts.back();
        while (next < spans.size() && record.time_s[k] > spans[next].end_s) ++next;
        if (next < spans.size() && record.time_s[k] >= spans[next].start_s && std::isfinite(record.current_a[k]))
          column(row, 0) = record.current_a[k];
      }
      for (const model::Span& s : c.bursts.back()) in_s += s.end_s - s.start_s;
    }
    // what the file's own resistance is not good to is no contact
    const model::CellParameters<>& cell = evidence.cell();
    const double least_ohm =
        cell.tolerance.resistance_fraction * model::cell_detail::rc_value(cell.rc, cell.rc.r0_ohm, 0.5);
    if (bursts > 0 && sum_ohm > least_ohm) {
      evidence.whiten(column);
      const LeftOver::Products one = left.of(column);
      const double g = one.gram(0, 0), b = one.toward[0];
      // every burst is two moments that were sought
      if (g > 0 && b > 0) c.gain = b * b / g - decision::per_burst * static_cast<double>(bursts);
      c.start.value = {sum_ohm, in_s / std::max(evidence.records().front().duration_s(), 1.0)};
      if (c.gain > 0) {
        candidates_.push_back(c);
        best_.push_back({c.start, {}, 0});
      }
    }
  }

  std::vector<std::size_t> order(candidates_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return candidates_[a].gain > candidates_[b].gain; });
  std::vector<Candidate> candidates;
  std::vector<Probe> best;
  for (const std::size_t k : order) {
    candidates.push_back(candidates_[k]);
    best.push_back(best_[k]);
  }
  candidates_ = std::move(candidates);
  best_ = std::move(best);
}

double Screen::alike(std::size_t a, std::size_t b) const {
  const auto columns_of = [&](std::size_t c) {
    std::vector<Eigen::Index> columns(best_[c].parameters.size());
    std::iota(columns.begin(), columns.end(), best_[c].first);
    return columns;
  };
  const auto ca = columns_of(a), cb = columns_of(b);
  if (ca.empty() || cb.empty()) return 0;
  // share of what a explains by its best direction that b's columns can follow
  Eigen::VectorXd x;
  gain_of(ca, &x);
  double norm = 0;
  Eigen::VectorXd toward = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(cb.size()));
  for (std::size_t i = 0; i < ca.size(); ++i) {
    for (std::size_t j = 0; j < ca.size(); ++j)
      norm += x[static_cast<Eigen::Index>(i)] * x[static_cast<Eigen::Index>(j)] * gram_(ca[i], ca[j]);
    for (std::size_t j = 0; j < cb.size(); ++j)
      toward[static_cast<Eigen::Index>(j)] += x[static_cast<Eigen::Index>(i)] * gram_(ca[i], cb[j]);
  }
  Eigen::MatrixXd g(static_cast<Eigen::Index>(cb.size()), static_cast<Eigen::Index>(cb.size()));
  for (std::size_t i = 0; i < cb.size(); ++i) {
    for (std::size_t j = 0; j < cb.size(); ++j)
      g(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = gram_(cb[i], cb[j]);
    g(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(i)) *= 1 + 1e-6;
  }
  return norm > 0 ? std::sqrt(std::clamp(toward.dot(g.ldlt().solve(toward)) / norm, 0.0, 1.0)) : 0;
}

}  // namespace bms::diagnosis
