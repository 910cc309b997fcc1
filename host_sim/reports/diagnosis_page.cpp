#include "reports/diagnosis_page.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "diagnosis/charge_count.hpp"
#include "diagnosis/texts.hpp"
#include "diagnosis/thresholds.hpp"
#include "identification/goodness_of_fit.hpp"
#include "reports/detectability.hpp"
#include "reports/diagnosis_charts.hpp"
#include "reports/embedded_files.hpp"
#include "reports/law_chart.hpp"
#include "reports/report_page.hpp"
#include "workflow/next_steps.hpp"

namespace bms::reports {

namespace {

using diagnosis::text_of_mechanism;
using model::catalogue;
using nlohmann::json;

constexpr std::size_t strip_bins = 600;  ///< of the strip, over all recordings: the width of a screen
constexpr std::size_t regime_bins = 30;

json rms_mv(const identification::ErrorFigure& error) {
  return error.count() > 0 ? rounded(1e3 * error.rms(), 3) : json(nullptr);
}

json strip_spans(const std::vector<model::Span>& spans) {
  json list = json::array();
  for (const model::Span& s : spans) list.push_back({rounded(s.start_s, 1), rounded(s.end_s, 1)});
  return list;
}

/// SOC over a recording by the extended model; by coulomb counting if there is no extended model.
std::vector<double> soc_of(const workflow::DiagnoseResult& r, std::size_t n) {
  if (n < r.diagnosis.views.size() && r.diagnosis.views[n].soc.size() == r.recordings[n].record.size())
    return r.diagnosis.views[n].soc;
  const diagnosis::PreparedRecording& record = r.recordings[n].record;
  std::vector<double> soc;
  diagnosis::for_each_row(record, r.cell.parameters.capacity_ah,
                          [&](const diagnosis::CountedRow& row) { soc.push_back(row.soc); });
  return soc;
}

/// One recording in bins of time: errors of both models, SOC, current and temperature.
json strip_of(const workflow::DiagnoseResult& r, std::size_t n, std::size_t bins) {
  const workflow::RecordingComparison& c = r.recordings[n];
  const diagnosis::PreparedRecording& record = c.record;
  const std::vector<double> soc = soc_of(r, n);
  const double from_s = record.time_s.front(),
               width_s = std::max(record.duration_s(), 1e-9) / static_cast<double>(bins);
  json strip = {{"name", record.name},        {"from_s", from_s},          {"to_s", record.time_s.back()},
                {"before_mv", json::array()}, {"after_mv", json::array()}, {"soc", json::array()},
                {"low_a", json::array()},     {"high_a", json::array()},   {"temperature_c", json::array()}};
  std::size_t k = 0;
  for (std::size_t b = 0; b < bins; ++b) {
    identification::ErrorFigure before, after;
    double low_a = std::nan(""), high_a = std::nan(""), sum_c = 0;
    std::size_t temperatures = 0;
    const std::size_t first = k;
    for (; k < record.size() && (record.time_s[k] <= from_s + width_s * static_cast<double>(b + 1) || b + 1 == bins);
         ++k) {
      before.add(record.voltage_v[k] - c.base_v[k]);
      after.add(record.voltage_v[k] - c.extended_v[k]);
      low_a = std::fmin(low_a, record.current_a[k]);
      high_a = std::fmax(high_a, record.current_a[k]);
      if (record.temperature_c.empty() || !std::isfinite(record.temperature_c[k])) continue;
      sum_c += record.temperature_c[k];
      ++temperatures;
    }
    strip["before_mv"].push_back(rms_mv(before));
    strip["after_mv"].push_back(rms_mv(after));
    strip["soc"].push_back(k > first ? rounded(100 * soc[k - 1], 2) : json(nullptr));
    strip["low_a"].push_back(rounded(low_a, 4));
    strip["high_a"].push_back(rounded(high_a, 4));
    strip["temperature_c"].push_back(temperatures > 0 ? rounded(sum_c / static_cast<double>(temperatures), 2)
                                                      : json(nullptr));
  }
  if (n == 0) strip["spans"] = strip_spans(r.diagnosis.spans);
  return strip;
}

json strips(const workflow::DiagnoseResult& r) {
  double total_s = 0;
  for (const workflow::RecordingComparison& c : r.recordings) total_s += std::max(c.record.duration_s(), 1.0);
  json list = json::array();
  for (std::size_t n = 0; n < r.recordings.size(); ++n) {
    const double share = std::max(r.recordings[n].record.duration_s(), 1.0) / total_s;
    const auto bins = std::min(r.recordings[n].record.size(),
                               std::max<std::size_t>(20, static_cast<std::size_t>(share * strip_bins)));
    list.push_back(strip_of(r, n, bins));
  }
  return list;
}

json mechanisms(const workflow::DiagnoseResult& r) {
  json list = json::array();
  if (!r.named()) return list;
  const double capacity_ah = r.cell.parameters.capacity_ah;
  for (const diagnosis::Finding& f : r.diagnosis.findings) {
    const model::MechanismInfo& info = catalogue[f.setting.index];
    json parameters = json::array(), rivals = json::array();
    for (std::size_t k = 0; k < info.parameters; ++k) {
      const model::Parameter& p = info.parameter[k];
      parameters.push_back({{"name", p.name},
                            {"text", p.role == model::Role::given && p.unit == "s"
                                         ? diagnosis::duration_text(f.setting.value[k])
                                         : diagnosis::parameter_text(p, f.setting.value[k], f.setting.deviation[k])},
                            {"meaning", p.meaning},
                            {"value", rounded(f.setting.value[k], 9)},
                            {"deviation", rounded(f.setting.deviation[k], 9)},
                            {"low", rounded(p.lower(capacity_ah), 9)},
                            {"high", rounded(p.upper(capacity_ah), 9)},
                            {"strength", p.role == model::Role::strength},
                            {"shape", p.role == model::Role::shape},
                            {"given", p.role == model::Role::given},
                            {"at_bound", k < f.at_bound.size() && f.at_bound[k] != 0}});
    }
    for (const std::size_t m : f.equivalent_to) rivals.push_back(text_of_mechanism(m).name);
    const diagnosis::MechanismText& text = text_of_mechanism(f.setting.index);
    list.push_back({{"id", info.id},
                    {"name", text.name},
                    {"meaning", text.meaning},
                    {"action", text.action},
                    {"because", f.because},
                    {"probability", rounded(f.probability, 3)},
                    {"rms_mv", rounded(1e3 * f.rms_contribution_v, 3)},
                    {"rivals", std::move(rivals)},
                    {"at_temperature", at_temperature_text(r.diagnosis, f.resistances)},
                    {"parameters", std::move(parameters)}});
  }
  return list;
}

/// Name of a candidate. A set that differs from the best in one mechanism is named by it: "leakage for current_offset".
std::string candidate_name(const std::vector<std::size_t>& ids, const std::vector<std::size_t>& best) {
  const auto lacks = [](const std::vector<std::size_t>& set) {
    return [&set](std::size_t m) { return std::find(set.begin(), set.end(), m) == set.end(); };
  };
  if (ids.size() > 1 && ids.size() == best.size() && std::count_if(ids.begin(), ids.end(), lacks(best)) == 1) {
    return fmt::format("{} for {}", catalogue[*std::find_if(ids.begin(), ids.end(), lacks(best))].id,
                       catalogue[*std::find_if(best.begin(), best.end(), lacks(ids))].id);
  }
  if (ids.size() > 1 && ids == best) return fmt::format("all {} found", ids.size());
  std::string name;
  for (const std::size_t m : ids) name += (name.empty() ? "" : " + ") + std::string(catalogue[m].id);
  return name;
}

json candidates(const workflow::DiagnoseResult& r) {
  json list = json::array();
  std::set<std::string> seen;
  for (const diagnosis::Ranked& c : r.diagnosis.candidates) {
    const std::string name = candidate_name(c.ids, r.diagnosis.candidates.front().ids);
    if (!seen.insert(name).second) continue;  // the same set, found from other initial values
    const bool tied =
        std::any_of(r.diagnosis.findings.begin(), r.diagnosis.findings.end(), [&](const diagnosis::Finding& f) {
          return std::find(c.ids.begin(), c.ids.end(), f.setting.index) == c.ids.end() &&
                 std::any_of(f.equivalent_to.begin(), f.equivalent_to.end(),
                             [&](std::size_t m) { return std::find(c.ids.begin(), c.ids.end(), m) != c.ids.end(); });
        });
    list.push_back(
        {{"name", name}, {"gain", rounded(c.gain, 1)}, {"share", rounded(c.explained_share, 3)}, {"tied", tied}});
  }
  return list;
}

json figure(const std::string& name, const std::optional<workflow::OpenLoopFigures>& before,
            const std::optional<workflow::OpenLoopFigures>& after) {
  return {
      {"name", name}, {"before_mv", rounded(1e3 * before->rmse_v, 3)}, {"after_mv", rounded(1e3 * after->rmse_v, 3)}};
}

json figures(const workflow::DiagnoseResult& r) {
  json list = json::array();
  if (r.baseline_holdout && r.extended_holdout)
    list.push_back(figure(r.holdouts.size() == 1 ? "hold-out: " + r.holdouts.front().record.name
                                                 : fmt::format("{} hold-out recordings", r.holdouts.size()),
                          r.baseline_holdout, r.extended_holdout));
  if (r.baseline && r.extended)
    list.push_back(figure(r.recordings.size() == 1 ? "diagnosed: " + r.recordings.front().record.name
                                                   : fmt::format("{} recordings diagnosed", r.recordings.size()),
                          r.baseline, r.extended));
  return list;
}

// ---- errors over an axis: SOC, current, temperature, time since a current step
struct Axis {
  const char *id, *title, *unit;
  bool logarithmic;
};
constexpr Axis axes[] = {{"soc", "State of charge", "%", false},
                         {"current_c", "Current, > 0 charges", "C", false},
                         {"temperature_c", "Temperature", "°C", false},
                         {"since_edge_s", "Time since a step of the current", "s", true}};

/// Position on a logarithmic axis of time; half a second and less is the lowest.
double log_position(double seconds) { return std::log10(std::max(seconds, 0.5)); }

/// All rows of the recordings: the position on the axis (NaN: unknown) and the errors of both models, in V.
struct AxisRows {
  std::vector<double> at, before_v, after_v;
};

AxisRows rows_of(const workflow::DiagnoseResult& r, const Axis& axis) {
  const double capacity_ah = r.cell.parameters.capacity_ah, step_a = 0.1 * capacity_ah;
  const std::string_view id = axis.id;
  AxisRows rows;
  for (std::size_t n = 0; n < r.recordings.size(); ++n) {
    const workflow::RecordingComparison& c = r.recordings[n];
    const std::vector<double> soc = soc_of(r, n);
    double known_a = 0, edge_s = c.record.time_s.front();
    for (std::size_t k = 0; k < c.record.size(); ++k) {
      const double previous_a = known_a;
      if (std::isfinite(c.record.current_a[k])) known_a = c.record.current_a[k];
      if (std::abs(known_a - previous_a) > step_a) edge_s = c.record.time_s[k];
      double x = c.record.time_s[k] - edge_s;
      if (id == "soc")
        x = 100 * soc[k];
      else if (id == "current_c")
        x = known_a / capacity_ah;
      else if (id == "temperature_c")
        x = c.record.temperature_c.empty() ? std::nan("") : c.record.temperature_c[k];
      rows.at.push_back(axis.logarithmic ? log_position(x) : x);
      rows.before_v.push_back(c.record.voltage_v[k] - c.base_v[k]);
      rows.after_v.push_back(c.record.voltage_v[k] - c.extended_v[k]);
    }
  }
  return rows;
}

/// The range of an axis in which the diagnosis found most of the mismatch, on the scale of the picture.
json found_range(const diagnosis::Regime& g, const Axis& axis) {
  const auto place = [&](double x) {
    if (g.axis == "soc") return 100 * x;
    return axis.logarithmic ? log_position(x) : x;
  };
  return {{"from", rounded(place(g.from), 4)},
          {"to", rounded(place(g.to), 4)},
          {"share", rounded(g.share, 3)},
          {"usual", rounded(g.usual, 3)}};
}

/// RMS errors and time in bins from `low` to `high`.
json binned(const workflow::DiagnoseResult& r, const Axis& axis, const AxisRows& rows, double low, double high) {
  std::vector<identification::ErrorFigure> before(regime_bins), after(regime_bins);
  for (std::size_t k = 0; k < rows.at.size(); ++k) {
    if (!std::isfinite(rows.at[k])) continue;
    const auto bin =
        static_cast<std::size_t>(std::min((rows.at[k] - low) / (high - low) * regime_bins, regime_bins - 1.0));
    before[bin].add(rows.before_v[k]);
    after[bin].add(rows.after_v[k]);
  }
  json one = {{"title", axis.title},       {"unit", axis.unit},        {"logarithmic", axis.logarithmic},
              {"low", rounded(low, 4)},    {"high", rounded(high, 4)}, {"before_mv", json::array()},
              {"after_mv", json::array()}, {"time", json::array()}};
  for (std::size_t b = 0; b < regime_bins; ++b) {
    one["before_mv"].push_back(rms_mv(before[b]));
    one["after_mv"].push_back(r.named() ? rms_mv(after[b]) : json(nullptr));
    one["time"].push_back(rounded(static_cast<double>(before[b].count()) / static_cast<double>(rows.at.size()), 4));
  }
  for (const diagnosis::Regime& g : r.diagnosis.regimes) {
    if (g.axis == axis.id) one["found"] = found_range(g, axis);
  }
  return one;
}

/// One picture per axis on which the recordings have a range.
json regimes(const workflow::DiagnoseResult& r) {
  json list = json::array();
  for (const Axis& axis : axes) {
    const AxisRows rows = rows_of(r, axis);
    double low = 1e300, high = -1e300;
    for (const double x : rows.at) {
      if (!std::isfinite(x)) continue;
      low = std::min(low, x);
      high = std::max(high, x);
    }
    if (high - low > 1e-6) list.push_back(binned(r, axis, rows, low, high));
  }
  return list;
}

/// A warning with the file's name instead of its path.
std::string without_folder(const std::string& text, const workflow::DiagnoseResult& r) {
  for (const auto* list : {&r.recordings, &r.holdouts}) {
    for (const workflow::RecordingComparison& c : *list) {
      if (text.starts_with(c.recording.path)) return c.record.name + text.substr(c.recording.path.size());
    }
  }
  return text;
}

}  // namespace

std::string diagnosis_report(const workflow::DiagnoseResult& r) {
  const diagnosis::Diagnosis& d = r.diagnosis;
  std::string files;
  double hours = 0;
  for (const workflow::RecordingComparison& c : r.recordings) {
    files += (files.empty() ? "" : ", ") + c.record.name;
    hours += c.record.duration_s() / 3'600;
  }
  json report = {
      {"verdict", name_of(d.verdict)},
      {"statement", d.statement},
      {"named", r.named()},
      {"subtitle", fmt::format("{} ({:.1f} h), compared with the cell file of {}", files, hours, r.cell.name)}};
  report["warnings"] = json::array();
  for (const measurement::Warning& w : r.warnings) report["warnings"].push_back(without_folder(w.text, r));
  report["notes"] = json::array();
  for (const measurement::Warning& w : r.notes) report["notes"].push_back(without_folder(w.text, r));
  report["holdouts_beyond"] = r.holdouts_beyond;
  report["faults"] = json::array();
  for (const diagnosis::DataFault& f : d.faults) report["faults"].push_back(f.text);
  report["strips"] = strips(r);
  report["mechanisms"] = mechanisms(r);
  report["error_mv"] = r.baseline ? rounded(1e3 * r.baseline->rmse_v, 3) : json(nullptr);
  report["floor_mv"] = rounded(1e3 * d.noise_floor_v, 3);
  report["figures"] = figures(r);
  report["soc"] = r.soc ? json{{"before", rounded(100 * r.soc->baseline_rmse, 3)},
                               {"after", rounded(100 * r.soc->extended_rmse, 3)}}
                        : json(nullptr);
  report["has_holdout"] = !r.holdouts.empty();
  report["candidates"] = candidates(r);
  report["tie"] = diagnosis::thresholds.decision.tie;
  report["detected"] = diagnosis::thresholds.decision.detected;
  report["unexplained"] = {{"rmse_mv", rounded(1e3 * d.unexplained_rmse_v, 3)},
                           {"share", rounded(d.unexplained_share, 4)},
                           {"explained", rounded(d.explained_share, 4)}};
  report["regimes"] = regimes(r);
  report["limits"] = limits_chart(r);
  report["isolability"] = isolability_chart(d);
  report["not_testable"] = json::array();
  for (const diagnosis::NotTestable& n : d.not_testable)
    report["not_testable"].push_back(
        {{"id", catalogue[n.mechanism].id}, {"name", text_of_mechanism(n.mechanism).name}, {"reason", n.reason}});
  report["next"] = workflow::next_steps(r);
  report["charts"] = diagnosis_charts(r);
  report["intervals"] = interval_texts(r);
  report["law"] = law_chart(r);
  const std::string script = std::string(embedded::diagnosis_strip_js) + std::string(embedded::diagnosis_regimes_js) +
                             std::string(embedded::diagnosis_law_js) + std::string(embedded::diagnosis_isolability_js) +
                             std::string(embedded::diagnosis_js);
  return page(embedded::diagnosis_html, script, "bms diagnose",
              in_script(report.dump(-1, ' ', false, json::error_handler_t::replace)));
}

}  // namespace bms::reports
