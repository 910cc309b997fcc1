#include "diagnosis/resistance_means.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "arithmetic/dual_number.hpp"
#include "diagnosis/block_covariance.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

/// Parameters whose derivatives go through the laws at once, next to those by the levers.
enum : std::size_t { at_once = 16 };
constexpr std::size_t lanes = at_once, levers = Lever::count;
using Jet = arithmetic::DualNumber<levers + lanes>;

/// The resistances in a row: R0, R1, after a step, and those of the settings.
struct RowResistances {
  Jet r0, r1, step;
  std::vector<Jet> own;
};

/// The resistance of a law whose states follow the current, and what of it acts after a step.
template <class M>
void add_own(model::ChosenLaws<Jet>& laws, const model::TablePoint<Jet>& at, const model::StepInput<Jet>& input,
             Jet& own, Jet& step) {
  using Law = typename M::template Law<Jet>;
  if constexpr (M::parameters[0].unit == "ohm" && requires(const Law& l) { l.relaxation(0, at, input).target; }) {
    const auto& law = laws.template slot<model::mechanism_index_of<M>>();
    if (!law) return;
    for (std::size_t i = 0; i < Law::states; ++i) {
      const auto r = law->relaxation(i, at, input);
      own += r.target / input.current_a;
      step += r.alpha * r.target / input.current_a;
    }
  }
}

class ResistanceMeans {
 public:
  ResistanceMeans(const LikelihoodModel& likelihood, const HypothesisFit& fit, const Load& load)
      : likelihood_(likelihood),
        fit_(fit),
        load_(load),
        unknowns_(fit.calibration.data(), fit.calibration.data() + fit.calibration.size()),
        tables_(model::prepare<double, model::max_intervals>(likelihood.cell())),
        found_(fit.hypothesis.sought()),
        own_(own_parameters(fit.hypothesis)) {}

  Resistances at(bool reference, std::size_t without = no_mechanism) const {
    Resistances sum;
    const Quantity none{0, Eigen::VectorXd::Zero(base() + static_cast<Eigen::Index>(own_.size())),
                        Eigen::VectorXd::Zero(static_cast<Eigen::Index>(found_.size()))};
    sum.r0 = sum.r1 = sum.step = none;
    sum.own.assign(fit_.hypothesis.settings.size(), none);
    const std::size_t parameters = found_.size() + own_.size();
    for (std::size_t first = 0; first == 0 || first < parameters; first += lanes)
      add_batch(reference, without, first, std::min(lanes, parameters - first), sum);
    return sum;
  }

 private:
  Eigen::Index base() const { return fit_.calibration.size(); }

  void add_batch(bool reference, std::size_t without, std::size_t first, std::size_t count, Resistances& sum) const {
    model::ChosenLaws<Jet> laws = laws_without(without, first, count);
    const Jet temperature_c =
        reference ? Jet(likelihood_.cell().reference_temperature_c) : laws.true_temperature(Jet(load_.temperature_c));
    std::uint8_t interval = 0;
    for (const SteppedRow& row : load_.rows) {
      const RowResistances r = resistances_in(row, laws, temperature_c, interval);
      const auto add = [&](const Jet& x, Quantity& to) { add_row(row, x, first, count, to); };
      add(r.r0, sum.r0);
      add(r.r1, sum.r1);
      add(r.step, sum.step);
      for (std::size_t k = 0; k < r.own.size(); ++k) add(r.own[k], sum.own[k]);
    }
  }

