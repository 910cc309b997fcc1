#include "diagnosis/texts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "diagnosis/detection_limits.hpp"
#include "diagnosis/thresholds.hpp"
#include "diagnosis/withheld_text.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

using model::catalogue;

/// "The model is off by 18.6 mV."
std::string model_error(const RecordingFacts& facts) {
  return fmt::format("The model is off by {}.", millivolts(facts.error_v));
}

std::string percent(double share) { return fmt::format("{:.0f} %", 100 * share); }

std::string brief_of(std::size_t mechanism) { return std::string(text_of_mechanism(mechanism).brief); }

std::string range_text(const Regime& g) {
  if (g.axis == "soc") return fmt::format("at {:.0f} to {:.0f} % state of charge", 100 * g.from, 100 * g.to);
  if (g.axis == "current_c") return fmt::format("at currents of {:.2g} to {:.2g} C", g.from, g.to);
  if (g.axis == "temperature_c") return fmt::format("at {:.0f} to {:.0f} degrees C", g.from, g.to);
  if (g.axis == "since_edge_s")
    return fmt::format("{} to {} after a step of the current", duration_text(g.from), duration_text(g.to));
  return fmt::format("at {} {:.2g} to {:.2g}", g.axis, g.from, g.to);
}

/// Where a mismatch lies: its regime and its time. Empty if it lies everywhere.
std::string place(const Diagnosis& d) {
  std::string text = d.regimes.empty() ? "" : range_text(d.regimes.front());
  if (d.spans.empty() || d.spans.size() > text_style.spans_named_at_most) return text;
  const model::Span widest = *std::max_element(d.spans.begin(), d.spans.end(), [](const auto& a, const auto& b) {
    return a.end_s - a.start_s < b.end_s - b.start_s;
  });
  text += fmt::format("{}between {} and {}", text.empty() ? "" : ", ", duration_text(widest.start_s),
                      duration_text(widest.end_s));
  return text;
}

/// Limits that a technician can judge, the sharpest of their range first.
std::string telling_limits(const Diagnosis& d, const RecordingFacts& facts) {
  std::vector<std::pair<double, const DetectionLimit*>> order;
  for (const DetectionLimit& l : d.limits) {
    if (!knowledge_of(l.mechanism).report_limit) continue;
    const model::Parameter& p = catalogue[l.mechanism].parameter[l.parameter];
    order.emplace_back(l.value / p.upper(facts.capacity_ah), &l);
  }
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::string> parts;
  for (const auto& [ratio, l] : order) {
    if (parts.size() == text_style.limits_named) break;
    const model::Parameter& p = catalogue[l->mechanism].parameter[l->parameter];
    parts.push_back(fmt::format("{} of {}", text_of_mechanism(l->mechanism).name, parameter_text(p, l->value, 0)));
  }
  return joined(parts, "or");
}

/// A candidate without a finding's mechanism, and what it has instead.
struct RankedRival {
  const Ranked* ranked = nullptr;
  std::size_t instead = 0;
};

/// The best candidate that has another mechanism in the place of a finding's, everything else being the same.
RankedRival rival_of(const Diagnosis& d, const Finding& f) {
  std::vector<std::size_t> others;
  for (const Finding& g : d.findings) {
    if (g.setting.index != f.setting.index) others.push_back(g.setting.index);
  }
  const auto has = [](const std::vector<std::size_t>& ids, std::size_t m) {
    return std::find(ids.begin(), ids.end(), m) != ids.end();
  };
  for (const Ranked& r : d.candidates) {
    if (has(r.ids, f.setting.index) || r.ids.size() != others.size() + 1) continue;
    const auto extra = std::find_if(r.ids.begin(), r.ids.end(), [&](std::size_t m) { return !has(others, m); });
    if (extra != r.ids.end()) return {&r, *extra};
  }
  return {};
}

std::string times(std::size_t n) {
  if (n == 1) return "once";
  if (n == 2) return "twice";
  return fmt::format("{} times", n);
}

