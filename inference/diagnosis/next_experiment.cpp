#include "diagnosis/next_experiment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "diagnosis/experiment_plan.hpp"
#include "diagnosis/texts.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Design& design_limits = thresholds.design;
constexpr const Numerics::Design& design_numerics = numerics.design;

/// A hypothesis as it holds for a later recording, and what the earlier ones know of it.
struct Rival {
  std::size_t mechanism = 0;
  Hypothesis hypothesis;
  Eigen::MatrixXd information;  ///< of its estimated parameters
};

Rival in_later_recording(std::size_t mechanism, const Fitted& f) {
  Rival r{mechanism, {later_recording(f.hypothesis), f.hypothesis.own, {}}, {}};
  for (MechanismSetting& s : r.hypothesis.settings)
    knowledge_of(s.index).after_full_charge(s);  // each design begins so
  const std::vector<ParameterRef> sought = f.hypothesis.sought();
  std::vector<Eigen::Index> kept;
  for (std::size_t j = 0; j < sought.size(); ++j) {
    if (r.hypothesis.find(f.hypothesis.settings[sought[j].setting].index) != nullptr)
      kept.push_back(static_cast<Eigen::Index>(j));
  }
  const auto n = static_cast<Eigen::Index>(kept.size());
  Eigen::MatrixXd covariance = f.covariance(kept, kept);
  for (Eigen::Index i = 0; i < n; ++i)
    covariance(i, i) = covariance(i, i) * (1 + design_numerics.covariance_share) + design_numerics.covariance;
  if (n > 0) r.information = covariance.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  return r;
}

/// The least charge that any of them leaves the cell: a course for more would run it empty.
double least_capacity_ah(double capacity_ah, const std::vector<Rival>& rivals) {
  double least = 1;
  for (const Rival& r : rivals) {
    for (const MechanismSetting& s : r.hypothesis.settings)
      least = std::min(least, knowledge_of(s.index).capacity_share(s));
  }
  if (least >= design_limits.capacity_lost) return capacity_ah;
  return std::floor(design_numerics.capacity_steps_per_ah * capacity_ah * least) /
         design_numerics.capacity_steps_per_ah;
}

/// Gain by which a rival would still miss a recording after it has adapted, in -2 log posterior.
double missed(const Rival& rival, const PreparedRecording& seen, const model::CellParameters<>& cell,
              const NoiseModel& noise) {
  const std::vector<MechanismSetting>& settings = rival.hypothesis.settings;
  const LikelihoodModel likelihood(
      cell, {settings.begin(), settings.begin() + static_cast<std::ptrdiff_t>(rival.hypothesis.own)}, {seen}, noise);
  const Eigen::VectorXd none = likelihood.unchanged();
  const std::vector<ParameterRef> sought = rival.hypothesis.sought();
  const Eigen::VectorXd apart = likelihood.residual(rival.hypothesis, none);
  if (apart.squaredNorm() < thresholds.decision.tie) return apart.squaredNorm();  // no more than that
  const Columns base = likelihood.calibration_derivatives(rival.hypothesis, none),
                own = likelihood.derivatives(rival.hypothesis, none, sought);
  Columns free(base.rows(), base.cols() + own.cols());
  free.leftCols(base.cols()) = base;
  if (own.cols() > 0) free.rightCols(own.cols()) = own;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(free.cols(), free.cols());
  normal.selfadjointView<Eigen::Lower>().rankUpdate(free.transpose());
  normal = Eigen::MatrixXd(normal.selfadjointView<Eigen::Lower>());
  normal.topLeftCorner(base.cols(), base.cols()).diagonal().array() += 1;
  if (own.cols() > 0) normal.bottomRightCorner(own.cols(), own.cols()) += rival.information;
  const Eigen::VectorXd toward = free.transpose() * apart;
  return std::max(0.0, apart.squaredNorm() - toward.dot(normal.ldlt().solve(toward)));
}

struct Judged {
  NextExperiment next;
  double sum = 0;    ///< of all pairs' gains, each up to Design::separates
  bool all = false;  ///< separates every pair
};

