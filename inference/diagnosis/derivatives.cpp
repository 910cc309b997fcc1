// Derivatives of the predicted voltage: dual numbers through the simulation.
#include <algorithm>
#include <array>

#include "arithmetic/dual_number.hpp"
#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/simulation_run.hpp"

namespace bms::diagnosis {

namespace {

/// Derivatives that go through the simulation at once.
enum : std::size_t { few_lanes = 4, many_lanes = 8 };  // each takes ten seconds to compile
using arithmetic::whole_registers;

/// The base parameters for derivatives along one row: a lane per lever, then one per state as it was before the row.
template <class S>
struct OnLevers : AtUnknowns<S> {
  using Plain = AtUnknowns<S>;

  S capacity_loss() const { return pulled(Plain::capacity_loss(), Lever::capacity); }
  S gain_error() const { return pulled(Plain::gain_error(), Lever::gain); }
  S offset_a(std::size_t record, double time_s) const { return pulled(Plain::offset_a(record, time_s), Lever::zero); }
  void adjust(model::TablePoint<S>& at, const S& soc) const {
    this->calibration.adjust(at, soc, this->u, [](std::size_t lever, const S& x) { return pulled(x, lever); });
  }
  void before_row(model::OpenLoopSimulation<S>& simulation) const {
    std::size_t lane = Lever::count;
    simulation.each_state([&](S& state) { state = S(state.a, lane++); });
  }

 private:
  static S pulled(S s, std::size_t lever) {
    s.v.set(lever, s.v[lever] + 1);
    return s;
  }
};

/// For derivatives of the initial states by the branch position: lane 0.
template <class S>
struct FromBranch : AtUnknowns<S> {
  S branch_shift(std::size_t record) const {
    S shift = AtUnknowns<S>::branch_shift(record);
    shift.v.set(0, shift.v[0] + 1);
    return shift;
  }
};

/// The hypothesis' settings as dual numbers.
template <class Jet>
std::vector<model::MechanismValues<Jet>> dual_values(const Hypothesis& h) {
  std::vector<model::MechanismValues<Jet>> values;
  for (const MechanismSetting& s : h.settings) {
    auto& v = values.emplace_back();
    for (std::size_t p = 0; p < v.size(); ++p) v[p] = Jet(s.value[p]);
  }
  return values;
}

}  // namespace

/// An unknown that acts on a row, through a lever.
struct Pull {
  std::size_t lever;
  Eigen::Index unknown;
  double size;
};

/// Carries the derivatives of all states by all unknowns that move a state from row to row.
template <class Jet>
class CarriedStates {
 public:
  /// still: unknowns that move no state; they come first.
  CarriedStates(Eigen::Index states, Eigen::Index unknowns, Eigen::Index still)
      : still_(still), states_(Columns::Zero(states, unknowns - still)), next_(states_) {}

  void restart() { states_.setZero(); }
  void move_initial_soc(Eigen::Index unknown, double size) { states_(0, unknown - still_) = size; }
  /// start: derivatives of the initial states by an unknown.
  void set_start(Eigen::Index unknown, const Eigen::VectorXd& start) {
    states_.col(unknown - still_).head(start.size()) = start;
  }
  /// The row's voltage by all unknowns, into out; then the states after the row.
  template <class Out>
  void step(const Jet& voltage, model::OpenLoopSimulation<Jet>& simulation, const std::vector<Pull>& pulls, Out out) {
    Eigen::Index count = 0;
    simulation.each_state([&](const Jet& state) {
      double* to = next_.row(count++).data();
      through_states(state, to);
      for (const Pull& p : pulls) {
        if (p.unknown >= still_) to[p.unknown - still_] += state.v[p.lever] * p.size;
      }
    });
    out.head(still_).setZero();
    through_states(voltage, out.data() + still_);
    for (const Pull& p : pulls) out[p.unknown] += voltage.v[p.lever] * p.size;
    states_.swap(next_);
  }

 private:
  void through_states(const Jet& of, double* to) const {
    struct Share {
      double by;
      const double* from;
    };
    std::array<Share, decltype(Jet::v)::size()> shares;
    constexpr std::array<double, arithmetic::doubles_at_once> zeros{};
    std::size_t count = 0;
    for (Eigen::Index s = 0; s < states_.rows(); ++s) {
      const double by = of.v[Lever::count + static_cast<std::size_t>(s)];
      if (by != 0) shares[count++] = {by, states_.row(s).data()};  // most are 0
    }
    arithmetic::each_register(static_cast<std::size_t>(states_.cols()), [&]<class Value>(std::size_t at) {
      arithmetic::Loaded<Value> sum(zeros.data());
      for (std::size_t k = 0; k < count; ++k)
        sum.value += shares[k].by * arithmetic::Loaded<Value>(shares[k].from + at).value;
      sum.store(to + at);
    });
  }