/// The facts of these recordings that help to distinguish two mechanisms.
std::string relevant_facts(std::size_t a, std::size_t b, const RecordingFacts& facts) {
  const Fact relevant = knowledge_of(a).facts | knowledge_of(b).facts;
  std::vector<std::string> parts;
  if (includes(relevant, Fact::reversals))
    parts.push_back(facts.reversals > 0 ? "the charge turns " + times(facts.reversals) : "the charge never turns");
  if (includes(relevant, Fact::rests))
    parts.push_back(facts.longest_rest_s >= text_style.rest_named_s
                        ? "the longest rest is " + duration_text(facts.longest_rest_s)
                        : "there is no rest");
  if (includes(relevant, Fact::temperature))
    parts.push_back(facts.temperature_span_k > 0
                        ? fmt::format("the temperature spans {:.1f} K", facts.temperature_span_k)
                        : "the temperature does not change");
  if (includes(relevant, Fact::rates)) parts.push_back(fmt::format("there are currents of {} sizes", facts.rates));
  if (includes(relevant, Fact::soc_span)) parts.push_back("the state of charge spans " + percent(facts.soc_span));
  return parts.empty() ? "" : " In this recording " + joined(parts, "and") + ".";
}

/// Causes that no possible size would show. Next to healthy recordings it is these that hide a cause.
std::string not_visible_text(const Diagnosis& d) {
  std::vector<std::string> names;
  for (const std::size_t m : d.healthy ? std::vector<std::size_t>() : not_visible(d)) {
    if (knowledge_of(m).report_limit) names.emplace_back(text_of_mechanism(m).name);
  }
  return names.empty() ? "" : " Not visible in this recording: " + joined(names, "and") + ".";
}

std::string no_mismatch_text(const Diagnosis& d, const RecordingFacts& facts) {
  const std::string limits = telling_limits(d, facts);
  return fmt::format(
      "The cell file reproduces the recording to {}, which is within its tolerance: with its parameters moved inside "
      "of that, {} remain.{}{} {}",
      millivolts(facts.error_v), millivolts(d.unexplained_rmse_v),
      limits.empty() ? "" : " The recording would have revealed " + limits + ".", not_visible_text(d), no_action);
}

std::string cause_text(const Diagnosis& d, const RecordingFacts& facts) {
  const Finding& f = d.findings.front();
  return fmt::format("{} This explains {} of the model's error of {}, {} remain; the probability is {}. {}",
                     capitalised(claim(f.setting)) + ".", percent(d.explained_share), millivolts(facts.error_v),
                     millivolts(d.unexplained_rmse_v), percent(f.probability),
                     text_of_mechanism(f.setting.index).action);
}

std::string ambiguous_text(const Diagnosis& d, const RecordingFacts& facts) {
  const Finding& f = d.findings.front();
  std::vector<std::string> parts = {claim(f.setting)};
  for (const std::size_t m : f.equivalent_to) parts.push_back(brief_of(m));
  return fmt::format("{} Either {}. {} cannot distinguish them. {}", model_error(facts), joined(parts, "or"),
                     d.views.size() > 1 ? "These recordings" : "This recording", another_experiment);
}

std::string causes_text(const Diagnosis& d, const RecordingFacts& facts) {
  constexpr std::array<std::string_view, 7> count = {"No cause",    "One cause",   "Two causes", "Three causes",
                                                     "Four causes", "Five causes", "Six causes"};
  std::vector<std::string> parts;
  for (const Finding& f : d.findings) {
    const bool in_full = parts.size() < text_style.causes_in_full;
    std::string part = in_full ? claim(f.setting) : std::string(text_of_mechanism(f.setting.index).name);
    part += " (" + millivolts(f.rms_contribution_v);
    std::vector<std::string> rivals;
    for (const std::size_t m : f.equivalent_to) rivals.push_back(brief_of(m));
    part += rivals.empty() ? ")" : "; or " + joined(rivals, "or") + ")";
    parts.push_back(std::move(part));
  }
  const std::string_view number = count[std::min(parts.size(), count.size() - 1)];
  const std::string explained =
      d.explained_share < text_style.explained_by_tables
          ? fmt::format("{} act, whose effects on this recording its tables contain, and {} remain", number,
                        millivolts(d.unexplained_rmse_v))
          : fmt::format("{} together explain {} of it, {} remain", number, percent(d.explained_share),
                        millivolts(d.unexplained_rmse_v));
  const auto in_cell = static_cast<std::size_t>(std::count_if(d.findings.begin(), d.findings.end(), [](const auto& f) {
    return model::catalogue[f.setting.index].domain == model::Domain::physics;
  }));
  const std::string_view another_cell =
      in_cell < text_style.changes_of_a_cell
          ? ""
          : " So much at once is also what the file of another cell looks like: check that this one is the cell's.";
  return fmt::format("{} {}: {}.{} Begin with the first: {}", model_error(facts), explained, joined(parts, "and"),
                     another_cell, text_of_mechanism(d.findings.front().setting.index).action);
}

