#include "diagnosis/law_term.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

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
};
constexpr std::array<TableLaw, 3> table_laws = {{
    {"ocv", &Loosened::ocv},
    {"ohmic", &Loosened::r0},
    {"fast", &Loosened::rc},
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

/// Learns the term of a law with a table, if it pays on what is left out.
void learn_table(const LikelihoodModel& likelihood, const NoiseModel& nominal, const TableLaw& law, LawTerm& term) {
  std::vector<Loosened> models = {Loosened{}};
  for (const double times : term_limits.times_tolerance) models.push_back(loosened(law, times));
  const std::vector<BlockErrors> errors = left_out(likelihood, nominal, models, short_blocks);
  term.left_out_before_v = rms_v(errors.front());
  double least_v = rms_v(errors.back());
  for (std::size_t k = 1; k < errors.size(); ++k) least_v = std::min(least_v, rms_v(errors[k]));
  std::size_t chosen = errors.size() - 1;  // the smallest factor that is as good as the best
  while (rms_v(errors[chosen]) > term_limits.as_good * least_v) --chosen;
  term.left_out_after_v = rms_v(errors[chosen]);
  if (chosen == 0) return;
  term.times_tolerance = term_limits.times_tolerance[chosen - 1];
  if (!(term.left_out_after_v < term_limits.error_left * term.left_out_before_v)) return;
  if (!improves(errors.front(), errors[chosen])) return;
  const std::vector<BlockErrors> far = left_out(likelihood, nominal, {Loosened{}, models[chosen]}, long_blocks);
  if (!(rms_v(far[1]) <= rms_v(far[0]))) return;
  // a cell file does not accept every table, for example an OCV that falls
  const model::CellParameters<> cell = cell_with_term(likelihood, nominal, models[chosen]);
  if (model::first_fault(cell).what == nullptr) term.cell = cell;
}

}  // namespace

std::string_view name_of_law(const LawTerm& term) {
  if (term.law == "ocv") return "the open-circuit voltage";
  if (term.law == "ohmic") return "the resistance that acts at once";
  if (term.law == "fast") return "the polarisation within a minute";
  if (term.law == "slow") return "a polarisation that lasts for minutes to hours";
  if (term.law == "charge") return "the counting of the charge";
  if (term.law == "voltage") return "the reading of the voltage";
  if (term.law == "timing") return "the time at which a channel is read";
  return "the effect of temperature";
}

std::vector<LawEvidence> law_evidence(const LikelihoodModel& likelihood, const NoiseModel& nominal) {
  const Hypothesis base = likelihood.base();
  const LikelihoodModel plain(likelihood.cell(), base.settings, likelihood.records(), nominal, {},
                              likelihood.learned());
  return law_evidence(plain, plain.fit(base));
}

std::optional<LawTerm> learn_law_term(const LikelihoodModel& likelihood, const NoiseModel& nominal,
                                      std::vector<LawEvidence> laws) {
  LawTerm term;
  term.laws = std::move(laws);
  const std::vector<PreparedRecording>& records = likelihood.records();
  if (std::any_of(records.begin(), records.end(), follows_in_leaps)) {
    term.law = "voltage";
    term.depends_on = {"voltage"};
    return term;
  }
  const auto most =
      std::find_if(term.laws.begin(), term.laws.end(), [](const LawEvidence& e) { return e.law[0] != 0; });
  if (most == term.laws.end() || most->gain < term_limits.least_evidence) return std::nullopt;
  term.law = most->law;
  term.depends_on = {most->depends_on};
  for (const TableLaw& law : table_laws) {
    if (term.law == law.id) learn_table(likelihood, nominal, law, term);
  }
  return term;
}

}  // namespace bms::diagnosis
