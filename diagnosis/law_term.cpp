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

/// Which part of a recording is left out: every third of so many equal blocks.
struct Folds {
  std::size_t blocks;
  std::size_t block_of(std::size_t row, std::size_t rows) const {
    return blocks * row / std::max<std::size_t>(rows, 1);
  }
  std::size_t fold_of(std::size_t row, std::size_t rows) const { return block_of(row, rows) % term_limits.folds; }
};
constexpr Folds short_blocks{term_limits.blocks}, long_blocks{term_limits.long_blocks};

std::vector<PreparedRecording> without_fold(const std::vector<PreparedRecording>& records, const Folds& folds,
                                            std::size_t fold) {
  std::vector<PreparedRecording> kept = records;
  for (PreparedRecording& r : kept) {
    std::vector<double>& volts = r.voltage_v.edit();
    for (std::size_t k = 0; k < volts.size(); ++k) {
      if (folds.fold_of(k, volts.size()) == fold) volts[k] = std::numeric_limits<double>::quiet_NaN();
    }
  }
  return kept;
}

/// Errors of the readings that were left out, by block.
using BlockErrors = std::vector<measurement::MeanSquare>;

/// Of the blocks of one fold, fitted on the others.
void add_left_out(const LikelihoodModel& all, const NoiseModel& nominal, const Loosened& loosened, const Folds& folds,
                  std::size_t fold, BlockErrors& errors) {
  const Hypothesis base = all.base();
  const LikelihoodModel kept(all.cell(), base.settings, without_fold(all.records(), folds, fold), nominal, loosened,
                             all.learned());
  const HypothesisFit fit = kept.fit(base);
  for (std::size_t r = 0; r < all.records().size(); ++r) {
    const std::vector<double> volts = kept.voltage(fit.hypothesis, fit.calibration, r);
    for (std::size_t k = 0; k < volts.size(); ++k) {
      const double e = all.records()[r].voltage_v[k] - volts[k];
      if (folds.fold_of(k, volts.size()) == fold && all.usable(r)[k] != 0 && std::isfinite(e))
        errors[r * folds.blocks + folds.block_of(k, volts.size())].add(e);
    }
  }
}

/// Of several models; each fold writes blocks of its own.
std::vector<BlockErrors> left_out(const LikelihoodModel& all, const NoiseModel& nominal,
                                  const std::vector<Loosened>& models, const Folds& folds) {
  std::vector<BlockErrors> errors(models.size(), BlockErrors(all.records().size() * folds.blocks));
  measurement::in_parallel(models.size() * term_limits.folds, [&](std::size_t k) {
    const std::size_t model = k / term_limits.folds;
    add_left_out(all, nominal, models[model], folds, k % term_limits.folds, errors[model]);
  });
  return errors;
}

double rms_v(const BlockErrors& errors) {
  double sum = 0, count = 0;
  for (const measurement::MeanSquare& e : errors) {
    sum += e.sum();
    count += static_cast<double>(e.count());
  }
  return std::sqrt(sum / std::max(count, 1.0));
}

/// Returns true if the squared error of the blocks is smaller by more than chance: its mean change over the standard
/// deviation of that mean.
bool improves(const BlockErrors& before, const BlockErrors& after) {
  double sum = 0, squares = 0, n = 0;
  for (std::size_t b = 0; b < before.size(); ++b) {
    if (before[b].count() == 0) continue;
    const double change = before[b].sum() - after[b].sum();
    sum += change;
    squares += change * change;
    ++n;
  }
  if (n < 2) return false;
  const double mean = sum / n, variance = (squares / n - mean * mean) / (n - 1);
  return mean > term_limits.improves_sigmas * std::sqrt(std::max(variance, 0.0));
}

Loosened loosened(const TableLaw& law, double times) {
  Loosened l;
  l.*law.loosened = times;
  return l;
}

model::CellParameters<> cell_with_term(const LikelihoodModel& all, const NoiseModel& nominal, const Loosened& loose) {
  const Hypothesis base = all.base();
  const LikelihoodModel free(all.cell(), base.settings, all.records(), nominal, loose, all.learned());
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
  const auto errors_of = [&](const std::vector<Loosened>& models, const Folds& folds) {
    return left_out(likelihood, nominal, models, folds);
  };
  std::vector<Loosened> models = {Loosened{}};
  for (const TableLaw& law : table_laws) models.push_back(loosened(law, term_limits.times_tolerance.front()));
  const std::vector<BlockErrors> errors = errors_of(models, short_blocks);
  const auto least = std::min_element(errors.begin() + 1, errors.end(),
                                      [](const BlockErrors& a, const BlockErrors& b) { return rms_v(a) < rms_v(b); });
  const double before_v = rms_v(errors.front());
  if (!(rms_v(*least) < term_limits.error_left * before_v)) return by_family(family, before_v);

  const TableLaw& law = table_laws[static_cast<std::size_t>(least - errors.begin()) - 1];
  LawTerm term{law.id, {}, before_v, rms_v(*least), term_limits.times_tolerance.front(), std::nullopt};
  for (const char* on : law.depends_on) {
    if (on != nullptr) term.depends_on.emplace_back(on);
  }
  std::vector<Loosened> others;
  for (std::size_t k = 1; k < term_limits.times_tolerance.size(); ++k)
    others.push_back(loosened(law, term_limits.times_tolerance[k]));
  std::vector<BlockErrors> with = errors_of(others, short_blocks);
  with.insert(with.begin(), *least);
  double least_v = term.left_out_after_v;
  for (const BlockErrors& e : with) least_v = std::min(least_v, rms_v(e));
  std::size_t chosen = with.size() - 1;  // the smallest factor that is as good as the best
  while (rms_v(with[chosen]) > term_limits.as_good * least_v) --chosen;
  term.left_out_after_v = rms_v(with[chosen]);
  term.times_tolerance = term_limits.times_tolerance[chosen];
  if (!improves(errors.front(), with[chosen])) return term;
  const Loosened free = loosened(law, term.times_tolerance);
  const std::vector<BlockErrors> far = errors_of({Loosened{}, free}, long_blocks);
  if (!(rms_v(far[1]) <= rms_v(far[0]))) return term;
  // a cell file does not accept every table, for example an OCV that falls
  const model::CellParameters<> cell = cell_with_term(likelihood, nominal, free);
  if (model::first_fault(cell).what == nullptr) term.cell = cell;
  return term;
}

}  // namespace bms::diagnosis