std::string unknown_text(const Diagnosis& d, const RecordingFacts& facts) {
  const std::string where = place(d);
  std::string text =
      fmt::format("The recording differs from the model by {} in a way that none of the known causes explains.",
                  millivolts(facts.error_v));
  std::vector<std::string> possible;
  const Withheld* first = nullptr;
  for (const Withheld& w : d.withheld) {
    if (w.mechanism == no_mechanism) continue;
    possible.emplace_back(text_of_mechanism(w.mechanism).name);
    if (first == nullptr) first = &w;
  }
  if (first != nullptr)
    text = fmt::format("The recording differs from the model by {}. {} could cause it and {} not named: {}.",
                       millivolts(facts.error_v), capitalised(joined(possible, "and")),
                       possible.size() > 1 ? "are" : "is", reason_of(*first, d));
  if (!where.empty()) text += " Most of the difference lies " + where + ".";
  if (d.law) {
    text += fmt::format(" It acts on {}.", name_of_law(*d.law));
    if (d.law->cell)
      return text + fmt::format(
                        " A term learned for it reduces the error on parts of the recordings that were left out from "
                        "{} to {}; the extended cell file has it. Check it on another recording with --holdout.",
                        millivolts(d.law->left_out_before_v), millivolts(d.law->left_out_after_v));
  }
  if (!d.candidates.empty()) {
    const Ranked& nearest = d.candidates.front();
    if (nearest.ids.size() == 1 && nearest.explained_share >= text_style.nearest_explains)
      text += fmt::format(" {} comes nearest and explains {} of it.",
                          capitalised(std::string(text_of_mechanism(nearest.ids.front()).name)),
                          percent(nearest.explained_share));
  }
  return text + " Check the instruments against trusted ones first.";
}

std::string names_of(const std::vector<std::size_t>& mechanisms) {
  std::vector<std::string> names;
  for (const std::size_t m : mechanisms) names.emplace_back(text_of_mechanism(m).name);
  return joined(names, "and");
}

/// What was tried and what was not. No cause is named, and nothing has a probability.
std::string unfinished_text(const Diagnosis& d, const RecordingFacts& facts) {
  std::string text = fmt::format("Stopped before the end of the search, so no cause is named. {}", model_error(facts));
  if (!d.candidates.empty() && !d.candidates.front().ids.empty()) {
    const Ranked& nearest = d.candidates.front();
    text += fmt::format(" So far {} came nearest: {} of the error.", names_of(nearest.ids),
                        percent(nearest.explained_share));
  }
  text += d.tried.empty() ? " No cause was tried." : fmt::format(" Tried: {}.", names_of(d.tried));
  if (!d.not_tried.empty()) text += fmt::format(" Not tried: {}.", names_of(d.not_tried));
  return text + " Run it again to its end.";
}

}  // namespace

const MechanismText& text_of_mechanism(std::size_t mechanism) { return knowledge_of(mechanism).text; }

std::string claim(const MechanismSetting& s) { return knowledge_of(s.index).claim(s); }

std::string statement(const Diagnosis& d, const RecordingFacts& facts) {
  switch (d.verdict) {
    case Verdict::no_mismatch:
      return d.withheld.empty() ? no_mismatch_text(d, facts) : withheld_text(d, model_error(facts));
    case Verdict::cause:
      return cause_text(d, facts) + also_withheld_text(d) + not_compared_text(d);
    case Verdict::ambiguous:
      return ambiguous_text(d, facts) + also_withheld_text(d) + not_compared_text(d);
    case Verdict::causes:
      return causes_text(d, facts) + also_withheld_text(d) + not_compared_text(d);
    case Verdict::unknown:
      return unknown_text(d, facts);
    case Verdict::data_fault:
      return d.faults.empty() ? "The recording is not plausible." : d.faults.front().text;
    case Verdict::not_testable:
      return d.withheld.empty() && !goes_beyond_healthy(d) ? "No diagnosis is possible from this recording."
                                                           : withheld_text(d, model_error(facts));
    case Verdict::unfinished:
      return unfinished_text(d, facts);
  }
  return "";
}

