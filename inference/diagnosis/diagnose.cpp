#include "diagnosis/diagnose.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "diagnosis/adequacy.hpp"
#include "diagnosis/block_covariance.hpp"
#include "diagnosis/detection_limits.hpp"
#include "diagnosis/effect_gain.hpp"
#include "diagnosis/findings.hpp"
#include "diagnosis/isolability.hpp"
#include "diagnosis/law_thresholds.hpp"
#include "diagnosis/locate.hpp"
#include "diagnosis/one_by_one.hpp"
#include "diagnosis/one_current.hpp"
#include "diagnosis/one_place.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/profile.hpp"
#include "diagnosis/resistances.hpp"
#include "diagnosis/screen.hpp"
#include "diagnosis/selection.hpp"
#include "diagnosis/testability.hpp"
#include "diagnosis/trusted_readings.hpp"
#include "diagnosis/withhold.hpp"
#include "model/start.hpp"

namespace bms::diagnosis {

namespace {

/// Checks all recordings and removes their bad readings. Returns true if a fault prevents a diagnosis.
bool has_data_fault(std::vector<PreparedRecording>& records, Diagnosis& d) {
  for (PreparedRecording& r : records) {
    RecordingCheck check = check_recording(r, d.cell);
    for (DataFault& f : check.faults) d.faults.push_back(std::move(f));
    if (check.faults.empty() && is_inverted(r)) d.faults.push_back(inverted_current());
    for (const std::string& w : check.warnings) d.warnings.push_back(r.name.empty() ? w : r.name + ": " + w);
  }
  if (d.faults.empty()) return false;
  d.verdict = Verdict::data_fault;
  d.statement = d.faults.front().text;
  for (const DataFault& f : d.faults) d.spans.insert(d.spans.end(), f.spans.begin(), f.spans.end());
  return true;
}

/// Returns true if the recordings say nothing about any mechanism.
bool is_uninformative(const LikelihoodModel& likelihood, Diagnosis& d) {
  const auto why = no_information(likelihood);
  if (!why) return false;
  d.verdict = Verdict::not_testable;
  d.statement = "No diagnosis is possible: " + *why + ". Record several minutes with a changing load.";
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    if (!knowledge_of(m).only_a_term) d.not_testable.push_back({m, *why});
  }
  return true;
}

/// Strengths that a technician can judge, around the result.
std::vector<ChangeEstimate> estimates_of(LikelihoodModel& likelihood, const NoiseModel& nominal,
                                         const HypothesisFit& best, const Scope& scope) {
  std::vector<std::size_t> over;
  for (const std::size_t m : scope.searched) {
    if (knowledge_of(m).report_limit) over.push_back(m);
  }
  likelihood.set_noise(nominal);
  std::vector<ChangeEstimate> estimates;
  const Screen screen(likelihood, best, over);
  for (const Candidate& c : screen.candidates()) {
    if (c.sigma > 0) estimates.push_back({c.mechanism, c.estimate, c.sigma});
  }
  std::sort(estimates.begin(), estimates.end(), [](const auto& a, const auto& b) { return a.mechanism < b.mechanism; });
  return estimates;
}

/// Gain of an unknown cause if no mechanism is named.
double unknown_gain_of(LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& control) {
  const NoiseModel own = likelihood.noise();
  likelihood.set_noise(nominal);
  const HypothesisFit fit = likelihood.fit(control.hypothesis, control.calibration, numerics.fit.nominal_iterations);
  const double gain = unknown_gain(test_residual(likelihood, fit));
  likelihood.set_noise(own);
  return gain;
}

double noise_floor_v(const NoiseModel& noise) {
  return std::sqrt(noise.white_v * noise.white_v + noise.fast_v * noise.fast_v + noise.slow_v * noise.slow_v);
}

/// RMS errors of a cell file [V].
struct Errors {
  double file_v = 0;     ///< on the recordings
  double gross_v = 0;    ///< above it the file does not describe the cell, whatever its tolerance says
  double certain_v = 0;  ///< above it something is wrong even if all that speaks for a cause lies in one place
};

/// covered: share of the recordings where healthy ones were. Their errors count also where they do not decide what is
/// named, as the learned error does: the file was off by as much on a healthy cell, so that much proves nothing.
Errors errors_of(const Search& search, const LikelihoodModel& likelihood, const Options& options, double covered) {
  const double healthy_v = largest_error_v(options.healthy), times = thresholds.healthy.gross_times,
               times_there = std::max(times, error_factor(covered, options.false_alarm_rate)),
               tolerated_v = std::hypot(noise_floor_v(search.nominal_noise()), likelihood.cell().tolerance.ocv_v);
  return {plain_error_v(likelihood, likelihood.base()), std::max(thresholds.decision.gross_v, times_there * healthy_v),
          thresholds.decision.certain_times * std::max(tolerated_v, healthy_v)};
}

Verdict verdict_of(const Adequacy& adequacy, const Diagnosis& d, const Errors& errors) {
  const std::vector<Finding>& findings = d.findings;
  if (adequacy.unknown) return Verdict::unknown;
  const bool comparable =
      std::none_of(d.withheld.begin(), d.withheld.end(), [](const Withheld& w) { return w.only_place.has_value(); });
  const bool gross = errors.file_v > errors.certain_v || (comparable && errors.file_v > errors.gross_v);
  if (!adequacy.found && gross) return Verdict::unknown;
  if (!adequacy.found) return more_healthy_data_would_decide(d) ? Verdict::not_testable : Verdict::no_mismatch;
  if (findings.size() > 1) return Verdict::causes;
  return findings.front().equivalent_to.empty() ? Verdict::cause : Verdict::ambiguous;
}

/// The numbers behind the verdict.
void add_numbers(const Adequacy& adequacy, const NoiseModel& nominal, Diagnosis& d) {
  d.noise = nominal;
  d.noise_floor_v = noise_floor_v(nominal);
  d.base_cost = adequacy.control_cost;
  d.best_cost = adequacy.best_cost;
  d.remaining = adequacy.residual.gain;
  d.remaining_goes_with = adequacy.residual.family;
  d.fast_excess = adequacy.residual.fast_excess;
  d.far_out = adequacy.residual.far_out;
  d.adequacy = adequacy.explained;
}

/// Where the mismatch lies, how much of it is explained, and the voltages for plots.
void add_location(const LikelihoodModel& likelihood, const HypothesisFit& best, const Contributions& contributed,
                  const Adequacy& adequacy, const Errors& errors, Diagnosis& d) {
  const bool unexplained = d.verdict == Verdict::unknown || !adequacy.found;
  d.explained_share = contributed.explained_share;
  // of the error of the cell file as it is, which is the one that is reported
  if (names(d.verdict))
    d.explained_share = explained_share(errors.file_v, contributed.remaining_rmse_v, d.noise.white_v);
  d.unexplained_rmse_v = contributed.remaining_rmse_v;
  d.unexplained_share = 1 - d.explained_share;
  d.spans = unexplained ? adequacy.residual.spans : contributed.spans;
  d.regimes = regimes(likelihood, best, unexplained ? adequacy.residual.energy : contributed.energy);
  for (std::size_t r = 0; r < likelihood.records().size(); ++r) {
    RecordingView view;
    view.base_v = likelihood.voltage(likelihood.base(), likelihood.unchanged(), r);
    view.extended_v = likelihood.voltage(best.hypothesis, best.calibration, r, &view.soc);
    d.views.push_back(std::move(view));
  }
  if (d.verdict != Verdict::no_mismatch) return;
  d.spans.clear();
  d.regimes.clear();
  d.unexplained_share = 0;
}

/// Sizes that would be named. Next to healthy recordings a gain must often be so large that it is no longer as the
/// square of the size.
std::vector<DetectionLimit> stated_limits(const LikelihoodModel& likelihood, const NoiseModel& nominal,
                                          const HypothesisFit& control, const std::vector<StrengthSigma>& sigmas,
                                          const Adequacy& adequacy, const std::optional<HealthyJudge>& judge_healthy) {
  const double capacity_ah = likelihood.cell().capacity_ah;
  if (!judge_healthy) return limits_of(sigmas, adequacy.residual, capacity_ah, {});
  const EffectGain effect(likelihood, nominal, control);
  const auto gain_of_size = [&](const StrengthSigma& s, double size) {
    MechanismSetting setting = s.start;
    setting.value[0] = size;
    return effect.of(setting);
  };
  const auto stands_out = [&](std::size_t mechanism) { return judge_healthy->gain_needed(mechanism); };
  return limits_of(sigmas, adequacy.residual, capacity_ah, stands_out, gain_of_size);
}

/// Without healthy recordings nothing is named that shows in one place alone. Something unknown elsewhere stays.
void withhold_only_place(LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& control,
                         double false_alarm_rate, Survivors& survivors, Adequacy& adequacy,
                         std::vector<Withheld>& withheld) {
  if (!adequacy.only_place) return;
  withheld =
      withheld_at(likelihood, *adequacy.only_place, survivors.best.hypothesis, survivors.gains, false_alarm_rate);
  survivors = {control, {}, {}, {}};
  adequacy = judge(likelihood, nominal, control, survivors);
  if (adequacy.residual.only_place) adequacy.unknown = false;
}

/// Where an unknown cause sits, and the cell with a term for it. One or two causes that are named although a law that
/// no mechanism changes explains more are unknown; a cell file missing three or more effects produces residuals outside
/// the catalogue anyway. With healthy recordings the catalogue is judged by them.
void add_law_term(const LikelihoodModel& likelihood, const NoiseModel& nominal, bool healthy, Diagnosis& d) {
  const bool doubtful = names(d.verdict) && !healthy && d.findings.size() <= law_thresholds.law.few_causes;
  if ((d.verdict != Verdict::unknown && !doubtful) || d.interrupted) return;
  std::vector<LawEvidence> laws = law_evidence(likelihood, nominal);
  if (doubtful) {
    if (!another_law_explains_more(laws, d.base_cost - d.best_cost, d.remaining)) return;
    d.verdict = Verdict::unknown;
  }
  d.law = learn_law_term(likelihood, nominal, std::move(laws));
  if (d.law && d.law->cell) d.cell = *d.law->cell;
}

/// The extended cell: mechanisms found, and base parameters where they fit together with them.
void add_extended_cell(const LikelihoodModel& likelihood, const HypothesisFit& best, Diagnosis& d) {
  d.extended = best.hypothesis;
  d.covariance = best.covariance;
  if (names(d.verdict))
    d.cell = likelihood.calibration().applied(
        d.cell, {best.calibration.data(), best.calibration.data() + best.calibration.size()});
}

/// A search that was stopped names nothing: what was not tried may explain as much as what was.
void leave_unfinished(const Search& search, const Scope& scope, Diagnosis& d) {
  d.interrupted = true;
  d.verdict = Verdict::unfinished;
  d.findings.clear();
  d.withheld.clear();
  for (const std::size_t m : scope.searched) {
    const auto has = [m](const auto& fit) {
      return std::find(fit.first.begin(), fit.first.end(), m) != fit.first.end();
    };
    const bool tried = std::any_of(search.best_of_each().begin(), search.best_of_each().end(), has);
    (tried ? d.tried : d.not_tried).push_back(m);
  }
}

void add_resistances_if_understood(LikelihoodModel& likelihood, const HypothesisFit& best, Diagnosis& d) {
  if (!names(d.verdict) && d.verdict != Verdict::no_mismatch) return;
  likelihood.set_noise(best.noise);
  add_resistances(likelihood, best, d);
}

/// What healthy recordings leave of it if they decide. judge: nothing afterwards if they do not.
Survivors compared_with_healthy(std::optional<HealthyJudge>& judge, Survivors survivors, Diagnosis& d) {
  survivors = judge->without_withheld(std::move(survivors));
  d.healthy = judge->basis();  // a sensor that reads too much is not a load that they have not seen
  if (!d.healthy->decided) judge.reset();
  return survivors;
}

/// The diagnosis of recordings that can be used. d: with the cell, and what the checks have found.
Diagnosis diagnose_together(Diagnosis d, const std::vector<MechanismSetting>& own,
                            std::vector<PreparedRecording> records, const Options& options) {
  LikelihoodModel likelihood = likelihood_model_of(d.cell, own, std::move(records), options.healthy.regimes);
  if (is_uninformative(likelihood, d)) return d;
  const Scope scope = scope_of(likelihood);
  d.not_testable = scope.not_testable;

  Search search(likelihood, options.progress, options.stopped);
  const HypothesisFit control = search.with_own_noise(likelihood.fit(likelihood.base()));
  search.report("calibration");
  const Grown grown = grow(search, control, scope, options.most_mechanisms);
  const std::vector<StrengthSigma> sigmas = strength_sigmas(likelihood, search.nominal_noise(), control, scope);
  search.report("noise");
  Survivors survivors = eliminate(search, likelihood, control, grown.fit, scope);
  d.gains = gains_of(grown, survivors);
  std::optional<HealthyJudge> judge_healthy;
  if (options.healthy.any()) {
    judge_healthy.emplace(search, likelihood, control, scope, options.healthy, options.false_alarm_rate);
    survivors = compared_with_healthy(judge_healthy, std::move(survivors), d);
  }
  if (!options.learns) survivors = without_uncertain(search, likelihood, control, scope, std::move(survivors));
  Adequacy adequacy = judge(likelihood, search.nominal_noise(), control, survivors);
  if (!judge_healthy && !options.learns) {
    withhold_only_place(likelihood, search.nominal_noise(), control, options.false_alarm_rate, survivors, adequacy,
                        d.withheld);
    if (is_read_in_leaps(likelihood.records())) adequacy.unknown = true;  // no mechanism in the catalogue produces this
  }
  d.limits = stated_limits(likelihood, search.nominal_noise(), control, sigmas, adequacy, judge_healthy);
  if (!options.learns && !search.stopped())
    d.isolability = isolability_of(likelihood, search.nominal_noise(), d.limits);
  d.unknown_gain = unknown_gain(adequacy.residual);
  if (options.learns && adequacy.found)
    d.unknown_gain = std::max(d.unknown_gain, unknown_gain_of(likelihood, search.nominal_noise(), control));
  if (judge_healthy) {
    judge_healthy->withhold_unknown(adequacy);
    d.healthy = judge_healthy->basis();
    d.withheld = judge_healthy->withheld();
  }
  if (!options.learns) survivors.best = profiled(likelihood, std::move(survivors.best));
  include_model_error(likelihood, survivors.best);

  const Contributions contributed = contributions(likelihood, control, survivors.best);
  const auto healthy_gain = [&](std::size_t m) { return judge_healthy->gain_needed(m); };
  const HealthyGain of_healthy = judge_healthy ? HealthyGain(healthy_gain) : HealthyGain();
  d.findings = findings_of(search, survivors, contributed, of_healthy);
  add_alike_at_one_current(search, likelihood, survivors.best, of_healthy, d.findings);
  const Errors errors = errors_of(search, likelihood, options, d.healthy ? d.healthy->covered.share : 1);
  d.candidates = ranking_of(search, likelihood, control, grown, survivors, errors.file_v);
  d.verdict = verdict_of(adequacy, d, errors);
  if (search.stopped()) leave_unfinished(search, scope, d);
  add_numbers(adequacy, search.nominal_noise(), d);
  if (!options.learns) add_law_term(likelihood, search.nominal_noise(), judge_healthy.has_value(), d);
  add_location(likelihood, survivors.best, contributed, adequacy, errors, d);
  add_extended_cell(likelihood, survivors.best, d);
  if (!options.learns) add_resistances_if_understood(likelihood, survivors.best, d);
  d.estimates = estimates_of(likelihood, search.nominal_noise(), survivors.best, scope);
  if (options.progress) options.progress(1, "done");
  return d;
}

}  // namespace

