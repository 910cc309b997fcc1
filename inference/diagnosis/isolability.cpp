#include "diagnosis/isolability.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "diagnosis/experiment_plan.hpp"
#include "diagnosis/products.hpp"
#include "diagnosis/reference.hpp"
#include "diagnosis/signatures.hpp"
#include "diagnosis/thresholds.hpp"
#include "numerics/in_parallel.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Isolability& isolability_limits = thresholds.isolability;

/// A cause and the settings at which its signature is taken.
struct Cause {
  std::size_t mechanism = 0;
  double size = 0;  ///< of its first strength
  std::vector<MechanismSetting> settings;
};

/// Neighbouring columns of one setting; none if nothing of it holds in this recording.
struct ColumnRange {
  Eigen::Index first = 0, count = 0;
};

/// Products of base parameters' columns and signatures, summed over rows.
struct Gram {
  Eigen::MatrixXd base, across, own;

  void add(const AnyColumns& base_columns, const AnyColumns& own_columns) {
    base += squared(base_columns);
    across += products(base_columns, own_columns);
    own += squared(own_columns);
  }
  /// Of the signatures, the base parameters within their tolerance projected out.
  Eigen::MatrixXd projected() const {
    const Eigen::MatrixXd normal = base + Eigen::MatrixXd::Identity(base.rows(), base.cols());
    return own - across.transpose() * normal.llt().solve(across);
  }
};

/// Signatures of all causes in one recording.
class Signatures {
 public:
  /// later: after the recordings in which they were seen.
  Signatures(const LikelihoodModel& likelihood, const std::vector<Cause>& causes, bool later)
      : likelihood_(likelihood) {
    HypothesisFit around;
    around.hypothesis = likelihood.base();
    around.calibration = likelihood.unchanged();
    base_ = likelihood.linearised_at(around.hypothesis, around.calibration)->columns;
    std::vector<MechanismSetting> settings;
    std::vector<std::pair<std::size_t, std::size_t>> places;  // of each, in ranges_
    for (const Cause& c : causes) {
      for (std::size_t n = 0; n < c.settings.size(); ++n) {
        MechanismSetting s = c.settings[n];
        if (later && !knowledge_of(c.mechanism).carry_over(s)) continue;
        if (later) knowledge_of(c.mechanism).after_full_charge(s);  // each course begins so
        settings.push_back(s);
        places.emplace_back(ranges_.size(), n);
      }
      ranges_.emplace_back(c.settings.size());
    }
    std::vector<ProbedColumns> probed(settings.size());
    numerics::in_parallel(settings.size(),
                          [&](std::size_t k) { probed[k] = signature_at(likelihood, around, settings[k]); });
    Eigen::Index all = 0;
    for (std::size_t k = 0; k < probed.size(); ++k) {
      ranges_[places[k].first][places[k].second] = {all, probed[k].columns.cols()};
      all += probed[k].columns.cols();
    }
    own_.resize(base_.rows(), all);
    Eigen::Index first = 0;
    for (const ProbedColumns& p : probed) {
      own_.middleCols(first, p.columns.cols()) = p.columns;
      first += p.columns.cols();
    }
  }

  const std::vector<std::vector<ColumnRange>>& ranges() const { return ranges_; }

  /// Over all readings, without checks of instruments.
  Gram of_readings() const {
    Gram g = none();
    const auto rows = static_cast<Eigen::Index>(likelihood_.readings());
    g.add(base_.topRows(rows), own_.topRows(rows));
    return g;
  }
  /// Over those checks of instruments that count. counts(check, recording, its place there).
  template <class Counts>
  Gram of_checks(const Counts& counts) const {
    Gram g = none();
    auto row = static_cast<Eigen::Index>(likelihood_.readings());
    std::size_t record = 0;
    for (const PreparedRecording& r : likelihood_.records()) {
      Columns base(static_cast<Eigen::Index>(r.checks.size()), base_.cols()),
          own(static_cast<Eigen::Index>(r.checks.size()), own_.cols());
      Eigen::Index count = 0;
      for (std::size_t k = 0; k < r.checks.size(); ++k, ++row) {
        if (!counts(r.checks[k], record, k)) continue;
        base.row(count) = base_.row(row);
        own.row(count++) = own_.row(row);
      }
      g.add(base.topRows(count), own.topRows(count));
      ++record;
    }
    return g;
  }

 private:
  Gram none() const {
    return {Eigen::MatrixXd::Zero(base_.cols(), base_.cols()), Eigen::MatrixXd::Zero(base_.cols(), own_.cols()),
            Eigen::MatrixXd::Zero(own_.cols(), own_.cols())};
  }

