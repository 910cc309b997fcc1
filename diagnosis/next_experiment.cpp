#include "diagnosis/next_experiment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "diagnosis/decision.hpp"
#include "diagnosis/reference.hpp"
#include "diagnosis/texts.hpp"

namespace bms::diagnosis {

namespace {

using model::catalogue;

constexpr std::size_t most_rivals = 5;
constexpr double rows_at_most = 1'500;  ///< a coarse course is enough to choose by
constexpr double lowest_soc = 0.02, highest_soc = 0.99;

/// A hypothesis as it holds for a later recording, and what the earlier ones know of it.
struct Rival {
  std::size_t mechanism = 0;
  Hypothesis hypothesis;
  Eigen::MatrixXd information;  ///< of what is sought
};

Rival later(std::size_t mechanism, const Fitted& f) {
  Rival r{mechanism, {later_recording(f.hypothesis), f.hypothesis.own, {}}, {}};
  for (MechanismSetting& s : r.hypothesis.settings) {
    if (s.index == mechanism_index("ocv_hysteresis")) s.value[3] = 1;  // every design begins charged
  }
  const std::vector<ParameterRef> sought = f.hypothesis.sought();
  std::vector<Eigen::Index> kept;
  for (std::size_t j = 0; j < sought.size(); ++j) {
    if (r.hypothesis.find(f.hypothesis.settings[sought[j].setting].index) != nullptr)
      kept.push_back(static_cast<Eigen::Index>(j));
  }
  const auto n = static_cast<Eigen::Index>(kept.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j)
      covariance(i, j) = f.covariance(kept[static_cast<std::size_t>(i)], kept[static_cast<std::size_t>(j)]);
  }
  for (Eigen::Index i = 0; i < n; ++i) covariance(i, i) = covariance(i, i) * (1 + 1e-6) + 1e-18;
  if (n > 0) r.information = covariance.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  return r;
}

/// The least charge that any of them leaves the cell: a course for more would run it empty.
double least_capacity_ah(double capacity_ah, const std::vector<Rival>& rivals) {
  double least = 1;
  for (const Rival& r : rivals) {
    if (const MechanismSetting* s = r.hypothesis.find(mechanism_index("capacity_change")))
      least = std::min(least, 1 - s->value[0]);
  }
  return least < 0.995 ? std::floor(100 * capacity_ah * least) / 100 : capacity_ah;
}

/// What a hypothesis' current sensor reads of a current: its laws undone by halving.
double read_a(const model::ChosenLaws<double>& laws, double true_a, double capacity_ah) {
  double low = 2 * std::min(true_a, 0.0) - capacity_ah, high = 2 * std::max(true_a, 0.0) + capacity_ah;
  for (int k = 0; k < 60; ++k) {
    const double middle = (low + high) / 2;
    (laws.true_current(middle) < true_a ? low : high) = middle;
  }
  return (low + high) / 2;
}

/// A course as a recording of which nothing has been read yet.
struct Plan {
  PreparedRecording record;
  std::vector<experiments::ProfileRow> rows;
};

Plan planned(const experiments::Experiment& experiment, const model::CellParameters<>& cell, double capacity_ah,
             double step_s, bool temperature) {
  experiments::ExperimentOptions options;
  options.capacity_ah = capacity_ah;
  options.step_s = step_s;
  Plan p{{}, bms::experiments::experiment(experiment.name, options).value()};
  PreparedRecording& r = p.record;
  r.initial_soc = experiment.start_soc;
  r.initial_soc_sigma = std::max(cell.tolerance.initial_soc, 1e-4);
  for (const experiments::ProfileRow& row : p.rows) {
    r.time_s.push_back(row.time_s);
    r.current_a.push_back(row.current_a);
    r.voltage_v.push_back(0);
    if (temperature || std::isfinite(row.temperature_c))
      r.temperature_c.push_back(std::isfinite(row.temperature_c) ? row.temperature_c : 25);
  }
  return p;
}

/// What the instruments of a hypothesis would read on the course, and trusted ones beside them. within: whether the
/// cell stays inside its limits.
PreparedRecording read_under(const Rival& truth, const Plan& plan, const model::CellParameters<>& cell, bool& within) {
  PreparedRecording r = plan.record;
  const std::vector<MechanismSetting>& settings = truth.hypothesis.settings;
  const model::ChosenLaws<double> laws = model::chosen<double>(settings, cell.capacity_ah);
  double known_a = 0, known_read_a = read_a(laws, 0, cell.capacity_ah);
  for (double& a : r.current_a) {
    if (a != known_a) known_a = a, known_read_a = read_a(laws, a, cell.capacity_ah);
    a = known_read_a;
  }
  std::vector<MechanismSetting> inside = settings;
  std::erase_if(inside, [](const MechanismSetting& s) {
    return s.index == mechanism_index("voltage_offset") || s.index == mechanism_index("voltage_gain") ||
           s.index == mechanism_index("contact_step");
  });
  std::vector<double> soc, current_ref_a, voltage_ref_v;
  const std::vector<double> volts = predict(cell, settings, r, &soc), terminal_v = predict(cell, inside, r);
  for (std::size_t k = 0; k < r.size(); ++k) {
    const experiments::ProfileRow& row = plan.rows[k];
    const bool source = std::isfinite(row.source_v);
    r.voltage_v[k] = source ? laws.reading(row.source_v) : volts[k];
    current_ref_a.push_back(row.current_ref_a());
    voltage_ref_v.push_back(row.voltmeter ? terminal_v[k] : row.source_v);
    within = within && soc[k] > lowest_soc && soc[k] < highest_soc && volts[k] > cell.limits.voltage_min_v &&
             volts[k] < cell.limits.voltage_max_v;
  }
  average_references(r, current_ref_a, voltage_ref_v, cell);
  return r;
}

/// What a rival still misses of it, by -2 log posterior.
double missed(const Rival& rival, const PreparedRecording& seen, const model::CellParameters<>& cell,
              const NoiseModel& noise) {
  const LikelihoodModel evidence(cell,
                                 std::vector<MechanismSetting>(rival.hypothesis.settings.begin(),
                                                               rival.hypothesis.settings.begin() +
                                                                   static_cast<std::ptrdiff_t>(rival.hypothesis.own)),
                                 {seen}, noise);
  const Eigen::VectorXd none = evidence.unchanged();
  const std::vector<ParameterRef> sought = rival.hypothesis.sought();
  const Eigen::VectorXd apart = evidence.residual(rival.hypothesis, none);
  if (apart.squaredNorm() < decision::same) return apart.squaredNorm();  // no more than that
  const Columns base = evidence.calibration_derivatives(rival.hypothesis, none),
                own = evidence.derivatives(rival.hypothesis, none, sought);
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

}  // namespace

std::optional<NextExperiment> next_experiment(const model::CellParameters<>& cell, const Diagnosis& d, const Finding& f,
                                              bool temperature) {
  if (f.rivals.empty()) return std::nullopt;
  std::vector<Rival> set = {later(f.setting.index, {d.extended, d.covariance})};
  for (std::size_t k = 0; k < f.rivals.size() && set.size() < most_rivals; ++k)
    set.push_back(later(f.equivalent_to[k], f.rivals[k]));
  const double capacity_ah = least_capacity_ah(cell.capacity_ah, set);

  struct Judged {
    NextExperiment next;
    double sum = 0;
    bool all = false;
  };
  std::vector<std::pair<double, const experiments::Experiment*>> designs;
  for (const experiments::Experiment& e : experiments::experiments()) {
    if (std::isfinite(e.start_soc))
      designs.emplace_back(planned(e, cell, capacity_ah, 10, temperature).record.duration_s(), &e);
  }
  std::stable_sort(designs.begin(), designs.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::optional<Judged> best;
  for (const auto& [duration_s, design] : designs) {
    const experiments::Experiment& e = *design;
    const double step_s = e.step_s < 1 ? e.step_s : std::max(1.0, std::ceil(duration_s / rows_at_most));
    const Plan plan = planned(e, cell, capacity_ah, step_s, temperature);
    NoiseModel noise = d.noise;
    noise.white_v /= std::sqrt(std::max(step_s, 1.0));  // a row stands for so many readings
    Judged j{{std::string(e.name),
              capacity_ah,
              e.start_soc,
              e.step_s,
              plan.record.duration_s(),
              {f.setting.index},
              {},
              std::numeric_limits<double>::infinity()},
             0,
             true};
    bool within = true;
    std::vector<PreparedRecording> seen;
    for (const Rival& truth : set) seen.push_back(read_under(truth, plan, cell, within));
    if (!within) continue;
    // every pair both ways: whoever is right must be found
    for (std::size_t b = 1; b < set.size(); ++b) {
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t a = 0; a < b; ++a) {
        const double gain = std::min(missed(set[b], seen[a], cell, noise), missed(set[a], seen[b], cell, noise));
        j.sum += std::min(gain, decision::settled);
        j.all = j.all && gain >= decision::settled;
        if (a == 0) least = gain;
      }
      if (least >= decision::same)
        j.next.separates.push_back(set[b].mechanism), j.next.gain = std::min(j.next.gain, least);
      else
        j.next.leaves.push_back(set[b].mechanism);
    }
    if (j.next.separates.size() < 2) continue;
    const bool enough = j.all;
    if (!best || enough || j.sum > best->sum) best = std::move(j);
    if (enough) break;  // the others take longer
  }
  if (!best) return std::nullopt;
  return best->next;
}

std::optional<NextExperiment> next_experiment(const model::CellParameters<>& cell, const Diagnosis& d,
                                              bool temperature) {
  for (const Finding& f : d.findings) {
    if (f.rivals.empty()) continue;
    if (auto next = next_experiment(cell, d, f, temperature)) return next;
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
  return fmt::format("To tell {} from {}: {} ({}).", text_of_mechanism(n.separates.front()).name, joined(others, "and"),
                     experiments::find_experiment(n.profile)->description, duration_text(n.duration_s));
}

}  // namespace bms::diagnosis