  Eigen::Index still_;
  Columns states_, next_;  // d state / d unknown
};

template <std::size_t Lanes>
void LikelihoodModel::derive(const Hypothesis& h, const Eigen::VectorXd& u, std::span<const ParameterRef> by,
                             std::size_t first, std::size_t here, Columns& columns) const {
  using Jet = arithmetic::DualNumber<Lanes>;
  std::vector<model::MechanismValues<Jet>> values = dual_values<Jet>(h);
  const std::vector<double> unknowns(u.data(), u.data() + u.size());
  for (std::size_t lane = 0; lane < here; ++lane)
    values[by[first + lane].setting][by[first + lane].parameter].v.set(lane, 1);
  Eigen::Index row = 0, check_row = static_cast<Eigen::Index>(samples_);
  const auto put = [&](Eigen::Index at, const Jet& v) {
    for (std::size_t lane = 0; lane < here; ++lane) columns(at, static_cast<Eigen::Index>(first + lane)) = v.v[lane];
  };
  for (std::size_t r = 0; r < records_.size(); ++r) {
    run<Jet>(
        values, h, AtUnknowns<Jet>{calibration_, unknowns}, r,
        [&](std::size_t, const Jet& v, const auto&) { put(row++, v); },
        [&](std::size_t, const Jet& expected) { put(check_row++, expected); });
  }
}

Columns LikelihoodModel::derivatives(const Hypothesis& h, const Eigen::VectorXd& u,
                                     std::span<const ParameterRef> by) const {
  Columns columns(static_cast<Eigen::Index>(samples()), static_cast<Eigen::Index>(by.size()));
  if (by.empty()) return columns;
  for (std::size_t first = 0; first < by.size();) {
    const std::size_t here = std::min<std::size_t>(by.size() - first, many_lanes);
    if (here <= few_lanes)
      derive<few_lanes>(h, u, by, first, here, columns);
    else
      derive<many_lanes>(h, u, by, first, here, columns);
    first += here;
  }
  whiten(columns);
  return columns;
}

template <std::size_t Lanes>
void LikelihoodModel::carry(const Hypothesis& h, const Eigen::VectorXd& u, Columns& columns) const {
  using Jet = arithmetic::DualNumber<Lanes>;
  const std::vector<model::MechanismValues<Jet>> values = dual_values<Jet>(h);
  const std::vector<double> unknowns(u.data(), u.data() + u.size());
  const OnLevers<Jet> base{{calibration_, unknowns}};
  std::vector<Pull> pulls;
  const auto pull = [&](std::size_t record, double time_s, double soc) {
    pulls.clear();
    calibration_.each_lever(record, time_s, soc, [&](std::size_t lever, std::size_t unknown, double size) {
      pulls.push_back({lever, static_cast<Eigen::Index>(unknown), size});
    });
  };
  CarriedStates<Jet> states(static_cast<Eigen::Index>(Lanes - Lever::count), columns.cols(),
                            static_cast<Eigen::Index>(calibration_.ocv_unknowns()));
  Eigen::Index row = 0, check_row = static_cast<Eigen::Index>(samples_);
  for (std::size_t r = 0; r < records_.size(); ++r) {
    const PreparedRecording& record = records_[r];
    states.restart();
    calibration_.each_start(r, [&](std::size_t unknown, double size) {
      states.move_initial_soc(static_cast<Eigen::Index>(unknown), size);
    });
    if (!calibration_.branch_unknowns().empty()) {
      const SimulationSetup<Jet> setup = setup_for<Jet>(values, h, FromBranch<Jet>{{calibration_, unknowns}}, r);
      model::OpenLoopSimulation<Jet> simulation(tables_, cell_.capacity_ah, setup.laws, setup.initial_soc);
      Eigen::VectorXd start = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(Lanes - Lever::count));
      Eigen::Index count = 0;
      simulation.each_state([&](const Jet& state) { start[count++] = state.v[0]; });
      states.set_start(static_cast<Eigen::Index>(calibration_.branch_unknowns()[r]),
                       thresholds.calibration.branch_sigma * start);
    }
    run<Jet>(
        values, h, base, r,
        [&](std::size_t k, const Jet& v, auto& simulation) {
          pull(r, record.time_s[k], simulation.soc().a);
          states.step(v, simulation, pulls, columns.row(row++));
        },
        [&](std::size_t j, const Jet& expected) {
          pull(r, record.checks[j].time_s, 0);
          auto out = columns.row(check_row++);
          out.setZero();
          for (const Pull& p : pulls) out[p.unknown] += expected.v[p.lever] * p.size;
        });
  }
}

Columns LikelihoodModel::calibration_derivatives(const Hypothesis& h, const Eigen::VectorXd& u) const {
  Columns columns = raw_calibration_derivatives(h, u);
  whiten(columns);
  return columns;
}

Columns LikelihoodModel::raw_calibration_derivatives(const Hypothesis& h, const Eigen::VectorXd& u) const {
  Columns columns(static_cast<Eigen::Index>(samples()), static_cast<Eigen::Index>(calibration_.size()));
  std::size_t states = 0;
  for (const MechanismSetting& s : h.settings) states += model::catalogue[s.index].states;
  constexpr std::size_t two_states = whole_registers(Lever::count + model::OneRc<double>::states + 2),
                        all_laws = whole_registers(Lever::count + model::OpenLoopSimulation<double>::most_states);
  if (states <= two_states - Lever::count - model::OneRc<double>::states)
    carry<two_states>(h, u, columns);
  else
    carry<all_laws>(h, u, columns);
  return columns;
}

}  // namespace bms::diagnosis