  model::ChosenLaws<Jet> laws_without(std::size_t without, std::size_t first, std::size_t count) const {
    std::vector<model::MechanismValues<Jet>> values;
    for (const MechanismSetting& s : fit_.hypothesis.settings) {
      auto& v = values.emplace_back();
      for (std::size_t p = 0; p < v.size(); ++p) v[p] = Jet(s.value[p]);
    }
    for (std::size_t lane = 0; lane < count; ++lane) {
      const std::size_t j = first + lane;
      const ParameterRef ref = j < found_.size() ? found_[j] : own_[j - found_.size()].ref;
      values[ref.setting][ref.parameter].v.set(levers + lane, 1);
    }
    model::ChosenLaws<Jet> laws;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const std::size_t m = fit_.hypothesis.settings[k].index;
      if (m != without) model::choose<Jet>(laws, m, values[k], likelihood_.cell().capacity_ah);
    }
    return laws;
  }

  RowResistances resistances_in(const SteppedRow& row, model::ChosenLaws<Jet>& laws, const Jet& temperature_c,
                                std::uint8_t& interval) const {
    const Jet soc(row.soc);
    model::TablePoint<Jet> at = model::look_up_dual(tables_, soc, interval);
    likelihood_.calibration().adjust(at, soc, unknowns_, [](std::size_t lever, Jet x) {
      x.v.set(lever, x.v[lever] + 1);
      return x;
    });
    const model::StepInput<Jet> input{Jet(row.current_a), Jet(load_.step_s), temperature_c};
    laws.tables(at, soc, input, laws.initial());
    RowResistances r{at.r0_ohm, at.r1_ohm,
                     at.r0_ohm + model::OneRc<Jet>::discretise(at, input.duration_s).alpha * at.r1_ohm,
                     std::vector<Jet>(fit_.hypothesis.settings.size())};
    for (std::size_t k = 0; k < r.own.size(); ++k) {
      model::visit_mechanism(fit_.hypothesis.settings[k].index,
                             [&]<class M>(std::type_identity<M>) { add_own<M>(laws, at, input, r.own[k], r.step); });
    }
    return r;
  }

  void add_row(const SteppedRow& row, const Jet& x, std::size_t first, std::size_t count, Quantity& to) const {
    for (std::size_t lane = 0; lane < count; ++lane) {
      const std::size_t j = first + lane;
      const double by = row.weight * x.v[levers + lane];
      if (j < found_.size())
        to.by_found[static_cast<Eigen::Index>(j)] += by;
      else
        to.by_base[base() + static_cast<Eigen::Index>(j - found_.size())] += by * own_[j - found_.size()].sigma;
    }
    if (first > 0) return;
    to.ohm += row.weight * x.a;
    likelihood_.calibration().each_lever(
        row.record, row.time_s, row.soc, [&](std::size_t lever, std::size_t unknown, double size) {
          to.by_base[static_cast<Eigen::Index>(unknown)] += row.weight * x.v[lever] * size;
        });
  }

  const LikelihoodModel& likelihood_;
  const HypothesisFit& fit_;
  const Load& load_;
  std::vector<double> unknowns_;
  model::Cell<double, model::max_intervals> tables_;
  std::vector<ParameterRef> found_;
  std::vector<FileParameter> own_;
};

}  // namespace

std::optional<Load> load_of(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  Load load;
  double squared_steps = 0, squared_currents = 0;
  std::vector<double> steps_s;
  for (std::size_t n = 0; n < likelihood.records().size(); ++n) {
    const PreparedRecording& r = likelihood.records()[n];
    if (r.temperature_c.empty()) continue;
    std::vector<double> soc;
    likelihood.voltage(fit.hypothesis, fit.calibration, n, &soc);
    for (std::size_t k = 1; k < r.size(); ++k) {
      const double before_a = r.current_a[k - 1], after_a = r.current_a[k], step_a = after_a - before_a;
      steps_s.push_back(r.time_s[k] - r.time_s[k - 1]);
      if (!std::isfinite(step_a) || !std::isfinite(r.temperature_c[k]) || !std::isfinite(soc[k])) continue;
      load.temperature_c += after_a * after_a * r.temperature_c[k];
      squared_currents += after_a * after_a;
      squared_steps += step_a * step_a;
      if (step_a != 0)
        load.rows.push_back(
            {n, r.time_s[k], soc[k], std::abs(after_a) > std::abs(before_a) ? after_a : before_a, step_a * step_a});
    }
  }
  if (load.rows.empty() || !(squared_currents > 0)) return std::nullopt;
  for (SteppedRow& row : load.rows) row.weight /= squared_steps;
  load.temperature_c /= squared_currents;
  load.step_s = measurement::upper_median(steps_s);
  return load;
}

Resistances mean_resistances(const LikelihoodModel& likelihood, const HypothesisFit& fit, const Load& load,
                             bool reference, std::size_t without) {
  return ResistanceMeans(likelihood, fit, load).at(reference, without);
}

bool resistances_follow_temperature(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  model::ChosenLaws<double> laws;
  for (const MechanismSetting& s : fit.hypothesis.settings)
    model::choose<double>(laws, s.index, s.value, likelihood.cell().capacity_ah);
  return laws.resistances_follow_temperature();
}

}  // namespace bms::diagnosis
