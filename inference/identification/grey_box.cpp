#include "identification/grey_box.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <limits>
#include <memory>
#include <stdexcept>

#include "arithmetic/dual_number.hpp"
#include "identification/discretiser.hpp"
#include "identification/grey_box_limits.hpp"
#include "identification/ocv_curve.hpp"
#include "identification/ocv_error.hpp"

namespace bms::identification {

namespace {

enum Lane : std::size_t { by_soc, by_v_rc, by_r0, by_r1, by_c1, lanes };
using Local = arithmetic::DualNumber<arithmetic::whole_registers(lanes)>;
using Tables = model::Cell<double, model::max_intervals>;

double value_of(double v) { return v; }
double value_of(const Local& v) { return v.a; }

/// An independent variable of the step: its derivative in its own lane is 1.
template <class S>
S local(double value, Lane own_lane) {
  if constexpr (std::same_as<S, double>)
    return value;
  else
    return Local(value, own_lane);
}

/// A value of a table with its slope by SOC, and a lane of its own if it is an unknown.
Local tabled(double value, double delta, double per_width, Lane own_lane = lanes) {
  Local v(value);
  v.v.set(by_soc, delta * per_width);
  if (own_lane != lanes) v.v.set(own_lane, 1);
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

/// |SOC| from which on a simulation counts as not finite.
constexpr double largest_soc = 7;

/// The two nodes around an SOC and the weight of the upper one.
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

/// Linear between the edges, constant beyond.
double half_gap_v(const model::OcvTable<double>& ocv, double soc) {
  const auto begin = ocv.soc.value.begin(), end = begin + static_cast<std::ptrdiff_t>(ocv.soc.size);
  const auto above = static_cast<std::size_t>(std::upper_bound(begin, end, soc) - begin);
  if (above == 0) return ocv.half_gap_v[0];
  if (above == ocv.soc.size) return ocv.half_gap_v[above - 1];
  const double t = (soc - ocv.soc[above - 1]) / (ocv.soc[above] - ocv.soc[above - 1]);
  return ocv.half_gap_v[above - 1] + t * (ocv.half_gap_v[above] - ocv.half_gap_v[above - 1]);
}

}  // namespace

const char* Unknown::name() const {
  switch (quantity) {
    case Quantity::r0:
      return "r0_ohm";
    case Quantity::r1:
      return "r1_ohm";
    case Quantity::c1:
      return "c1_f";
    case Quantity::ocv_branch:
      return "ocv_lean";
    case Quantity::initial_v_rc:
      return "initial_v_rc_v";
    case Quantity::initial_soc:
      return "initial_soc";
  }
  return "";
}

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
  for (const Quantity quantity : {Quantity::r0, Quantity::r1, Quantity::c1}) {
    for (const double soc : options_.soc_nodes) unknowns_.push_back({quantity, soc});
  }
  if (options_.estimate_ocv_branch) {
    if (cell_.ocv.half_gap_v.size == 0)
      throw std::invalid_argument("the cell file has no half gap, so the OCV branch position cannot be identified");
    unknowns_.push_back({Quantity::ocv_branch});
  }
  for (std::size_t r = 0; r < records_.size(); ++r) {
    if (records_[r].data.size() < 2) throw std::invalid_argument("a recording has fewer than two samples");
    samples_ += records_[r].data.size();
    if (records_[r].estimate_initial_v_rc) unknowns_.push_back({Quantity::initial_v_rc, records_[r].initial_soc, r});
    if (!records_[r].estimate_initial_soc) continue;
    unknowns_.push_back({Quantity::initial_soc, records_[r].initial_soc, r});
    if (records_[r].initial_soc_sigma > 0) ++priors_;
  }
}

std::optional<Eigen::Index> GreyBox::unknown(Quantity quantity, std::size_t record) const {
  for (std::size_t k = 3 * nodes(); k < unknowns_.size(); ++k) {
    if (unknowns_[k].quantity == quantity && unknowns_[k].record == record) return static_cast<Eigen::Index>(k);
  }
  return std::nullopt;
}

Eigen::VectorXd GreyBox::start() const {
  const auto rc = [&](const auto& column, double soc) { return model::cell_detail::rc_value(cell_.rc, column, soc); };
  const auto value_of = [&](const Unknown& u) -> double {
    switch (u.quantity) {
      case Quantity::r0:
        return rc(cell_.rc.r0_ohm, u.soc);
      case Quantity::r1:
        return rc(cell_.rc.r1_ohm, u.soc);
      case Quantity::c1:
        return rc(cell_.rc.c1_f, u.soc);
      case Quantity::ocv_branch:
        return cell_.ocv.lean;
      case Quantity::initial_soc:
        return u.soc;
      case Quantity::initial_v_rc:
        return 0;
    }
    return 0;
  };
  Eigen::VectorXd x(static_cast<Eigen::Index>(unknowns_.size()));
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const Unknown& u = unknowns_[static_cast<std::size_t>(k)];
    const Limits limits = limits_within(u.quantity, cell_, options_.bounds);
    x[k] = std::clamp(value_of(u), limits.lower, limits.upper);
  }
  return x;
}

