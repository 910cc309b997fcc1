#include "diagnosis/law_term.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "diagnosis/thresholds.hpp"
#include "measurement/in_parallel.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Thresholds::LawTerms& term_limits = thresholds.law_terms;

/// A law that has tables over the state of charge.
struct TableLaw {
  const char* id;
  double Loosened::*loosened;
  std::array<const char*, 2> depends_on;
};
constexpr std::array<TableLaw, 3> table_laws = {{
    {"ocv", &Loosened::ocv, {"soc", nullptr}},
    {"ohmic", &Loosened::r0, {"soc", "current"}},
    {"fast", &Loosened::rc, {"soc", "time"}},
}};

/// Laws without a table that generic columns point to.
struct FamilyLaw {
  std::string_view family;
  const char *law, *depends_on;
};
constexpr std::array<FamilyLaw, 3> family_laws = {{
    {"the time", "charge", "time"},
    {"the heat of the load", "temperature", "temperature"},
    {"the load before", "fast", "time"},
}};

std::size_t fold_of(std::size_t row, std::size_t rows) {
  return term_limits.blocks * row / std::max<std::size_t>(rows, 1) % term_limits.folds;
}

std::vector<PreparedRecording> without_fold(const std::vector<PreparedRecording>& records, std::size_t fold) {
  std::vector<PreparedRecording> kept = records;
  for (PreparedRecording& r : kept) {
    std::vector<double>& volts = r.voltage_v.edit();
    for (std::size_t k = 0; k < volts.size(); ++k) {
      if (fold_of(k, volts.size()) == fold) volts[k] = std::numeric_limits<double>::quiet_NaN();
    }
  }
  return kept;
}

/// Squared errors of the readings in one fold, fitted on the others.
measurement::MeanSquare left_out_error(const LikelihoodModel& all, const NoiseModel& nominal, const Loosened& loosened,
                                       std::size_t fold) {
  const Hypothesis base = all.base();
  const LikelihoodModel kept(all.cell(), base.settings, without_fold(all.records(), fold), nominal, loosened);
  const HypothesisFit fit = kept.fit(base);
  measurement::MeanSquare error;
  for (std::size_t r = 0; r < all.records().size(); ++r) {
    const std::vector<double> volts = kept.voltage(fit.hypothesis, fit.calibration, r);
    for (std::size_t k = 0; k < volts.size(); ++k) {
      const double e = all.records()[r].voltage_v[k] - volts[k];
      if (fold_of(k, volts.size()) == fold && all.usable(r)[k] != 0 && std::isfinite(e)) error.add(e);
    }
  }
  return error;
}

/// RMS errors of several models on the folds left out in turn.
std::vector<double> left_out_errors_v(const LikelihoodModel& all, const NoiseModel& nominal,
                                      const std::vector<Loosened>& models) {
  std::vector<measurement::MeanSquare> errors(models.size() * term_limits.folds);
  measurement::in_parallel(errors.size(), [&](std::size_t k) {
    errors[k] = left_out_error(all, nominal, models[k / term_limits.folds], k % term_limits.folds);
  });
  std::vector<double> rms_v;
  for (std::size_t m = 0; m < models.size(); ++m) {
    double sum = 0, count = 0;
    for (std::size_t f = 0; f < term_limits.folds; ++f) {
      sum += errors[m * term_limits.folds + f].sum();
      count += static_cast<double>(errors[m * term_limits.folds + f].count());
    }
    rms_v.push_back(std::sqrt(sum / std::max(count, 1.0)));
  }
  return rms_v;
}

Loosened loosened(const TableLaw& law, double times) {
  Loosened l;
  l.*law.loosened = times;
  return l;
}

model::CellParameters<> cell_with_term(const LikelihoodModel& all, const NoiseModel& nominal, const Loosened& loose) {
  const Hypothesis base = all.base();
  const LikelihoodModel free(all.cell(), base.settings, all.records(), nominal, loose);
  const HypothesisFit fit = free.fit(base);
  return free.calibration().applied(all.cell(),
                                    {fit.calibration.data(), fit.calibration.data() + fit.calibration.size()});
}

std::optional<LawTerm> by_family(std::string_view family, double before_v) {
  for (const FamilyLaw& f : family_laws) {
    if (f.family == family) return LawTerm{f.law, {f.depends_on}, before_v, 0, 1, std::nullopt};
  }
  return std::nullopt;
}

}  // namespace

std::string_view name_of_law(const LawTerm& term) {
  if (term.law == "ocv") return "the open-circuit voltage";
  if (term.law == "ohmic") return "the resistance that acts at once";
  if (term.law == "fast") return "the polarisation within a minute";
  if (term.law == "charge") return "the counting of the charge";
  return "the effect of temperature";
}

std::optional<LawTerm> learn_law_term(const LikelihoodModel& likelihood, const NoiseModel& nominal,
                                      std::string_view family) {
  std::vector<Loosened> models = {Loosened{}};
  for (const TableLaw& law : table_laws) models.push_back(loosened(law, term_limits.times_tolerance.front()));
  const std::vector<double> errors_v = left_out_errors_v(likelihood, nominal, models);
  const auto least = std::min_element(errors_v.begin() + 1, errors_v.end());
  if (!(*least < term_limits.error_left * errors_v.front())) return by_family(family, errors_v.front());

  const TableLaw& law = table_laws[static_cast<std::size_t>(least - errors_v.begin()) - 1];
  LawTerm term{law.id, {}, errors_v.front(), *least, term_limits.times_tolerance.front(), std::nullopt};
  for (const char* on : law.depends_on) {
    if (on != nullptr) term.depends_on.emplace_back(on);
  }
  std::vector<Loosened> others;
  for (std::size_t k = 1; k < term_limits.times_tolerance.size(); ++k)
    others.push_back(loosened(law, term_limits.times_tolerance[k]));
  const std::vector<double> with_v = left_out_errors_v(likelihood, nominal, others);
  for (std::size_t k = 0; k < others.size(); ++k) {
    if (!(with_v[k] < term.left_out_after_v)) continue;
    term.left_out_after_v = with_v[k];
    term.times_tolerance = term_limits.times_tolerance[k + 1];
  }
  // a cell file does not accept every table, for example an OCV that falls
  const model::CellParameters<> with = cell_with_term(likelihood, nominal, loosened(law, term.times_tolerance));
  if (model::first_fault(with).what == nullptr) term.cell = with;
  return term;
}

}  // namespace bms::diagnosis