const char* name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::no_mismatch:
      return "NO_MISMATCH";
    case Verdict::cause:
      return "CAUSE";
    case Verdict::causes:
      return "CAUSES";
    case Verdict::ambiguous:
      return "AMBIGUOUS";
    case Verdict::unknown:
      return "UNKNOWN";
    case Verdict::data_fault:
      return "DATA_FAULT";
    case Verdict::not_testable:
      return "NOT_TESTABLE";
    case Verdict::unfinished:
      return "UNFINISHED";
  }
  return "";
}

std::vector<MechanismSetting> later_recording(const Hypothesis& extended, std::optional<double> initial_soc) {
  std::vector<MechanismSetting> later;
  for (std::size_t k = 0; k < extended.settings.size(); ++k) {
    MechanismSetting s = extended.settings[k];
    if (k < extended.own) {  // starts by the rule wherever it is simulated
      later.push_back(s);
    } else if (knowledge_of(s.index).carry_over(s)) {
      later.push_back(initial_soc ? model::started(s, *initial_soc) : s);
    }
  }
  return later;
}

std::vector<double> predict(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& settings,
                            const PreparedRecording& record, std::vector<double>* soc) {
  const LikelihoodModel likelihood(cell, settings, {record}, NoiseModel{});
  return likelihood.voltage(likelihood.base(), likelihood.unchanged(), 0, soc);
}