  const LikelihoodModel& likelihood_;
  Columns base_, own_;
  std::vector<std::vector<ColumnRange>> ranges_;  ///< by cause and setting
};

Gram operator+(Gram a, const Gram& b) {
  a.base += b.base;
  a.across += b.across;
  a.own += b.own;
  return a;
}

/// What another cause leaves of one, by both; the size of the first is taken into account.
class Left {
 public:
  /// shape: of each cause, the setting whose effect is looked at.
  Left(const Eigen::MatrixXd& projected, const std::vector<std::vector<ColumnRange>>& ranges,
       const std::vector<std::size_t>& shape)
      : products_(projected), ranges_(ranges), shape_(shape) {
    // each column in units of its own length
    length_ = products_.diagonal().cwiseMax(0.0).cwiseSqrt();
    const Eigen::VectorXd inverse = length_.unaryExpr([](double l) { return l > 0 ? 1 / l : 0; });
    products_ = inverse.asDiagonal() * products_ * inverse.asDiagonal();
  }

  double operator()(const std::vector<Cause>& causes, std::size_t a, std::size_t b) const {
    const ColumnRange& seen = ranges_[a][shape_[a]];
    if (seen.count == 0) return 0;
    double explained = 0;
    for (const ColumnRange& r : ranges_[b]) explained = std::max(explained, explained_by(r, seen.first));
    const double whole = std::pow(causes[a].size * length_[seen.first], 2);
    return whole * (1 - explained);
  }

 private:
  /// Share of a column.
  double explained_by(const ColumnRange& r, Eigen::Index column) const {
    if (r.count == 0) return 0;
    Eigen::MatrixXd normal = products_.block(r.first, r.first, r.count, r.count);
    normal.diagonal().array() += numerics.signatures.ridge_share;
    const Eigen::VectorXd toward = products_.col(column).segment(r.first, r.count);
    return std::clamp(toward.dot(normal.ldlt().solve(toward)), 0.0, 1.0);
  }

  Eigen::MatrixXd products_;
  Eigen::VectorXd length_;
  const std::vector<std::vector<ColumnRange>>& ranges_;
  const std::vector<std::size_t>& shape_;
};

/// Settings of a cause: its probes; of a contact that changes, some moments from the start on.
std::vector<MechanismSetting> settings_of(const LikelihoodModel& likelihood, std::size_t mechanism) {
  if (knowledge_of(mechanism).signature != Signature::contact_change) return probe_settings(likelihood, mechanism);
  std::vector<MechanismSetting> settings;
  const PreparedRecording& first = likelihood.records().front();
  constexpr std::size_t moments = isolability_limits.moments;
  for (std::size_t m = 0; m < moments; ++m) {
    MechanismSetting& s = settings.emplace_back(model::default_setting(mechanism, likelihood.cell()));
    s.value[contact_onset] = first.time_s[m * first.size() / moments];
  }
  return settings;
}

/// The setting of each cause whose first strength is known best: that of its detection limit.
std::vector<std::size_t> best_seen(const Eigen::MatrixXd& projected, const std::vector<std::vector<ColumnRange>>& all) {
  std::vector<std::size_t> best;
  for (const std::vector<ColumnRange>& ranges : all) {
    const auto largest = std::max_element(ranges.begin(), ranges.end(), [&](const auto& a, const auto& b) {
      return projected(a.first, a.first) < projected(b.first, b.first);
    });
    best.push_back(static_cast<std::size_t>(largest - ranges.begin()));
  }
  return best;
}

/// Trusted readings of both instruments now and then as well, as if they had read the same.
PreparedRecording with_trusted_readings(PreparedRecording r, const model::CellParameters<>& cell) {
  const std::size_t every = r.size() / static_cast<std::size_t>(isolability_limits.trusted_readings) + 1;
  const auto now_and_then = [&](const measurement::Column& read) {
    std::vector<double> some(r.size(), std::nan(""));
    for (std::size_t k = 0; k < r.size(); k += every) some[k] = read[k];
    return some;
  };
  const std::vector<double> current_a = now_and_then(r.current_a), voltage_v = now_and_then(r.voltage_v);
  average_references(r, current_a, {}, cell);
  average_references(r, {}, voltage_v, cell);
  return r;
}

/// The pairs that are still open, and what closes them.
class Pairs {
 public:
  explicit Pairs(const std::vector<Cause>& causes) : causes_(causes) {
    found_.separable.assign(causes.size(), std::vector<bool>(causes.size(), false));
    found_.gain.assign(causes.size(), std::vector<double>(causes.size(), 0.0));
    found_.separated_by.assign(causes.size(), std::vector<std::string>(causes.size()));
    for (std::size_t a = 0; a < causes.size(); ++a) {
      found_.causes.push_back({causes[a].mechanism, 0, causes[a].size});
      found_.separable[a][a] = true;
    }
  }

