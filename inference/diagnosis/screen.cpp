#include "diagnosis/screen.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "diagnosis/bursts.hpp"
#include "diagnosis/thresholds.hpp"
#include "numerics/in_parallel.hpp"

namespace bms::diagnosis {

namespace {

using model::Role;
constexpr const Thresholds::Screening& screening_limits = thresholds.screening;
constexpr const Numerics::Signatures& signature_numerics = numerics.signatures;

/// Regular.
Eigen::MatrixXd with_ridge(Eigen::MatrixXd gram) {
  for (Eigen::Index i = 0; i < gram.rows(); ++i)
    gram(i, i) = gram(i, i) * (1 + signature_numerics.ridge_share) + signature_numerics.ridge;
  return gram;
}

/// Returns true if both have the same form of their law: all parameters with Role::given are equal.
bool same_form(const MechanismSetting& a, const MechanismSetting& b) {
  const model::MechanismInfo& info = model::catalogue[a.index];
  for (std::size_t k = 0; k < info.parameters; ++k) {
    if (info.parameter[k].role == Role::given && a.value[k] != b.value[k]) return false;
  }
  return a.index == b.index;
}

std::vector<ResidualProjection::Products> products_of(const ResidualProjection& projection,
                                                      const std::vector<Columns>& blocks) {
  std::vector<std::optional<ResidualProjection::Products>> of(blocks.size());
  numerics::in_parallel(blocks.size(), [&](std::size_t k) { of[k].emplace(projection.of(blocks[k])); });
  std::vector<ResidualProjection::Products> products;
  for (auto& p : of) products.push_back(std::move(*p));
  return products;
}

}  // namespace

Eigen::VectorXd Screen::toward(const Probe& probe) const {
  return products_[probe.block].toward().segment(probe.first, static_cast<Eigen::Index>(probe.parameters.size()));
}

namespace {

/// The best changes of a probe's parameters, to first order. A strength that has one sign and would get the other one
/// is left out; 0 if no strength is left, because nothing else acts without one.
Eigen::VectorXd within_bounds(const Eigen::MatrixXd& gram, const Eigen::VectorXd& toward, const Probe& p) {
  std::vector<Eigen::Index> free(p.parameters.size());
  std::iota(free.begin(), free.end(), Eigen::Index{0});
  while (true) {
    const auto parameter = [&](Eigen::Index k) -> const model::Parameter& {
      return model::catalogue[p.setting.index].parameter[p.parameters[static_cast<std::size_t>(k)]];
    };
    const bool any = std::any_of(free.begin(), free.end(), [&](auto k) { return parameter(k).role == Role::strength; });
    Eigen::VectorXd found = Eigen::VectorXd::Zero(toward.size());
    const bool first = !free.empty() && free.front() == 0;
    if (!any || (!first && knowledge_of(p.setting.index).needs_first_strength)) return found;
    const Eigen::MatrixXd of_free = gram(free, free);
    const Eigen::VectorXd toward_free = toward(free), solved = of_free.ldlt().solve(toward_free);
    for (std::size_t k = 0; k < free.size(); ++k) found[free[k]] = solved[static_cast<Eigen::Index>(k)];
    const auto of_other_sign = [&](Eigen::Index k) {
      const model::Parameter& of = parameter(k);
      const std::size_t place = p.parameters[static_cast<std::size_t>(k)];
      return of.role == Role::strength && knowledge_of(p.setting.index).bounds(place, {of.low, of.high}, 0).low >= 0 &&
             found[k] + p.setting.value[place] < 0;
    };
    if (std::erase_if(free, of_other_sign) == 0) return found;
  }
}

}  // namespace

void Screen::judge(const LikelihoodModel& likelihood, const Probe& p) {
  const std::size_t mechanism = p.setting.index;
  const double capacity_ah = likelihood.cell().capacity_ah;
  Eigen::MatrixXd gram = products_[p.block].gram(p.first, static_cast<Eigen::Index>(p.parameters.size()));
  const Eigen::MatrixXd regular = with_ridge(gram);
  const Eigen::VectorXd found = within_bounds(regular, toward(p), p);
  double gain = std::max(0.0, toward(p).dot(found));
  const std::size_t unknowns = p.parameters.size() + (is_searched(mechanism, capacity_ah) ? 1 : 0);
  gain -= (static_cast<double>(unknowns) - 1) * screening_limits.per_unknown;

  auto c = std::find_if(candidates_.begin(), candidates_.end(),
                        [&](const Candidate& other) { return other.mechanism == mechanism; });
  if (c == candidates_.end()) {
    candidates_.push_back({mechanism, p.setting, {}, {}, -std::numeric_limits<double>::infinity(), 0, 0, 0});
    best_.push_back({p, gram});
    c = candidates_.end() - 1;
  }
  const double sigma = std::sqrt(std::max(regular.inverse()(0, 0), 0.0));  // its places free
  if (c->least_sigma == 0 || sigma < c->least_sigma) c->least_sigma = sigma;
  if (std::isnan(gain)) return;
  const MechanismSetting start = knowledge_of(mechanism).start({p.setting, p.parameters, found, capacity_ah});
  keep_form(gain, start);
  if (gain <= c->gain) return;
  c->gain = gain;
  c->estimate = found[0] + p.setting.value[p.parameters[0]];
  c->sigma = sigma;
  c->start = start;
  best_[static_cast<std::size_t>(c - candidates_.begin())] = {p, std::move(gram)};
}

/// The best start of each form of a mechanism's law.
void Screen::keep_form(double gain, const MechanismSetting& start) {
  if (knowledge_of(start.index).forms < 2) return;
  const auto known =
      std::find_if(forms_.begin(), forms_.end(), [&](const FormStart& f) { return same_form(f.start, start); });
  if (known == forms_.end())
    forms_.push_back({gain, start});
  else if (gain > known->gain)
    *known = {gain, start};
}

/// Bursts have no shape that could be projected: they are searched, and their gain is that of one column.
void Screen::judge_bursts(const LikelihoodModel& likelihood, const HypothesisFit& around,
                          const ResidualProjection& projection, std::size_t mechanism) {
  BurstSearch bursts = find_bursts(likelihood, around);
  // what the cell file's own resistance is not accurate to is not a contact
  const model::CellParameters<>& cell = likelihood.cell();
  const double least_ohm =
      cell.tolerance.resistance_fraction * model::cell_detail::rc_value(cell.rc, cell.rc.r0_ohm, numerics.middle_soc);
  if (bursts.count == 0 || bursts.resistance_ohm <= least_ohm) return;
  likelihood.whiten(bursts.column);
  const ResidualProjection::Products one = projection.of(bursts.column);
  const double g = one.gram(0, 1)(0, 0), b = one.toward()[0];
  Candidate c{mechanism, {mechanism, {}, {}}, {}, std::move(bursts.spans), 0, 0, 0, 0};
  if (g > 0 && b > 0) c.gain = b * b / g - thresholds.decision.per_burst * static_cast<double>(bursts.count);
  c.start.value[contact_resistance] = bursts.resistance_ohm;
  c.start.value[burst_share] = bursts.covered_s / std::max(likelihood.records().front().duration_s(), 1.0);
  if (c.gain <= 0) return;
  best_.push_back({{c.start, {}, 0, 0}, {}});
  candidates_.push_back(std::move(c));
}

void Screen::sort() {
  std::vector<std::size_t> order(candidates_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return candidates_[a].gain > candidates_[b].gain; });
  std::vector<Candidate> candidates;
  std::vector<Shape> best;
  for (const std::size_t k : order) {
    candidates.push_back(candidates_[k]);
    best.push_back(best_[k]);
  }
  candidates_ = std::move(candidates);
  best_ = std::move(best);
}

