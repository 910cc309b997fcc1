#include "diagnosis/hypothesis.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <ceres/jet.h>

#include "model/corrected_readings.hpp"

namespace bms::diagnosis {

namespace {

using model::catalogue;
constexpr std::size_t skew = model::mechanism_index("channel_skew");
constexpr std::size_t sensor = model::mechanism_index("temperature_sensor");
constexpr std::size_t capacity_change = model::mechanism_index("capacity_change");
constexpr std::size_t current_gain = model::mechanism_index("current_gain");
constexpr std::size_t initial_soc = model::mechanism_index("initial_soc");
constexpr std::size_t contact_step = model::mechanism_index("contact_step");
constexpr std::size_t hysteresis = model::mechanism_index("ocv_hysteresis");
constexpr std::size_t intermittent = model::mechanism_index("contact_intermittent");

/// Derivatives that go through the simulation at once.
constexpr std::size_t few_lanes = 4, lanes = 8;

/// Reading beside a step of the current: voltage and current are never read at quite the same moment. Share of a
/// sample's step.
constexpr double edge_jitter = 0.05;

/// A later recording that begins above it was charged last.
constexpr double charged_soc = 0.9;

/// How much of resistance_fraction differs from one step of the current to the next.
constexpr double edge_error = 0.4;

/// Error along the soc of the OCV table, as a share of what the start may be off; and how far around the counted soc
/// its slope is taken.
constexpr double soc_error_share = 0.3, slope_reach = 0.01;

/// The base parameters in a run, at the unknowns u.
template <class S>
struct AtUnknowns {
  const Calibration& calibration;
  const std::vector<double>& u;

  S initial_soc_shift(std::size_t record) const { return S(calibration.initial_soc_shift(record, u)); }
  S capacity_loss() const { return S(calibration.capacity_loss(u)); }
  S gain_error() const { return S(calibration.gain_error(u)); }
  S offset_a(std::size_t record, double time_s) const { return S(calibration.offset_a(record, time_s, u)); }
  void adjust(model::TablePoint<S>& at, const S& soc) const { calibration.adjust(at, soc, u); }
  void before_row(model::OpenLoopSimulation<S>&) const {}
};

/// The same for derivatives along one row: a lane for each lever, then one for each state as it was before the row.
template <class S>
struct OnLevers : AtUnknowns<S> {
  using Plain = AtUnknowns<S>;

  S capacity_loss() const { return pulled(Plain::capacity_loss(), Lever::capacity); }
  S gain_error() const { return pulled(Plain::gain_error(), Lever::gain); }
  S offset_a(std::size_t record, double time_s) const { return pulled(Plain::offset_a(record, time_s), Lever::zero); }
  void adjust(model::TablePoint<S>& at, const S& soc) const {
    this->calibration.adjust(at, soc, this->u, [](std::size_t lever, const S& x) { return pulled(x, lever); });
  }
  void before_row(model::OpenLoopSimulation<S>& course) const {
    Eigen::Index lane = Lever::count;
    course.each_state([&](S& state) {
      state.v.setZero();
      state.v[lane++] = 1;
    });
  }