/// What a course would show of a set of rivals, the finding first; nothing if the cell would leave its design_limits.
std::optional<Judged> judged(const experiments::Experiment& e, const PlanSetting& setting, double duration_s,
                             const std::vector<Rival>& set, NoiseModel noise) {
  const double step_s = coarse_step_s(e, duration_s);
  const ExperimentPlan plan = planned(e, setting, step_s);
  noise = of_coarse_rows(noise, step_s);
  bool within = true;
  std::vector<PreparedRecording> seen;
  for (const Rival& truth : set) seen.push_back(read_under(truth.hypothesis.settings, plan, setting.cell, within));
  if (!within) return std::nullopt;
  Judged j{{.profile = std::string(e.name),
            .capacity_ah = setting.capacity_ah,
            .start_soc = e.start_soc,
            .step_s = e.step_s,
            .duration_s = plan.record.duration_s(),
            .separates = {set.front().mechanism},
            .leaves = {},
            .gain = std::numeric_limits<double>::infinity()},
           0,
           true};
  // every pair both ways: whichever is true must be found
  for (std::size_t b = 1; b < set.size(); ++b) {
    double from_finding = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < b; ++a) {
      const double gain =
          std::min(missed(set[b], seen[a], setting.cell, noise), missed(set[a], seen[b], setting.cell, noise));
      j.sum += std::min(gain, design_limits.separates);
      j.all = j.all && gain >= design_limits.separates;
      if (a == 0) from_finding = gain;
    }
    if (from_finding < thresholds.decision.tie) {
      j.next.leaves.push_back(set[b].mechanism);
      continue;
    }
    j.next.separates.push_back(set[b].mechanism);
    j.next.gain = std::min(j.next.gain, from_finding);
  }
  return j;
}

}  // namespace

std::optional<NextExperiment> next_experiment(const model::CellParameters<>& cell, const Diagnosis& d, const Finding& f,
                                              bool temperature, const std::vector<std::string>& carried_out) {
  if (f.rivals.empty()) return std::nullopt;
  std::vector<Rival> set = {in_later_recording(f.setting.index, {d.extended, d.covariance})};
  for (std::size_t k = 0; k < f.rivals.size() && set.size() < design_limits.rivals; ++k)
    set.push_back(in_later_recording(f.equivalent_to[k], f.rivals[k]));
  const PlanSetting setting{cell, least_capacity_ah(cell.capacity_ah, set), temperature};

  std::optional<Judged> best;
  for (const auto& [duration_s, course] : courses(setting)) {
    if (std::find(carried_out.begin(), carried_out.end(), course->name) != carried_out.end()) continue;
    std::optional<Judged> j = judged(*course, setting, duration_s, set, d.noise);
    if (!j || j->next.separates.size() < 2) continue;
    const bool enough = j->all;
    if (!best || enough || j->sum > best->sum) best = std::move(j);
    if (enough) break;  // the others take longer
  }
  if (!best) return std::nullopt;
  return best->next;
}

std::optional<NextExperiment> next_experiment(const model::CellParameters<>& cell, const Diagnosis& d, bool temperature,
                                              const std::vector<std::string>& carried_out) {
  for (const Finding& f : d.findings) {
    if (f.rivals.empty()) continue;
    if (auto next = next_experiment(cell, d, f, temperature, carried_out)) return next;
  }
  return std::nullopt;
}

std::string command(const NextExperiment& n) {
  return fmt::format("bms experiment {} --capacity-ah {:g} --out {}.csv", n.profile, n.capacity_ah, n.profile);
}

std::string_view instruction(const NextExperiment& n) { return experiments::find_experiment(n.profile)->instruction; }

std::string why(const NextExperiment& n) {
  std::vector<std::string> others;
  for (std::size_t k = 1; k < n.separates.size(); ++k) others.emplace_back(text_of_mechanism(n.separates[k]).name);
  return fmt::format("To distinguish {} from {}: {} ({}).", text_of_mechanism(n.separates.front()).name,
                     joined(others, "and"), experiments::find_experiment(n.profile)->description,
                     duration_text(n.duration_s));
}

}  // namespace bms::diagnosis
