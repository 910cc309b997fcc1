#include "identification/grey_box.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <limits>
#include <memory>
#include <stdexcept>

#include <ceres/jet.h>

#include "model/one_rc.hpp"

namespace bms::identification {

namespace {

enum Lane { by_soc, by_v_rc, by_r0, by_r1, by_c1, lanes = 6 };  // an even number: the compiler takes two at a time
using Local = ceres::Jet<double, lanes>;
using Tables = model::Cell<double, model::max_intervals>;

double value_of(double v) { return v; }
double value_of(const Local& v) { return v.a; }

/// An independent variable of the step: its own lane is 1.
template <class S>
S local(double value, int own_lane) {
  if constexpr (std::same_as<S, double>)
    return value;
  else
    return Local(value, own_lane);
}

/// A table's value: its slope by soc, and a lane of its own where it is an unknown.
Local tabled(double value, double delta, double per_width, int own_lane = -1) {
  Local v(value);
  v.v[by_soc] = delta * per_width;
  if (own_lane >= 0) v.v[own_lane] = 1;
  return v;
}

template <class S>
model::TablePoint<S> localised(const model::TablePoint<double>& at) {
  if constexpr (std::same_as<S, double>) {
    return at;
  } else {
    return {.per_width = Local(at.per_width),
            .ocv_v = tabled(at.ocv_v, at.ocv_delta_v, at.per_width),
            .ocv_delta_v = Local(at.ocv_delta_v),
            .r0_ohm = tabled(at.r0_ohm, at.r0_delta_ohm, at.per_width, by_r0),
            .r0_delta_ohm = Local(at.r0_delta_ohm),
            .r1_ohm = tabled(at.r1_ohm, at.r1_delta_ohm, at.per_width, by_r1),
            .r1_delta_ohm = Local(at.r1_delta_ohm),
            .c1_f = tabled(at.c1_f, at.c1_delta_f, at.per_width, by_c1),
            .c1_delta_f = Local(at.c1_delta_f)};
  }
}

/// RMS of the logarithmic ratio of neighbours in Table 9: R0, R1, C1.
constexpr std::array<double, 3> neighbours_differ = {0.044, 0.28, 0.27};

/// Which two nodes a soc lies between and how the table weighs them.
struct Between {
  std::size_t below = 0, above = 0;
  double weight_above = 0;
};

Between between(const std::vector<double>& nodes, double soc) {
  if (soc <= nodes.front()) return {0, 0, 0};
  if (soc >= nodes.back()) return {nodes.size() - 1, nodes.size() - 1, 0};
  const std::size_t above = static_cast<std::size_t>(std::upper_bound(nodes.begin(), nodes.end(), soc) - nodes.begin());
  return {above - 1, above, (soc - nodes[above - 1]) / (nodes[above] - nodes[above - 1])};
}

/// Between the edges by a straight line, beyond as at the end.
double half_gap_v(const model::OcvTable<double>& ocv, double soc) {
  const auto begin = ocv.soc.value.begin(), end = begin + static_cast<std::ptrdiff_t>(ocv.soc.size);
  const auto above = static_cast<std::size_t>(std::upper_bound(begin, end, soc) - begin);
  if (above == 0) return ocv.half_gap_v[0];
  if (above == ocv.soc.size) return ocv.half_gap_v[above - 1];
  const double t = (soc - ocv.soc[above - 1]) / (ocv.soc[above] - ocv.soc[above - 1]);
  return ocv.half_gap_v[above - 1] + t * (ocv.half_gap_v[above] - ocv.half_gap_v[above - 1]);
}

}  // namespace

model::CellParameters<> with_ocv_branch(const model::CellParameters<>& cell, double ocv_branch) {
  model::CellParameters<> moved = cell;
  const double by = ocv_branch - cell.ocv.lean;
  moved.ocv.lean = ocv_branch;
  for (std::size_t k = 0; k + 1 < cell.ocv.soc.size; ++k) {
    const auto corner = [&](std::size_t edge) {
      return cell.ocv.b0_v[k] + cell.ocv.b1_v[k] * cell.ocv.soc[edge] + by * cell.ocv.half_gap_v[edge];
    };
    const double from = corner(k), to = corner(k + 1);
    moved.ocv.b1_v[k] = (to - from) / (cell.ocv.soc[k + 1] - cell.ocv.soc[k]);
    moved.ocv.b0_v[k] = from - moved.ocv.b1_v[k] * cell.ocv.soc[k];
  }
  return moved;
}

GreyBox::GreyBox(const model::CellParameters<>& cell, std::vector<DataSet> records, GreyBoxOptions options)
    : cell_(cell), records_(std::move(records)), options_(std::move(options)) {
  if (options_.soc_nodes.empty()) throw std::invalid_argument("no soc nodes to identify R0, R1, C1 at");
  if (records_.empty()) throw std::invalid_argument("no recording to identify from");
  for (const char* name : {"r0_ohm", "r1_ohm", "c1_f"}) {
    for (const double soc : options_.soc_nodes) unknowns_.push_back({name, soc, 0});
  }
  if (options_.estimate_ocv_branch) {
    if (cell_.ocv.half_gap_v.size == 0)
      throw std::invalid_argument("no gap between charge and discharge for the OCV to lean in");
    unknowns_.push_back({"ocv_lean", 0, 0});
  }
  for (std::size_t r = 0; r < records_.size(); ++r) {
    if (records_[r].data.size() < 2) throw std::invalid_argument("a recording of less than two samples");
    samples_ += records_[r].data.size();
    if (records_[r].estimate_initial_v_rc) unknowns_.push_back({"initial_v_rc_v", records_[r].initial_soc, r});
    if (!records_[r].estimate_initial_soc) continue;
    unknowns_.push_back({"initial_soc", records_[r].initial_soc, r});
    if (records_[r].initial_soc_sigma > 0) ++beliefs_;
  }
}

std::optional<Eigen::Index> GreyBox::unknown(const std::string& name, std::size_t record) const {
  for (std::size_t k = 3 * nodes(); k < unknowns_.size(); ++k) {
    if (unknowns_[k].name == name && unknowns_[k].record == record) return static_cast<Eigen::Index>(k);
  }
  return std::nullopt;
}

Eigen::VectorXd GreyBox::start() const {
  Eigen::VectorXd x(static_cast<Eigen::Index>(unknowns_.size()));
  const LeastSquares limits = problem();
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const Unknown& u = unknowns_[static_cast<std::size_t>(k)];
    double value = 0;
    if (u.name == "r0_ohm")
      value = model::cell_detail::rc_value(cell_.rc, cell_.rc.r0_ohm, u.soc);
    else if (u.name == "r1_ohm")
      value = model::cell_detail::rc_value(cell_.rc, cell_.rc.r1_ohm, u.soc);
    else if (u.name == "c1_f")
      value = model::cell_detail::rc_value(cell_.rc, cell_.rc.c1_f, u.soc);
    else if (u.name == "ocv_lean")
      value = cell_.ocv.lean;
    else if (u.name == "initial_soc")
      value = u.soc;
    x[k] = std::clamp(value, limits.lower[k], limits.upper[k]);
  }
  return x;
}