  /// means: empty: the recordings themselves.
  void try_with(const std::string& means, const Left& left) {
    // the difference of two costs has twice the root of its mean as its standard deviation
    constexpr double margin = thresholds.screening.limit_margin;
    static const double needed = std::pow(margin + std::sqrt(margin * margin + thresholds.decision.tie), 2);
    open_ = false;
    for (std::size_t a = 0; a < causes_.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        if (found_.separable[a][b] || !found_.separated_by[a][b].empty()) continue;
        const double of_a = left(causes_, a, b), of_b = left(causes_, b, a);
        const bool apart = std::min(of_a, of_b) >= needed;
        if (means.empty()) {
          found_.gain[a][b] = of_a;
          found_.gain[b][a] = of_b;
          found_.separable[a][b] = found_.separable[b][a] = apart;
        } else if (apart) {
          found_.separated_by[a][b] = found_.separated_by[b][a] = means;
        }
        open_ = open_ || !apart;
      }
    }
  }
  bool open() const { return open_; }
  Isolability found() && { return std::move(found_); }

 private:
  const std::vector<Cause>& causes_;
  Isolability found_;
  bool open_ = true;
};

/// Courses in a cell as its file describes it.
void try_courses(const LikelihoodModel& likelihood, const std::vector<Cause>& causes,
                 const std::vector<std::size_t>& shape, Pairs& pairs) {
  const model::CellParameters<>& cell = likelihood.cell();
  const PlanSetting setting{cell, cell.capacity_ah, !likelihood.records().front().temperature_c.empty()};
  for (const auto& [duration_s, course] : courses(setting)) {
    if (!pairs.open()) return;
    const double step_s = coarse_step_s(*course, duration_s);
    bool within = true;
    const std::vector<MechanismSetting> own = likelihood.base().settings;
    PreparedRecording r = read_under(own, planned(*course, setting, step_s), cell, within);
    if (!within) continue;
    const LikelihoodModel there(cell, own, {std::move(r)}, of_coarse_rows(likelihood.noise(), step_s));
    const Signatures signatures(there, causes, true);
    const Gram all = signatures.of_readings() + signatures.of_checks([](auto&&...) { return true; });
    pairs.try_with(std::string(course->name), Left(all.projected(), signatures.ranges(), shape));
  }
}

}  // namespace

Isolability isolability_of(const LikelihoodModel& likelihood, const NoiseModel& nominal,
                           const std::vector<DetectionLimit>& limits) {
  std::vector<Cause> causes;
  for (const DetectionLimit& l : limits) {
    if (l.parameter == 0 && knowledge_of(l.mechanism).signature != Signature::contact_bursts)
      causes.push_back({l.mechanism, isolability_limits.times_limit * l.value, settings_of(likelihood, l.mechanism)});
  }
  if (causes.size() < 2) return {};
  std::vector<PreparedRecording> records = likelihood.records();
  for (PreparedRecording& r : records) r = with_trusted_readings(std::move(r), likelihood.cell());
  const LikelihoodModel checked(likelihood.cell(), likelihood.base().settings, std::move(records), nominal, {},
                                likelihood.learned());
  Pairs pairs(causes);
  const Signatures signatures(checked, causes, false);
  const auto is_known = [&](std::size_t record, std::size_t k) {
    return k < likelihood.records()[record].checks.size();
  };
  const auto added = [&](Check::Channel channel) {
    return signatures.of_checks([&](const Check& c, std::size_t record, std::size_t k) {
      return c.channel == channel && !is_known(record, k);
    });
  };
  const Gram known =
      signatures.of_readings() +
      signatures.of_checks([&](const Check&, std::size_t record, std::size_t k) { return is_known(record, k); });
  const Eigen::MatrixXd now = known.projected();
  const std::vector<std::size_t> shape = best_seen(now, signatures.ranges());
  const auto left = [&](const Eigen::MatrixXd& projected) { return Left(projected, signatures.ranges(), shape); };
  pairs.try_with("", left(now));
  if (pairs.open()) pairs.try_with(second_voltmeter, left((known + added(Check::Channel::voltage)).projected()));
  if (pairs.open()) pairs.try_with(second_ammeter, left((known + added(Check::Channel::current)).projected()));
  try_courses(checked, causes, shape, pairs);
  return std::move(pairs).found();
}

}  // namespace bms::diagnosis
