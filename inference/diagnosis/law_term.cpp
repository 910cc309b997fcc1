#include "diagnosis/law_term.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/block_covariance.hpp"
#include "diagnosis/law_thresholds.hpp"
#include "diagnosis/mechanisms/load_memory.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"
#include "numerics/in_parallel.hpp"

namespace bms::diagnosis {

namespace {

constexpr const TermThresholds& term_limits = law_thresholds.term;

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

/// What is fitted where parts are left out.
struct TermModel {
  Loosened loosened;
  std::optional<MechanismSetting> mechanism;

  /// Where its fit begins.
  Hypothesis start(const Hypothesis& base) const { return mechanism ? with(base, *mechanism) : base; }
};

/// Errors of the readings that were left out, by block.
using BlockErrors = std::vector<measurement::MeanSquare>;

/// Of the blocks of one fold, fitted on the others.
void add_left_out(const LikelihoodModel& all, const NoiseModel& nominal, const TermModel& model, const Folds& folds,
                  std::size_t fold, BlockErrors& errors) {
  const Hypothesis base = all.base();
  const LikelihoodModel kept(all.cell(), base.settings, without_fold(all.records(), folds, fold), nominal,
                             model.loosened, all.learned());
  const HypothesisFit fit = kept.fit(model.start(base));
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
                                  const std::vector<TermModel>& models, const Folds& folds) {
  std::vector<BlockErrors> errors(models.size(), BlockErrors(all.records().size() * folds.blocks));
  numerics::in_parallel(models.size() * term_limits.folds, [&](std::size_t k) {
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

/// Returns true if a model pays on short parts that are left out, and does no harm on long ones.
bool pays(const LikelihoodModel& likelihood, const NoiseModel& nominal, const TermModel& model,
          const BlockErrors& before, const BlockErrors& after) {
  if (!(rms_v(after) < term_limits.error_left * rms_v(before))) return false;
  if (!improves(before, after)) return false;
  const std::vector<BlockErrors> far = left_out(likelihood, nominal, {TermModel{}, model}, long_blocks);
  return rms_v(far[1]) <= rms_v(far[0]);
}

TermModel loosened(const TableLaw& law, double times) {
  TermModel m;
  m.loosened.*law.loosened = times;
  return m;
}

LikelihoodModel likelihood_with(const LikelihoodModel& all, const NoiseModel& nominal, const Loosened& loose) {
  return {all.cell(), all.base().settings, all.records(), nominal, loose, all.learned()};
}

/// With a fit's base parameters; nothing if a cell file does not accept them, for example an OCV that falls.
std::optional<model::CellParameters<>> fitted_cell(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  const model::CellParameters<> cell = likelihood.calibration().applied(
      likelihood.cell(), {fit.calibration.data(), fit.calibration.data() + fit.calibration.size()});
  return model::first_fault(cell).what == nullptr ? std::optional(cell) : std::nullopt;
}

/// The law with the most evidence; nullptr if none has enough to be named. laws: the largest first.
const LawEvidence* likeliest_law(const std::vector<LawEvidence>& laws) {
  const auto most = std::find_if(laws.begin(), laws.end(), [](const LawEvidence& e) { return e.law[0] != 0; });
  return most == laws.end() || most->gain < law_thresholds.law.least ? nullptr : &*most;
}

/// Learns the term of a law with a table, if it pays on what is left out.
void learn_table(const LikelihoodModel& likelihood, const NoiseModel& nominal, const TableLaw& law, LawTerm& term) {
  std::vector<TermModel> models = {TermModel{}};
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
  if (!pays(likelihood, nominal, models[chosen], errors.front(), errors[chosen])) return;
  const LikelihoodModel free = likelihood_with(likelihood, nominal, models[chosen].loosened);
  term.cell = fitted_cell(free, free.fit(free.base()));
}

/// Learns the memory of the load, if it pays on what is left out.
void learn_memory(const LikelihoodModel& likelihood, const NoiseModel& nominal, LawTerm& term) {
  constexpr std::size_t memory = model::mechanism_index_of<model::LoadMemory>,
                        time_constant = Knowledge<model::LoadMemory>::time_constant;
  const LikelihoodModel plain = likelihood_with(likelihood, nominal, {});
  if (plain.base().find(memory) != nullptr) return;
  plain.linearise(plain.base(), plain.unchanged());  // which the fits share
  std::array<std::optional<HypothesisFit>, law_thresholds.law.slow_s.size()> fits;
  numerics::in_parallel(fits.size(), [&](std::size_t k) {
    MechanismSetting start = model::default_setting(memory, plain.cell());
    start.value[time_constant] = law_thresholds.law.slow_s[k];
    fits[k] = plain.fit(with(plain.base(), start));
  });
  HypothesisFit& fit =
      **std::min_element(fits.begin(), fits.end(), [](const auto& a, const auto& b) { return a->cost < b->cost; });
  const TermModel model{{}, fit.hypothesis.settings.back()};
  const std::vector<BlockErrors> errors = left_out(likelihood, nominal, {TermModel{}, model}, short_blocks);
  term.left_out_before_v = rms_v(errors[0]);
  term.left_out_after_v = rms_v(errors[1]);
  // a strength or a time at its bound is not known
  const bool at_bound = std::any_of(fit.at_bound.begin(), fit.at_bound.end(), [](char at) { return at != 0; });
  if (at_bound || !pays(likelihood, nominal, model, errors[0], errors[1])) return;
  term.cell = fitted_cell(plain, fit);
  if (!term.cell) return;
  include_model_error(plain, fit);
  term.mechanism = fit.hypothesis.settings.back();
}

}  // namespace

std::vector<MechanismSetting> with_term(std::vector<MechanismSetting> own, const LawTerm& term) {
  if (term.mechanism) own.push_back(*term.mechanism);
  return own;
}

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
  const LikelihoodModel plain = likelihood_with(likelihood, nominal, {});
  return law_evidence(plain, plain.fit(plain.base()));
}

std::optional<LawTerm> learn_law_term(const LikelihoodModel& likelihood, const NoiseModel& nominal,
                                      std::vector<LawEvidence> laws) {
  LawTerm term;
  term.laws = std::move(laws);
  const std::vector<PreparedRecording>& records = likelihood.records();
  if (is_read_in_leaps(records)) {
    term.law = "voltage";
    term.depends_on = {"voltage"};
    return term;
  }
  const LawEvidence* most = likeliest_law(term.laws);
  if (most == nullptr) return std::nullopt;
  term.law = most->law;
  term.depends_on = {most->depends_on};
  for (const TableLaw& law : table_laws) {
    if (term.law == law.id) learn_table(likelihood, nominal, law, term);
  }
  if (term.law == "slow") learn_memory(likelihood, nominal, term);
  return term;
}

}  // namespace bms::diagnosis