model::CellParameters<> GreyBox::cell_with(const Eigen::VectorXd& x) const {
  const auto ocv_branch = unknown("ocv_lean", 0);
  model::CellParameters<> cell = ocv_branch ? with_ocv_branch(cell_, x[*ocv_branch]) : cell_;
  cell.rc = {};
  for (std::size_t k = 0; k < nodes(); ++k) {
    const auto at = [&](std::size_t column) { return x[static_cast<Eigen::Index>(column * nodes() + k)]; };
    cell.rc.soc.push_back(options_.soc_nodes[k]);
    cell.rc.r0_ohm.push_back(at(0));
    cell.rc.r1_ohm.push_back(at(1));
    cell.rc.c1_f.push_back(at(2));
  }
  return cell;
}

template <class S>
bool GreyBox::run(const Eigen::VectorXd& x, std::size_t r, Eigen::Ref<Eigen::VectorXd> voltage_v,
                  Eigen::Ref<Eigen::MatrixXd>* derivatives) const {
  using Model = model::OneRc<S>;
  constexpr bool with_derivatives = !std::same_as<S, double>;
  const DataSet& record = records_[r];
  const Data& data = record.data;
  const auto tables = std::make_unique<Tables>(model::prepare<double, model::max_intervals>(cell_with(x)));
  const auto v_rc_unknown = unknown("initial_v_rc_v", r), soc_unknown = unknown("initial_soc", r),
             lean_unknown = unknown("ocv_lean", 0);
  const double per_as = 1 / (3'600 * cell_.capacity_ah);

  double soc = soc_unknown ? x[*soc_unknown] : record.initial_soc;
  double v_rc_v = v_rc_unknown ? x[*v_rc_unknown] : 0;
  Eigen::VectorXd v_rc_by = Eigen::VectorXd::Zero(x.size()), voltage_by(x.size());  // d v_rc / d unknowns
  if (v_rc_unknown) v_rc_by[*v_rc_unknown] = 1;

  const auto n = static_cast<Eigen::Index>(nodes());
  // adds what a local derivative by R0, R1 or C1 (column 0, 1, 2) means for the two nodes beside soc
  const auto spread = [&](Eigen::VectorXd& by, double derivative, Eigen::Index column, const Between& b) {
    by[column * n + static_cast<Eigen::Index>(b.below)] += derivative * (1 - b.weight_above);
    by[column * n + static_cast<Eigen::Index>(b.above)] += derivative * b.weight_above;
  };

  std::uint8_t interval = 0;
  for (std::size_t k = 0; k < data.size(); ++k) {
    const double duration_s = k == 0 ? 0 : data.time_s[k] - data.time_s[k - 1];
    const double current_a = std::isfinite(data.current_a[k]) ? data.current_a[k] : 0;
    soc += current_a * duration_s * per_as;
    if (!(std::abs(soc) < 7)) return false;
    const auto at = localised<S>(model::look_up(*tables, soc, interval));
    const model::StepInput<S> input{S(current_a), S(duration_s)};
    [[maybe_unused]] Between beside;
    if constexpr (with_derivatives) beside = between(options_.soc_nodes, soc);

    if (duration_s > 0) {
      const S state =
          Model::advance({local<S>(v_rc_v, by_v_rc)}, at, Model::discretise(at, input.duration_s), input)[0];
      v_rc_v = value_of(state);
      if constexpr (with_derivatives) {
        v_rc_by *= state.v[by_v_rc];
        spread(v_rc_by, state.v[by_r1], 1, beside);
        spread(v_rc_by, state.v[by_c1], 2, beside);
        if (soc_unknown) v_rc_by[*soc_unknown] += state.v[by_soc];
      }
    }
    const S voltage = Model::voltage({local<S>(v_rc_v, by_v_rc)}, at, input);
    if (!std::isfinite(value_of(voltage))) return false;
    const auto row = static_cast<Eigen::Index>(k);
    voltage_v[row] = value_of(voltage);
    if constexpr (with_derivatives) {
      voltage_by = v_rc_by * voltage.v[by_v_rc];
      spread(voltage_by, voltage.v[by_r0], 0, beside);
      if (soc_unknown) voltage_by[*soc_unknown] += voltage.v[by_soc];
      if (lean_unknown) voltage_by[*lean_unknown] += half_gap_v(cell_.ocv, soc);
      derivatives->row(row) = voltage_by.transpose();
    }
  }
  return true;
}

bool GreyBox::simulate(const Eigen::VectorXd& x, std::size_t r, Eigen::Ref<Eigen::VectorXd> voltage_v,
                       Eigen::Ref<Eigen::MatrixXd>* derivatives) const {
  return derivatives == nullptr ? run<double>(x, r, voltage_v, nullptr) : run<Local>(x, r, voltage_v, derivatives);
}

LeastSquares GreyBox::problem() const {
  LeastSquares p;
  const auto n = static_cast<Eigen::Index>(unknowns_.size());
  p.lower.resize(n);
  p.upper.resize(n);
  p.scale.resize(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const std::string& name = unknowns_[static_cast<std::size_t>(k)].name;
    const CircuitBounds& b = options_.bounds;
    const auto set = [&](double lower, double upper, double scale) {
      p.lower[k] = lower;
      p.upper[k] = upper;
      p.scale[k] = scale;
    };
    if (name == "r0_ohm")
      set(b.r0_min_ohm, b.r0_max_ohm, 0.01);
    else if (name == "r1_ohm")
      set(b.r1_min_ohm, b.r1_max_ohm, 0.01);
    else if (name == "c1_f")
      set(b.c1_min_f, b.c1_max_f, 1'000);
    else if (name == "ocv_lean")
      set(-1, 1, 0.1);
    else if (name == "initial_soc")
      set(-0.05, 1.05, 0.1);
    else
      set(-0.5, 0.5, 0.01);
  }
  p.evaluate = [this](const Eigen::VectorXd& x, Eigen::VectorXd& residuals, Eigen::MatrixXd* jacobian) {
    const auto rows = static_cast<Eigen::Index>(samples_ + beliefs_ + ties());
    residuals.setZero(rows);
    if (jacobian != nullptr) jacobian->setZero(rows, x.size());
    Eigen::Index from = 0, belief = static_cast<Eigen::Index>(samples_);
    for (std::size_t r = 0; r < records_.size(); ++r) {
      const DataSet& record = records_[r];
      const auto count = static_cast<Eigen::Index>(record.data.size());
      if (jacobian != nullptr) {
        Eigen::Ref<Eigen::MatrixXd> part = jacobian->middleRows(from, count);
        if (!simulate(x, r, residuals.segment(from, count), &part)) return false;
      } else if (!simulate(x, r, residuals.segment(from, count), nullptr)) {
        return false;
      }
      for (Eigen::Index k = 0; k < count; ++k) {
        const double measured_v = record.data.voltage_v[static_cast<std::size_t>(k)];
        if (std::isfinite(measured_v)) {
          residuals[from + k] -= measured_v;
          continue;
        }
        residuals[from + k] = 0;
        if (jacobian != nullptr) jacobian->row(from + k).setZero();
      }
      from += count;
      if (const auto soc = unknown("initial_soc", r); soc && record.initial_soc_sigma > 0) {
        const Eigen::Index column = *soc;
        const double weight = options_.voltage_sigma_v / record.initial_soc_sigma;
        residuals[belief] = weight * (x[column] - record.initial_soc);
        if (jacobian != nullptr) (*jacobian)(belief, column) = weight;
        ++belief;
      }
    }
    if (ties() == 0) return true;
    const auto count = static_cast<Eigen::Index>(nodes());
    for (Eigen::Index k = 0, row = belief; k < 3 * count; ++k) {
      if (k % count == count - 1) continue;
      const double weight_v = options_.tie_v / neighbours_differ[static_cast<std::size_t>(k / count)];
      residuals[row] = weight_v * std::log(x[k + 1] / x[k]);
      if (jacobian != nullptr) {
        (*jacobian)(row, k) = -weight_v / x[k];
        (*jacobian)(row, k + 1) = weight_v / x[k + 1];
      }
      ++row;
    }
    return true;
  };
  return p;
}

std::vector<double> nodes_for(double soc_min, double soc_max) {
  constexpr double narrow = 0.15;
  if (soc_max - soc_min < narrow) return {std::clamp(std::round(50 * (soc_min + soc_max)) / 100, 0.0, 1.0)};
  std::vector<double> nodes;
  for (int tenth = 0; tenth <= 10; ++tenth) {
    const double soc = tenth / 10.0;
    if (soc > soc_min - 0.05 && soc < soc_max + 0.05) nodes.push_back(soc);
  }
  return nodes;
}

}  // namespace bms::identification
