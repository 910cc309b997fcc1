#include "identification/branch_temperature.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "identification/least_squares.hpp"
#include "model/temperature.hpp"

namespace bms::identification {

namespace {

using model::BranchTemperature;
using model::EntropicOcv;

constexpr std::size_t branch_nodes = BranchTemperature::nodes.size();
constexpr double kelvin_at_0_c = 273.15;
/// SOC of the rows of the fit. Outside, the branches depend on the cut-off voltages.
constexpr double from_soc = 0.06, to_soc = 0.95, soc_step = 0.02;

/// The unknowns: ln of M g [mV], E [kJ/mol], w at both ends, dU/dT [mV/K].
enum Place : Eigen::Index { log_gap = 0, energy = 4, asymmetry = 8, entropy = 10, unknowns = 14 };

/// Change of both branches from the reference temperature [V].
struct Change {
  double charge_v, discharge_v;
};

double at_nodes(const auto& x, const auto& value, double soc) {
  if (soc <= x.front()) return value(0);
  for (std::size_t k = 1; k < x.size(); ++k) {
    if (soc > x[k]) continue;
    const double t = (soc - x[k - 1]) / (x[k] - x[k - 1]);
    return value(k - 1) + t * (value(k) - value(k - 1));
  }
  return value(x.size() - 1);
}

constexpr std::array<double, 4> entropy_nodes = {0.10, 0.40, 0.70, 0.95};

/// w at a SOC: linear between the outer branch_nodes.
double asymmetry_at(const Eigen::VectorXd& x, double soc) {
  const double t =
      (soc - BranchTemperature::nodes.front()) / (BranchTemperature::nodes.back() - BranchTemperature::nodes.front());
  return x[asymmetry] + std::clamp(t, 0.0, 1.0) * (x[asymmetry + 1] - x[asymmetry]);
}

Change change_of(const Eigen::VectorXd& x, double soc, double temperature_c, double reference_c) {
  const auto place = [](Place from, std::size_t k) { return from + static_cast<Eigen::Index>(k); };
  const double gap_v =
      1e-3 * at_nodes(
                 BranchTemperature::nodes, [&](std::size_t k) { return std::exp(x[place(log_gap, k)]); }, soc);
  const double kj = at_nodes(
      BranchTemperature::nodes, [&](std::size_t k) { return x[place(energy, k)]; }, soc);
  const double exponent = 1e3 * kj / model::mechanism_detail::gas_constant_j_per_mol_k *
                          (1 / (temperature_c + kelvin_at_0_c) - 1 / (reference_c + kelvin_at_0_c));
  constexpr double most = 4.5;  // as the law
  const double grown_v = gap_v * (std::exp(std::min(exponent, most)) - 1);
  const double shift_v = asymmetry_at(x, soc) * grown_v;
  const double middle_v = 1e-3 * (temperature_c - reference_c) *
                          at_nodes(
                              entropy_nodes, [&](std::size_t k) { return x[place(entropy, k)]; }, soc);
  return {middle_v + grown_v - shift_v, middle_v - grown_v - shift_v};
}

double at_soc(const std::vector<double>& grid, double soc) {
  const double place = soc * static_cast<double>(grid.size() - 1);
  const auto k = std::min(static_cast<std::size_t>(place), grid.size() - 2);
  return grid[k] + (place - static_cast<double>(k)) * (grid[k + 1] - grid[k]);
}

bool both_kinds(const OcvCurve& curve) { return curve.coulombic_efficiency.has_value(); }

/// A measured change of a branch between the temperature of `base` and another one.
struct Row {
  double soc, temperature_c, change_v;
  bool charge;
};

std::vector<Row> rows_of(const std::vector<const CurveAtTemperature*>& curves, const CurveAtTemperature& base) {
  std::vector<Row> rows;
  for (const CurveAtTemperature* at : curves) {
    if (at == &base) continue;
    for (double soc = from_soc; soc < to_soc; soc += soc_step) {
      const double charge_v = at_soc(at->curve.charge_v, soc) - at_soc(base.curve.charge_v, soc);
      const double discharge_v = at_soc(at->curve.discharge_v, soc) - at_soc(base.curve.discharge_v, soc);
      if (std::isfinite(charge_v)) rows.push_back({soc, at->temperature_c, charge_v, true});
      if (std::isfinite(discharge_v)) rows.push_back({soc, at->temperature_c, discharge_v, false});
    }
  }
  return rows;
}

/// Usual values, and how far cells are from them (branches of two laboratories' cells, -15 to 45 degrees C).
struct Usual {
  double value, spread;
};
constexpr std::array<Usual, unknowns> usual = {{{1.4, 1},
                                                {1.4, 1},
                                                {1.4, 1},
                                                {1.4, 1},  // some 4 mV
                                                {40, 20},
                                                {35, 20},
                                                {35, 20},
                                                {35, 20},  // kJ/mol
                                                {0.6, 0.5},
                                                {-0.4, 0.5},  //
                                                {0.1, 0.3},
                                                {0.1, 0.3},
                                                {0.1, 0.3},
                                                {0.1, 0.3}}};  // mV/K

double error_v(const Eigen::VectorXd& x, const Row& row, const CurveAtTemperature& base, double reference_c) {
  const Change here = change_of(x, row.soc, row.temperature_c, reference_c),
               there = change_of(x, row.soc, base.temperature_c, reference_c);
  const double change_v = row.charge ? here.charge_v - there.charge_v : here.discharge_v - there.discharge_v;
  return change_v - row.change_v;
}

/// A branch is known to 2 mV and 15 % of its change; larger errors count less and less.
Eigen::VectorXd residuals(const Eigen::VectorXd& x, const std::vector<Row>& rows, const CurveAtTemperature& base,
                          double reference_c) {
  constexpr double known_v = 0.002, known_share = 0.15, outlier = 3;
  Eigen::VectorXd r(static_cast<Eigen::Index>(rows.size()) + unknowns);
  Eigen::Index k = 0;
  for (const Row& row : rows) {
    const double e = error_v(x, row, base, reference_c) / (known_v + known_share * std::abs(row.change_v));
    r[k++] = outlier * std::atan(e / outlier);
  }
  for (Eigen::Index i = 0; i < unknowns; ++i) {
    const Usual& u = usual[static_cast<std::size_t>(i)];
    r[k++] = (x[i] - u.value) / u.spread;
  }
  return r;
}

BranchLaws laws_of(const Eigen::VectorXd& x, double reference_c) {
  BranchLaws laws;
  for (std::size_t k = 0; k < branch_nodes; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const double gap_v = 1e-3 * std::exp(x[log_gap + i]);
    laws.branches[k] = gap_v;
    laws.branches[branch_nodes + k] = gap_v * asymmetry_at(x, BranchTemperature::nodes[k]);
    laws.branches[2 * branch_nodes + k] = 1e3 * x[energy + i];
    laws.entropic[k] = 1e-3 * x[entropy + i];
  }
  laws.branches[3 * branch_nodes] = laws.entropic[branch_nodes] = reference_c;
  return laws;
}

template <class Mechanism>
void clamp_to_bounds(std::array<double, Mechanism::parameters.size()>& values) {
  for (std::size_t k = 0; k < values.size(); ++k)
    values[k] = std::clamp(values[k], Mechanism::parameters[k].low, Mechanism::parameters[k].high);
}

}  // namespace

std::optional<BranchLaws> fit_branches(const std::vector<CurveAtTemperature>& curves, double reference_c) {
  std::vector<const CurveAtTemperature*> used;
  for (const CurveAtTemperature& at : curves) {
    if (both_kinds(at.curve)) used.push_back(&at);
  }
  constexpr std::size_t least = 3;
  constexpr double least_span_k = 20;
  if (used.size() < least) return std::nullopt;
  const auto by = [](auto key) { return [key](const auto* a, const auto* b) { return key(*a) < key(*b); }; };
  const auto [coldest, warmest] =
      std::minmax_element(used.begin(), used.end(), by([](const auto& at) { return at.temperature_c; }));
  if ((*warmest)->temperature_c - (*coldest)->temperature_c < least_span_k) return std::nullopt;
  const CurveAtTemperature& base = **std::min_element(
      used.begin(), used.end(), by([&](const auto& at) { return std::abs(at.temperature_c - reference_c); }));

  const std::vector<Row> rows = rows_of(used, base);
  LeastSquares problem;
  Eigen::VectorXd start(static_cast<Eigen::Index>(unknowns)), scale(start.size());
  for (Eigen::Index i = 0; i < start.size(); ++i) {
    start[i] = usual[static_cast<std::size_t>(i)].value;
    scale[i] = usual[static_cast<std::size_t>(i)].spread;
  }
  problem.scale = scale;
  problem.evaluate = [&](const Eigen::VectorXd& x, Eigen::VectorXd& r, Eigen::MatrixXd* jacobian) {
    r = residuals(x, rows, base, reference_c);
    if (jacobian == nullptr) return r.allFinite();
    jacobian->resize(r.size(), x.size());
    constexpr double step = 1e-5;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      Eigen::VectorXd more = x, less = x;
      more[i] += step * scale[i];
      less[i] -= step * scale[i];
      jacobian->col(i) =
          (residuals(more, rows, base, reference_c) - residuals(less, rows, base, reference_c)) / (2 * step * scale[i]);
    }
    return r.allFinite();
  };
  const Optimum found = minimise(problem, start, Method::trust_region_reflective);
  BranchLaws laws = laws_of(found.x, reference_c);
  clamp_to_bounds<EntropicOcv>(laws.entropic);
  double squares = 0;
  for (const Row& row : rows) squares += std::pow(error_v(found.x, row, base, reference_c), 2);
  laws.residual_v = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(rows.size(), 1)));
  return laws;
}

