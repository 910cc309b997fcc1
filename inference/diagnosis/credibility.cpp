#include "diagnosis/credibility.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::Decision& credible_limits = thresholds.decision;

/// Covariance of some estimated parameters, with others fixed: the resistance of a polarisation and an energy that
/// scales it have a well-known product.
Eigen::MatrixXd covariance_with_fixed(const HypothesisFit& f, const std::vector<Eigen::Index>& of,
                                      const std::vector<Eigen::Index>& fixed) {
  const Eigen::MatrixXd own = f.covariance(of, of);
  if (fixed.empty() || !f.covariance.allFinite()) return own;
  const Eigen::MatrixXd across = f.covariance(fixed, of);
  return own - across.transpose() * Eigen::MatrixXd(f.covariance(fixed, fixed)).ldlt().solve(across);
}

/// Places among the estimated parameters of the mechanisms in `of`, except `mechanism`.
std::vector<Eigen::Index> places_of(const HypothesisFit& f, const std::set<std::size_t>& of, std::size_t mechanism) {
  const std::vector<ParameterRef> sought = f.hypothesis.sought();
  std::vector<Eigen::Index> places;
  for (std::size_t k = 0; k < sought.size(); ++k) {
    const std::size_t index = f.hypothesis.settings[sought[k].setting].index;
    if (of.contains(index) && index != mechanism) places.push_back(static_cast<Eigen::Index>(k));
  }
  return places;
}

/// Returns true for a share that is the whole. Beyond other bounds no cell or instrument is, so a fit that ends there
/// explains something else.
bool is_whole(const model::Parameter& p, double value) {
  return p.per == model::Per::cell && p.unit == "1" && p.low == 0 && p.high == 1 && value == p.high;
}

/// Quantile of chi square that is `own_sigmas` of a single strength, by Wilson and Hilferty (1931).
double chi_square_of_own_sigmas(Eigen::Index strengths) {
  const double share = numerics.statistics.wilson_hilferty / static_cast<double>(strengths),
               root = 1 - share + numerics.statistics.normal_of_two_sigma * std::sqrt(share);
  return static_cast<double>(strengths) * root * root * root;
}

}  // namespace

bool is_weak(const HypothesisFit& f, std::size_t mechanism, const std::set<std::size_t>& certain) {
  const std::vector<ParameterRef> sought = f.hypothesis.sought();
  const std::vector<Eigen::Index> fixed = places_of(f, certain, mechanism);
  const auto sigma_of = [&](std::size_t j, double sigma) {
    if (fixed.empty()) return sigma;
    const auto k = static_cast<Eigen::Index>(j);
    const double share = covariance_with_fixed(f, {k}, fixed)(0, 0) / f.covariance(k, k);
    return std::isfinite(share) ? sigma * std::sqrt(std::clamp(share, 0.0, 1.0)) : sigma;
  };
  bool has_strength = false;
  for (std::size_t j = 0; j < sought.size(); ++j) {
    const MechanismSetting& s = f.hypothesis.settings[sought[j].setting];
    const model::Parameter& p = model::catalogue[s.index].parameter[sought[j].parameter];
    if (s.index != mechanism || p.role != model::Role::strength) continue;
    if (sought[j].parameter > 0 && knowledge_of(mechanism).needs_first_strength) continue;
    has_strength = true;
    const double value = s.value[sought[j].parameter], sigma = sigma_of(j, s.deviation[sought[j].parameter]);
    const bool known = std::isfinite(sigma) && sigma > 0;
    if (is_whole(p, value)) return false;
    if (f.at_bound[j] == 0 && (!known || std::abs(value) >= credible_limits.own_sigmas * sigma)) return false;
  }
  return has_strength;
}

bool is_uncertain(const HypothesisFit& f, std::size_t mechanism, const std::set<std::size_t>& certain) {
  const bool weak = is_weak(f, mechanism, certain);
  const std::vector<ParameterRef> sought = f.hypothesis.sought();
  std::vector<Eigen::Index> own;
  std::vector<double> value;
  for (std::size_t k = 0; k < sought.size(); ++k) {
    const MechanismSetting& s = f.hypothesis.settings[sought[k].setting];
    const model::Parameter& p = model::catalogue[s.index].parameter[sought[k].parameter];
    if (s.index != mechanism || p.role != model::Role::strength || f.at_bound[k] != 0) continue;
    own.push_back(static_cast<Eigen::Index>(k));
    value.push_back(s.value[sought[k].parameter]);
  }
  if (own.empty() || !weak) return weak;
  const Eigen::MatrixXd covariance = covariance_with_fixed(f, own, places_of(f, certain, mechanism));
  const Eigen::Map<const Eigen::VectorXd> strengths(value.data(), static_cast<Eigen::Index>(value.size()));
  const double away = strengths.dot(covariance.ldlt().solve(strengths));
  return !(away >= chi_square_of_own_sigmas(strengths.size()));  // true for NaN
}

bool is_implausible(const HypothesisFit& f, std::size_t mechanism, const RecordingFacts& facts) {
  return knowledge_of(mechanism).is_implausible(*f.hypothesis.find(mechanism), f.hypothesis.settings, facts);
}

bool is_at_the_end(const HypothesisFit& f, std::size_t mechanism, const std::vector<PreparedRecording>& records) {
  const auto is_late = [](const PreparedRecording& r, double at_s) {
    return at_s >= r.time_s.back() - credible_limits.end_share * r.duration_s();
  };
  if (knowledge_of(mechanism).signature == Signature::contact_change)
    return records.size() == 1 && is_late(records.front(), f.hypothesis.find(mechanism)->value[contact_onset]);
  if (knowledge_of(mechanism).signature != Signature::contact_bursts) return false;
  for (std::size_t r = 0; r < std::min(records.size(), f.hypothesis.bursts.size()); ++r) {
    const std::vector<model::Span>& bursts = f.hypothesis.bursts[r];
    if (std::any_of(bursts.begin(), bursts.end(), [&](const auto& span) { return !is_late(records[r], span.start_s); }))
      return false;
  }
  return true;
}

}  // namespace bms::diagnosis