std::string because(const Diagnosis& d, const Finding& f, const RecordingFacts& facts) {
  const MechanismText& own = text_of_mechanism(f.setting.index);
  const std::string mark = capitalised(std::string(own.name)) + " " + std::string(own.mark);
  const auto compared = [&](std::size_t other) {
    return fmt::format("{}; {} {}.{}", mark, text_of_mechanism(other).name, text_of_mechanism(other).mark,
                       relevant_facts(f.setting.index, other, facts));
  };
  if (!f.equivalent_to.empty()) {
    const std::size_t rival = f.equivalent_to.front();
    const bool seen = !relevant_facts(f.setting.index, rival, facts).empty();
    return compared(rival) +
           (seen ? " That is not enough to distinguish them." : " This recording does not distinguish the two.");
  }
  const auto [rival, instead] = rival_of(d, f);
  if (rival == nullptr)
    return fmt::format(
        "{}. No other known mechanism comes near it. Without it the fit is worse by {:.0f}; chance does not reach "
        "{:.0f}.",
        mark, f.gain, thresholds.decision.detected);
  double best = rival->gain, explained = 0;
  for (const Ranked& r : d.candidates) {
    if (r.ids.size() != d.findings.size()) continue;
    const bool all = std::all_of(d.findings.begin(), d.findings.end(), [&](const Finding& g) {
      return std::find(r.ids.begin(), r.ids.end(), g.setting.index) != r.ids.end();
    });
    if (!all) continue;
    best = std::max(best, r.gain);
    explained = r.explained_share;
  }
  return fmt::format(
      "{} The data support the first: its log posterior is larger by {:.1f} (up to {:.1f}: undecided). It explains {} "
      "of the mismatch, the other {}.",
      compared(instead), (best - rival->gain) / 2, thresholds.decision.tie / 2, percent(explained),
      percent(rival->explained_share));
}

std::vector<std::string> at_temperature_text(const Diagnosis& d, const std::vector<ResistanceAt>& resistances) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 6> words = {{
      {"r0_ohm", "R0 of the cell"},
      {"r1_ohm", "R1 of the cell"},
      {"step_ohm", "the resistance one row after a step of the current"},
      {"resistance_ohm", "its resistance"},
      {"added_r0_ohm", "what it adds to R0"},
      {"added_r1_ohm", "what it adds to R1"},
  }};
  std::vector<std::string> parts;
  for (const ResistanceAt& r : resistances) {
    if (!d.resistances || !r.reference) continue;
    const double apart_ohm = std::abs(r.here.ohm - r.reference->ohm);
    if (apart_ohm <= r.here.std_ohm && apart_ohm <= text_style.differs_share * std::abs(r.reference->ohm) &&
        r.reference->std_ohm < text_style.better_times * r.here.std_ohm)
      continue;
    const auto word = std::find_if(words.begin(), words.end(), [&](const auto& w) { return w.first == r.name; });
    parts.push_back(fmt::format("at {:.3g} degrees C {} is {}", d.resistances->temperature_c,
                                word == words.end() ? r.name : word->second,
                                quantity(r.here.ohm, r.here.std_ohm, "ohm")));
    if (r.reference->ohm != 0)
      parts.back() += fmt::format(", at {:.3g} degrees C {}", d.resistances->reference_c,
                                  quantity(r.reference->ohm, r.reference->std_ohm, "ohm"));
  }
  return parts;
}

std::string nothing_more_text(const Diagnosis& d) {
  const auto f = std::find_if(d.findings.begin(), d.findings.end(), [](const Finding& g) { return !g.rivals.empty(); });
  if (f == d.findings.end()) return "";
  std::vector<std::string> others;
  std::string actions(text_of_mechanism(f->setting.index).action);
  for (const std::size_t m : f->equivalent_to) {
    others.emplace_back(text_of_mechanism(m).name);
    if (others.size() < text_style.causes_in_full) actions += fmt::format(" {}", text_of_mechanism(m).action);
  }
  return fmt::format(
      "No other experiment would distinguish {} from {}: nothing more can be learned in this way. Check each directly. "
      "{}",
      text_of_mechanism(f->setting.index).name, joined(others, "and"), actions);
}

void describe(Diagnosis& d, const model::CellParameters<>& cell, const std::vector<PreparedRecording>& records) {
  RecordingFacts facts = recording_facts(cell, records);
  measurement::MeanSquare error;
  for (std::size_t n = 0; n < std::min(records.size(), d.views.size()); ++n) {
    for (std::size_t k = 0; k < d.views[n].base_v.size(); ++k) {
      const double e = records[n].voltage_v[k] - d.views[n].base_v[k];
      if (std::isfinite(e)) error.add(e);
    }
  }
  facts.error_v = error.root();
  if (d.statement.empty()) d.statement = statement(d, facts);
  for (Finding& f : d.findings) {
    if (f.because.empty()) f.because = because(d, f, facts);
  }
}

}  // namespace bms::diagnosis