Screen::Screen(const LikelihoodModel& likelihood, const HypothesisFit& around, const std::vector<std::size_t>& over)
    : Screen(likelihood, around, over, ResidualProjection(likelihood, around)) {}

Screen::Screen(const LikelihoodModel& likelihood, const HypothesisFit& around, const std::vector<std::size_t>& over,
               const ResidualProjection& projection)
    : signatures_(signatures(likelihood, around, over)), products_(products_of(projection, signatures_.blocks)) {
  for (const Probe& p : signatures_.probes) judge(likelihood, p);
  for (const std::size_t mechanism : over) {
    if (knowledge_of(mechanism).signature != Signature::contact_bursts) continue;
    if (around.hypothesis.find(mechanism) != nullptr || not_testable(likelihood, around.hypothesis, mechanism))
      continue;
    judge_bursts(likelihood, around, projection, mechanism);
  }
  for (Candidate& c : candidates_) {
    for (const FormStart& f : forms_) {
      if (f.start.index == c.mechanism && !same_form(f.start, c.start)) c.other_forms.push_back(f.start);
    }
  }
  sort();
}

/// Share of what a explains in its best direction that b's columns can follow, as a correlation.
double Screen::alike(std::size_t a, std::size_t b) const {
  const Shape &shape_a = best_[a], &shape_b = best_[b];
  const Probe &pa = shape_a.probe, &pb = shape_b.probe;
  const auto na = static_cast<Eigen::Index>(pa.parameters.size()), nb = static_cast<Eigen::Index>(pb.parameters.size());
  if (na == 0 || nb == 0) return 0;
  const Eigen::VectorXd x = with_ridge(shape_a.gram).ldlt().solve(toward(pa)),
                        along = products_[pb.block].with(products_[pa.block]).block(pb.first, pa.first, nb, na) * x;
  const double norm = x.dot(shape_a.gram * x);
  Eigen::MatrixXd g = shape_b.gram;
  for (Eigen::Index i = 0; i < nb; ++i) g(i, i) *= 1 + signature_numerics.ridge_share;
  return norm > 0 ? std::sqrt(std::clamp(along.dot(g.ldlt().solve(along)) / norm, 0.0, 1.0)) : 0;
}

}  // namespace bms::diagnosis