model::CellParameters<> GreyBox::cell_with(const Eigen::VectorXd& x) const {
  const auto ocv_branch = unknown(Quantity::ocv_branch, 0);
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
  const auto v_rc_unknown = unknown(Quantity::initial_v_rc, r), soc_unknown = unknown(Quantity::initial_soc, r),
             branch_unknown = unknown(Quantity::ocv_branch, 0);
  const double per_as = 1 / (3'600 * cell_.capacity_ah);

  double soc = soc_unknown ? x[*soc_unknown] : record.initial_soc;
  double v_rc_v = v_rc_unknown ? x[*v_rc_unknown] : 0;
  Eigen::VectorXd v_rc_by = Eigen::VectorXd::Zero(x.size()), voltage_by(x.size());  // d v_rc / d unknowns
  if (v_rc_unknown) v_rc_by[*v_rc_unknown] = 1;

  const auto n = static_cast<Eigen::Index>(nodes());
  // adds a local derivative by R0, R1 or C1 (column 0, 1, 2) to the two nodes around the SOC
  const auto spread = [&](Eigen::VectorXd& by, double derivative, Eigen::Index column, const Between& b) {
    by[column * n + static_cast<Eigen::Index>(b.below)] += derivative * (1 - b.weight_above);
    by[column * n + static_cast<Eigen::Index>(b.above)] += derivative * b.weight_above;
  };
  std::uint8_t interval = 0;
  Discretiser<S> discretiser(n > 1);
  for (std::size_t k = 0; k < data.size(); ++k) {
    const double duration_s = k == 0 ? 0 : data.time_s[k] - data.time_s[k - 1];
    const double current_a = std::isfinite(data.current_a[k]) ? data.current_a[k] : 0;
    soc += current_a * duration_s * per_as;
    if (!(std::abs(soc) < largest_soc)) return false;
    const auto at = localised<S>(model::look_up(*tables, soc, interval));
    const model::StepInput<S> input{S(current_a), S(duration_s)};
    [[maybe_unused]] Between around;
    if constexpr (with_derivatives) around = between(options_.soc_nodes, soc);

    if (duration_s > 0) {
      const S state = Model::advance({local<S>(v_rc_v, by_v_rc)}, at, discretiser.of(at, duration_s), input)[0];
      v_rc_v = value_of(state);
      if constexpr (with_derivatives) {
        v_rc_by *= state.v[by_v_rc];
        spread(v_rc_by, state.v[by_r1], 1, around);
        spread(v_rc_by, state.v[by_c1], 2, around);
        if (soc_unknown) v_rc_by[*soc_unknown] += state.v[by_soc];
      }
    }
    const S voltage = Model::voltage({local<S>(v_rc_v, by_v_rc)}, at, input);
    if (!std::isfinite(value_of(voltage))) return false;
    const auto row = static_cast<Eigen::Index>(k);
    voltage_v[row] = value_of(voltage);
    if constexpr (with_derivatives) {
      voltage_by = v_rc_by * voltage.v[by_v_rc];
      spread(voltage_by, voltage.v[by_r0], 0, around);
      if (soc_unknown) voltage_by[*soc_unknown] += voltage.v[by_soc];
      if (branch_unknown) voltage_by[*branch_unknown] += half_gap_v(cell_.ocv, soc);
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
    const Limits limits = limits_within(unknowns_[static_cast<std::size_t>(k)].quantity, cell_, options_.bounds);
    p.lower[k] = limits.lower;
    p.upper[k] = limits.upper;
    p.scale[k] = limits.scale;
  }
  p.evaluate = [this](const Eigen::VectorXd& x, Eigen::VectorXd& residuals, Eigen::MatrixXd* jacobian) {
    return evaluate(x, residuals, jacobian);
  };
  return p;
}

bool GreyBox::evaluate(const Eigen::VectorXd& x, Eigen::VectorXd& residuals, Eigen::MatrixXd* jacobian) const {
  const Eigen::Index ocv_rows = ocv_errs() ? OcvError::nodes() : 0;
  const auto rows = static_cast<Eigen::Index>(samples_ + priors_ + ties()) + ocv_rows;
  residuals.setZero(rows);
  if (jacobian != nullptr) jacobian->setZero(rows, x.size());
  Eigen::Index from = 0, prior = static_cast<Eigen::Index>(samples_);
  for (std::size_t r = 0; r < records_.size(); ++r) {
    const DataSet& record = records_[r];
    if (!add_simulation(x, r, from, residuals, jacobian)) return false;
    from += static_cast<Eigen::Index>(record.data.size());
    if (const auto soc = unknown(Quantity::initial_soc, r); soc && record.initial_soc_sigma > 0) {
      const Eigen::Index column = *soc;
      const double weight = options_.voltage_sigma_v / record.initial_soc_sigma;
      residuals[prior] = weight * (x[column] - record.initial_soc);
      if (jacobian != nullptr) (*jacobian)(prior, column) = weight;
      ++prior;
    }
  }
  if (ocv_rows > 0) {
    const OcvError error(ocv_error_prior(), options_.tie_v);
    error.take_out(counted_soc(x), residuals.head(from), residuals.segment(prior, ocv_rows), jacobian, prior);
  }
  if (ties() > 0) add_ties(x, prior + ocv_rows, residuals, jacobian);
  return true;
}

/// Rows of recording r, from row `from` on. Returns false if the simulation is not finite.
bool GreyBox::add_simulation(const Eigen::VectorXd& x, std::size_t r, Eigen::Index from, Eigen::VectorXd& residuals,
                             Eigen::MatrixXd* jacobian) const {
  const Data& data = records_[r].data;
  const auto count = static_cast<Eigen::Index>(data.size());
  if (jacobian != nullptr) {
    Eigen::Ref<Eigen::MatrixXd> part = jacobian->middleRows(from, count);
    if (!simulate(x, r, residuals.segment(from, count), &part)) return false;
  } else if (!simulate(x, r, residuals.segment(from, count), nullptr)) {
    return false;
  }
  for (Eigen::Index k = 0; k < count; ++k) {
    const double measured_v = data.voltage_v[static_cast<std::size_t>(k)];
    if (std::isfinite(measured_v)) {
      residuals[from + k] -= measured_v;
      continue;
    }
    residuals[from + k] = 0;
    if (jacobian != nullptr) jacobian->row(from + k).setZero();
  }
  return true;
}

Eigen::VectorXd GreyBox::counted_soc(const Eigen::VectorXd& x) const {
  Eigen::VectorXd counted(static_cast<Eigen::Index>(samples_));
  Eigen::Index row = 0;
  for (std::size_t r = 0; r < records_.size(); ++r) {
    const Data& data = records_[r].data;
    const auto start = unknown(Quantity::initial_soc, r);
    double soc = start ? x[*start] : records_[r].initial_soc;
    for (std::size_t k = 0; k < data.size(); ++k) {
      if (k > 0 && std::isfinite(data.current_a[k]))
        soc += data.current_a[k] * (data.time_s[k] - data.time_s[k - 1]) / (3'600 * cell_.capacity_ah);
      counted[row++] = std::isfinite(data.voltage_v[k]) ? soc : std::numeric_limits<double>::quiet_NaN();
    }
  }
  return counted;
}

std::pair<double, double> GreyBox::soc_range(const Eigen::VectorXd& x) const {
  std::pair<double, double> range = {1, 0};
  for (const double soc : counted_soc(x)) {
    if (std::isfinite(soc)) range = {std::min(range.first, soc), std::max(range.second, soc)};
  }
  return range;
}

OcvErrorPrior GreyBox::ocv_error_prior() const {
  if (!options_.ocv_ends_unmeasured) return {options_.ocv_sigma_v, 0, 0};
  const model::OcvTable<double>& ocv = cell_.ocv;
  return {options_.ocv_sigma_v, unmeasured_end * ocv.b1_v[0], unmeasured_end * ocv.b1_v[ocv.b1_v.size - 1]};
}

double step_between(std::size_t quantity, double below_soc, double above_soc) {
  constexpr double inner_low = 0.2, inner_high = 0.9, rounding = 1e-9;
  const bool inner = below_soc > inner_low - rounding && above_soc < inner_high + rounding;
  return (inner ? neighbours_differ : neighbours_differ_at_ends)[quantity];
}

/// Logarithmic ratios of neighbouring nodes, weighted by those of Table 9.
void GreyBox::add_ties(const Eigen::VectorXd& x, Eigen::Index row, Eigen::VectorXd& residuals,
                       Eigen::MatrixXd* jacobian) const {
  const auto count = static_cast<Eigen::Index>(nodes());
  for (Eigen::Index k = 0; k < 3 * count; ++k) {
    if (k % count == count - 1) continue;
    const auto node = static_cast<std::size_t>(k % count);
    const double weight_v = options_.tie_v / step_between(static_cast<std::size_t>(k / count), options_.soc_nodes[node],
                                                          options_.soc_nodes[node + 1]);
    residuals[row] = weight_v * std::log(x[k + 1] / x[k]);
    if (jacobian != nullptr) {
      (*jacobian)(row, k) = -weight_v / x[k];
      (*jacobian)(row, k + 1) = weight_v / x[k + 1];
    }
    ++row;
  }
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