OcvCurve moved_to_reference(const CurveAtTemperature& from, const BranchLaws& laws) {
  OcvCurve curve = from.curve;
  const BranchTemperature::Law<double> branches(laws.branches, curve.capacity_ah);
  const EntropicOcv::Law<double> entropic(laws.entropic, curve.capacity_ah);
  for (std::size_t k = 0; k < curve.soc.size(); ++k) {
    model::TablePoint<double> at{};
    at.per_width = 1;
    at.gap = 0;
    const model::StepInput<double> at_rest{0, 1, from.temperature_c};
    branches.tables(at, curve.soc[k], at_rest);
    entropic.tables(at, curve.soc[k], at_rest);
    curve.ocv_v[k] -= at.ocv_v;
    curve.half_gap_v[k] = std::max(0.0, curve.half_gap_v[k] - at.gap);
    curve.charge_v[k] -= at.ocv_v + at.gap;
    curve.discharge_v[k] -= at.ocv_v - at.gap;
  }
  return curve;
}

std::array<double, BranchTemperature::parameters.size()> for_half_gap(const BranchLaws& laws, double half_gap_v) {
  auto values = laws.branches;
  for (std::size_t k = 0; k < branch_nodes; ++k) values[k] /= half_gap_v;
  clamp_to_bounds<BranchTemperature>(values);
  return values;
}

}  // namespace bms::identification