Diagnosis diagnose(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& own,
                   std::vector<PreparedRecording> records, const Options& options) {
  Diagnosis d;
  d.cell = cell;
  if (has_data_fault(records, d)) return d;
  // healthy recordings of which none could be compared say nothing, so they forbid nothing
  if (options.healthy.known && !options.healthy.any())
    d.warnings.push_back(
        "none of the healthy recordings of the cell file could be compared with a cell file that was made without it: "
        "the diagnosis is as without them (two like this one, bms identify --healthy)");
  if (have_trusted_readings(records)) {
    const std::vector<InstrumentError> errors = compare_instruments(records, cell);
    return with_instrument_errors(diagnose(cell, own, as_trusted(records, errors), options), errors, cell, own,
                                  records);
  }
  // what one recording names has a known false alarm rate only next to healthy ones that decide
  const bool one = records.size() == 1 || options.learns || !options.healthy.any();
  Diagnosis together = diagnose_together(std::move(d), own, one ? std::move(records) : records, options);
  if (one || names(together.verdict) || together.interrupted) return together;
  return likeliest_alone(std::move(together), cell, own, records, [&](const PreparedRecording& r) {
    Diagnosis alone;
    alone.cell = cell;
    return diagnose_together(std::move(alone), own, {r}, options);
  });
}

}  // namespace bms::diagnosis