 private:
  static S pulled(S s, std::size_t lever) {
    s.v[static_cast<Eigen::Index>(lever)] += 1;
    return s;
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

std::vector<std::size_t> Hypothesis::added() const {
  std::vector<std::size_t> ids;
  for (std::size_t k = own; k < settings.size(); ++k) ids.push_back(settings[k].index);
  std::sort(ids.begin(), ids.end());
  return ids;
}

const MechanismSetting* Hypothesis::find(std::size_t index) const {
  for (const MechanismSetting& s : settings) {
    if (s.index == index) return &s;
  }
  return nullptr;
}

std::vector<ParameterRef> Hypothesis::sought() const {
  std::vector<ParameterRef> all;
  for (std::size_t k = own; k < settings.size(); ++k) {
    const model::MechanismInfo& info = catalogue[settings[k].index];
    for (std::size_t p = 0; p < info.parameters; ++p) {
      if (info.parameter[p].role != model::Role::given) all.push_back({k, p});
    }
  }
  return all;
}

std::string Hypothesis::name() const {
  std::string text;
  for (const std::size_t id : added()) text += (text.empty() ? "" : "+") + std::string(catalogue[id].id);
  return text.empty() ? "calibration" : text;
}

Hypothesis with(const Hypothesis& h, const MechanismSetting& setting) {
  Hypothesis more = h;
  more.settings.push_back(setting);
  return more;
}

Hypothesis with(const Hypothesis& h, std::size_t mechanism, double capacity_ah) {
  return with(h, model::default_setting(mechanism, capacity_ah));
}

Hypothesis without(const Hypothesis& h, std::size_t mechanism) {
  Hypothesis less = h;
  std::erase_if(less.settings, [&](const MechanismSetting& s) {
    return s.index == mechanism && &s - less.settings.data() >= static_cast<std::ptrdiff_t>(h.own);
  });
  return less;
}

LikelihoodModel::LikelihoodModel(const model::CellParameters<>& cell, std::vector<MechanismSetting> own,
                                 std::vector<PreparedRecording> records, const NoiseModel& noise)
    : cell_(cell),
      tables_(model::prepare<double, model::max_intervals>(cell)),
      own_(std::move(own)),
      records_(std::move(records)),
      calibration_(cell, records_) {
  for (const PreparedRecording& r : records_) {
    if (r.size() < 2) throw std::invalid_argument("a recording of less than two rows");
    samples_ += r.size();
    checks_ += r.checks.size();
    std::vector<char>& usable = usable_.emplace_back(r.size(), 1);
    RowNoise& more = row_noise_.emplace_back(r.size());
    const double soc_error = soc_error_share * r.initial_soc_sigma,
                 r0_ohm = model::cell_detail::rc_value(cell_.rc, cell_.rc.r0_ohm, 0.5);
    double known_a = 0, soc = r.initial_soc;
    std::uint8_t interval = 0;
    const auto ocv_v = [&](double at) { return model::look_up(tables_, at, interval).ocv_v; };
    for (std::size_t k = 0; k < r.size(); ++k) {
      if (!std::isfinite(r.voltage_v[k])) usable[k] = 0;
      if (k == 0 && !(std::abs(r.current_a[k]) < 0.01 * cell_.capacity_ah))
        usable[k] = 0;  // what flowed before is not known
      const double step_a = std::isfinite(r.current_a[k]) && k > 0 ? r.current_a[k] - known_a : 0;
      if (std::isfinite(r.current_a[k])) known_a = r.current_a[k];
      more.white_v2[k] = std::pow(edge_jitter * r0_ohm * step_a, 2);
      if (k > 0) more.white_v2[k - 1] = std::max(more.white_v2[k - 1], more.white_v2[k]);
      more.edge_v2[k] = std::pow(edge_error * cell_.tolerance.resistance_fraction * r0_ohm * step_a, 2);
      if (k > 0)
        soc = std::clamp(soc + known_a * (r.time_s[k] - r.time_s[k - 1]) / (3'600 * cell_.capacity_ah), 0.0, 1.0);
      more.slow_v2[k] =
          std::pow(soc_error * (ocv_v(soc + slope_reach) - ocv_v(soc - slope_reach)) / (2 * slope_reach), 2);
    }
  }
  set_noise(noise);
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
  nearby_.reset();
}

NoiseModel LikelihoodModel::likeliest_noise(const Columns& raw, const NoiseModel& nominal, double& cost) const {
  const auto cost_of = [&](const NoiseModel& n) {
    const std::vector<Whitener> by = whiteners_for(n);
    Columns e = raw;
    whiten(e, by);
    double sum = e.squaredNorm() + price_of_noise(n, nominal);
    for (const Whitener& w : by) sum += w.log_determinant();
    return sum;
  };
  NoiseModel best = nominal;
  cost = cost_of(best);
  // the amplitudes in turn, in ever smaller factors
  for (const double factor : {2.0, 1.41, 1.19, 1.09}) {
    for (bool moved = true; moved;) {
      moved = false;
      for (const auto member : {&NoiseModel::fast_v, &NoiseModel::slow_v, &NoiseModel::white_v, &NoiseModel::edge}) {
        for (const double by : {factor, 1 / factor}) {
          NoiseModel n = best;
          n.*member = std::max(best.*member * by, nominal.*member);
          if (n == best) continue;
          const double c = cost_of(n);
          if (c >= cost) continue;
          cost = c;
          best = n;
          moved = true;
        }
      }
    }
  }
  return best;
}

std::size_t LikelihoodModel::used() const {
  std::size_t n = 0;
  for (const Whitener& w : whiteners_) n += w.used();
  return n;
}

Hypothesis LikelihoodModel::base() const { return {own_, own_.size(), {}}; }

template <class S, class Base, class Row, class ForCheck>
void LikelihoodModel::run(const std::vector<model::MechanismValues<S>>& values, const Hypothesis& h, const Base& base,
                          std::size_t record, Row&& row, ForCheck&& check) const {
  const PreparedRecording& r = records_[record];
  model::ChosenLaws<S> laws;
  S delay_s(0), lag_s(0), start(r.initial_soc);
  start += base.initial_soc_shift(record);
  model::MechanismValues<S> capacity{base.capacity_loss()}, gain{base.gain_error()};
  for (std::size_t k = 0; k < h.settings.size(); ++k) {
    const std::size_t index = h.settings[k].index;
    if (index == skew)
      delay_s = values[k][0];
    else if (index == initial_soc && record > 0)
      continue;  // the later ones begin elsewhere
    else if (index == initial_soc)
      start += values[k][0];
    else if (index == capacity_change)
      capacity[0] += values[k][0];
    else if (index == current_gain)
      gain[0] += values[k][0];
    else if (index == contact_step && record > 0)
      model::choose<S>(laws, index, model::MechanismValues<S>{values[k][0], S(r.time_s.front())},
                       cell_.capacity_ah);  // it stays
    else if (index == hysteresis && record > 0 && r.initial_soc > charged_soc)
      model::choose<S>(laws, index, model::MechanismValues<S>{values[k][0], values[k][1], values[k][2], S(1)},
                       cell_.capacity_ah);
    else
      model::choose<S>(laws, index, values[k], cell_.capacity_ah);
    if (index == sensor) lag_s = values[k][1];
    if (index == intermittent && record < h.bursts.size())
      (*laws.template slot<intermittent>()).bursts = h.bursts[record];
  }
  model::choose<S>(laws, capacity_change, capacity, cell_.capacity_ah);
  model::choose<S>(laws, current_gain, gain, cell_.capacity_ah);
  const model::CorrectedReadings<S> readings(r.time_s, r.current_a, r.temperature_c, delay_s, lag_s);
  model::OpenLoopSimulation<S> course(tables_, cell_.capacity_ah, laws, start);
  const auto adjust = [&](model::TablePoint<S>& at, const S& soc) { base.adjust(at, soc); };
  for (std::size_t k = 0; k < r.size(); ++k) {
    const double duration_s = k == 0 ? 0 : r.time_s[k] - r.time_s[k - 1];
    const S read_a = readings.current(k) - base.offset_a(record, r.time_s[k]);
    base.before_row(course);
    row(k, course.step(r.time_s[k], duration_s, read_a, readings.temperature(k), adjust), course);
  }
  for (std::size_t j = 0; j < r.checks.size(); ++j) {
    const Check& c = r.checks[j];
    const bool current = c.channel == Check::Channel::current;
    // of a current what would be true, of a voltage what would be read behind the contacts: both as the laws have it
    S at_terminals(c.reference);
    for (std::size_t k = 0; k < h.settings.size(); ++k) {
      if (h.settings[k].index == contact_step && (record > 0 || c.time_s >= h.settings[k].value[1]))
        at_terminals += values[k][0] * c.current_a;
    }
    const S expected = current ? S(laws.true_current(S(c.read) - base.offset_a(record, c.time_s)) - c.reference)
                               : S(laws.reading(at_terminals) - c.read);
    check(j, S(expected * (1 / c.deviation)));
  }
}

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
      [&](std::size_t k, double volt, const auto& course) {
        v[k] = volt;
        if (soc != nullptr) (*soc)[k] = course.soc();
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

void LikelihoodModel::whiten(Columns& columns) const { whiten(columns, whiteners_); }

void LikelihoodModel::whiten(Columns& columns, const std::vector<Whitener>& by) const {
  Eigen::Index row = 0;
  for (std::size_t r = 0; r < records_.size(); ++r) {
    const auto rows = static_cast<Eigen::Index>(records_[r].size());
    by[r].whiten(columns.middleRows(row, rows));
    row += rows;
  }
  if (checks_ == 0) return;
  // checks of one voltage channel share its drift: covariance 1 + w w', taken off by (1 + w w')^-1/2
  for (const PreparedRecording& r : records_) {
    Eigen::VectorXd w = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(r.checks.size()));
    for (std::size_t j = 0; j < r.checks.size(); ++j) {
      if (r.checks[j].channel == Check::Channel::voltage)
        w[static_cast<Eigen::Index>(j)] = cell_.tolerance.drift_v / r.checks[j].deviation;
    }
    if (const double shared = w.squaredNorm(); shared > 0) {
      auto rows = columns.middleRows(row, w.size());
      const Eigen::RowVectorXd along = w.transpose() * rows;
      rows -= ((1 - 1 / std::sqrt(1 + shared)) / shared) * w * along;
    }
    row += w.size();
  }
}

template <std::size_t Lanes>
void LikelihoodModel::derive(const Hypothesis& h, const Eigen::VectorXd& u, std::span<const ParameterRef> by,
                             std::size_t first, std::size_t here, Columns& columns) const {
  using Jet = ceres::Jet<double, static_cast<int>(Lanes)>;
  std::vector<model::MechanismValues<Jet>> values = dual_values<Jet>(h);
  const std::vector<double> unknowns(u.data(), u.data() + u.size());
  for (std::size_t lane = 0; lane < here; ++lane)
    values[by[first + lane].setting][by[first + lane].parameter].v[static_cast<Eigen::Index>(lane)] = 1;
  Eigen::Index row = 0, check_row = static_cast<Eigen::Index>(samples_);
  const auto put = [&](Eigen::Index at, const Jet& v) {
    for (std::size_t lane = 0; lane < here; ++lane)
      columns(at, static_cast<Eigen::Index>(first + lane)) = v.v[static_cast<Eigen::Index>(lane)];
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
    const bool few = by.size() - first <= few_lanes;
    const std::size_t here = std::min(few ? few_lanes : lanes, by.size() - first);
    if (few)
      derive<few_lanes>(h, u, by, first, here, columns);
    else
      derive<lanes>(h, u, by, first, here, columns);
    first += here;
  }
  whiten(columns);
  return columns;
}

template <std::size_t Lanes>
void LikelihoodModel::carry(const Hypothesis& h, const Eigen::VectorXd& u, Columns& columns) const {
  using Jet = ceres::Jet<double, static_cast<int>(Lanes)>;
  struct Pull {
    Eigen::Index lever, unknown;
    double size;
  };
  const std::vector<model::MechanismValues<Jet>> values = dual_values<Jet>(h);
  const std::vector<double> unknowns(u.data(), u.data() + u.size());
  const OnLevers<Jet> base{{calibration_, unknowns}};
  const auto still = static_cast<Eigen::Index>(calibration_.ocv_unknowns()), moving = columns.cols() - still;
  std::vector<Pull> pulls;
  const auto pull = [&](std::size_t record, double time_s, double soc) {
    pulls.clear();
    calibration_.each_lever(record, time_s, soc, [&](std::size_t lever, std::size_t unknown, double size) {
      pulls.push_back({static_cast<Eigen::Index>(lever), static_cast<Eigen::Index>(unknown), size});
    });
  };
  Columns states(static_cast<Eigen::Index>(Lanes - Lever::count), moving), next = states;  // d state / d unknown
  Eigen::Index row = 0, check_row = static_cast<Eigen::Index>(samples_);
  for (std::size_t r = 0; r < records_.size(); ++r) {
    const PreparedRecording& record = records_[r];
    states.setZero();
    states(0, static_cast<Eigen::Index>(calibration_.initial_soc_unknown(r)) - still) =
        calibration_.initial_soc_size(r);
    run<Jet>(
        values, h, base, r,
        [&](std::size_t k, const Jet& v, auto& course) {
          pull(r, record.time_s[k], course.soc().a);
          Eigen::Index count = 0;
          const auto through_states = [&](const Jet& of, auto to) {
            to.setZero();
            for (Eigen::Index s = 0; s + static_cast<Eigen::Index>(Lever::count) < of.v.size(); ++s) {
              if (const double by = of.v[s + static_cast<Eigen::Index>(Lever::count)]; by != 0)
                to += by * states.row(s);  // most are 0
            }
          };
          course.each_state([&](const Jet& state) {
            auto to = next.row(count++);
            through_states(state, to);
            for (const Pull& p : pulls) {
              if (p.unknown >= still) to[p.unknown - still] += state.v[p.lever] * p.size;
            }
          });
          auto out = columns.row(row++);
          out.head(still).setZero();
          through_states(v, out.tail(moving));
          for (const Pull& p : pulls) out[p.unknown] += v.v[p.lever] * p.size;
          states.swap(next);
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
  Columns columns(static_cast<Eigen::Index>(samples()), static_cast<Eigen::Index>(calibration_.size()));
  std::size_t states = 0;
  for (const MechanismSetting& s : h.settings) states += catalogue[s.index].states;
  constexpr std::size_t one_law = Lever::count + model::OneRc<double>::states + 1,
                        all_laws = Lever::count + model::OpenLoopSimulation<double>::most_states;
  if (states <= 1)
    carry<one_law>(h, u, columns);
  else
    carry<all_laws>(h, u, columns);
  whiten(columns);
  return columns;
}

}  // namespace bms::diagnosis
