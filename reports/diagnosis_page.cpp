#include "reports/diagnosis_page.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "diagnosis/decision.hpp"
#include "diagnosis/texts.hpp"
#include "identification/goodness_of_fit.hpp"
#include "reports/embedded_files.hpp"
#include "reports/report_page.hpp"

namespace bms::reports {

namespace {

using diagnosis::text_of_mechanism;
using model::catalogue;
using nlohmann::json;

constexpr std::size_t strip_bins = 600;     ///< over all recordings: a screen's width of the strip
constexpr std::size_t chart_rows = 40'000;  ///< the same of the charts
constexpr std::size_t regime_bins = 30;

json rounded(double value, int decimals) {
  const double scale = std::pow(10, decimals);
  return std::isfinite(value) ? json(std::round(value * scale) / scale) : json(nullptr);
}

json spans_of(const std::vector<model::Span>& spans) {
  json list = json::array();
  for (const model::Span& s : spans) list.push_back({rounded(s.start_s, 1), rounded(s.end_s, 1)});
  return list;
}

/// soc over a recording as the extended model has it; counted from the start where there is none.
std::vector<double> soc_of(const workflow::DiagnoseResult& r, std::size_t n) {
  if (n < r.diagnosis.views.size() && r.diagnosis.views[n].soc.size() == r.recordings[n].record.size())
    return r.diagnosis.views[n].soc;
  const diagnosis::PreparedRecording& record = r.recordings[n].record;
  std::vector<double> soc(record.size());
  double at = record.initial_soc, known_a = 0;
  for (std::size_t k = 0; k < soc.size(); ++k) {
    if (std::isfinite(record.current_a[k])) known_a = record.current_a[k];
    if (k > 0) at += known_a * (record.time_s[k] - record.time_s[k - 1]) / (3'600 * r.cell.parameters.capacity_ah);
    soc[k] = at;
  }
  return soc;
}

/// One recording in bins of time: how far both models are off, and what was going on.
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
    std::size_t warm = 0;
    const std::size_t first = k;
    for (; k < record.size() && (record.time_s[k] <= from_s + width_s * static_cast<double>(b + 1) || b + 1 == bins);
         ++k) {
      before.add(record.voltage_v[k] - c.base_v[k]);
      after.add(record.voltage_v[k] - c.extended_v[k]);
      low_a = std::fmin(low_a, record.current_a[k]);
      high_a = std::fmax(high_a, record.current_a[k]);
      if (!record.temperature_c.empty() && std::isfinite(record.temperature_c[k]))
        sum_c += record.temperature_c[k], ++warm;
    }
    strip["before_mv"].push_back(before.count() > 0 ? rounded(1e3 * before.rms(), 3) : json(nullptr));
    strip["after_mv"].push_back(after.count() > 0 ? rounded(1e3 * after.rms(), 3) : json(nullptr));
    strip["soc"].push_back(k > first ? rounded(100 * soc[k - 1], 2) : json(nullptr));
    strip["low_a"].push_back(rounded(low_a, 4));
    strip["high_a"].push_back(rounded(high_a, 4));
    strip["temperature_c"].push_back(warm > 0 ? rounded(sum_c / static_cast<double>(warm), 2) : json(nullptr));
  }
  if (n == 0) strip["spans"] = spans_of(r.diagnosis.spans);
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
    const diagnosis::MechanismText& words = text_of_mechanism(f.setting.index);
    list.push_back({{"id", info.id},
                    {"name", words.name},
                    {"meaning", words.meaning},
                    {"action", words.action},
                    {"because", f.because},
                    {"probability", rounded(f.probability, 3)},
                    {"rms_mv", rounded(1e3 * f.rms_contribution_v, 3)},
                    {"rivals", std::move(rivals)},
                    {"parameters", std::move(parameters)}});
  }
  return list;
}

/// Of a set that differs from the best in one mechanism only that: "leakage for current_offset".
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
    if (!seen.insert(name).second) continue;  // the same from another start
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
    list.push_back(figure(r.holdouts.size() == 1 ? "not used: " + r.holdouts.front().record.name
                                                 : fmt::format("{} recordings not used", r.holdouts.size()),
                          r.baseline_holdout, r.extended_holdout));
  if (r.baseline && r.extended)
    list.push_back(figure(r.recordings.size() == 1 ? "diagnosed: " + r.recordings.front().record.name
                                                   : fmt::format("{} recordings diagnosed", r.recordings.size()),
                          r.baseline, r.extended));
  return list;
}

json chart_of(const workflow::DiagnoseResult& r, const workflow::RecordingComparison& c, bool holdout,
              std::size_t most) {
  json chart = {{"name", c.record.name}, {"holdout", holdout}};
  const auto rows = shown_rows(c.recording, most);
  const auto add = [&](const char* name, int decimals, auto&& value) {
    json column = json::array();
    for (const std::size_t k : rows) column.push_back(rounded(value(k), decimals));
    chart[name] = std::move(column);
  };
  add("time_s", 3, [&](std::size_t k) { return c.record.time_s[k] - c.record.time_s.front(); });
  add("measured_v", 4, [&](std::size_t k) { return c.record.voltage_v[k]; });
  add("base_v", 4, [&](std::size_t k) { return c.base_v[k]; });
  add("before_mv", 2, [&](std::size_t k) { return 1e3 * (c.record.voltage_v[k] - c.base_v[k]); });
  if (r.named()) {
    add("extended_v", 4, [&](std::size_t k) { return c.extended_v[k]; });
    add("after_mv", 2, [&](std::size_t k) { return 1e3 * (c.record.voltage_v[k] - c.extended_v[k]); });
  }
  return chart;
}

json charts(const workflow::DiagnoseResult& r) {
  json list = json::array();
  const std::size_t most = std::max<std::size_t>(2'000, chart_rows / (r.recordings.size() + r.holdouts.size()));
  for (const workflow::RecordingComparison& c : r.holdouts) list.push_back(chart_of(r, c, true, most));
  for (const workflow::RecordingComparison& c : r.recordings) list.push_back(chart_of(r, c, false, most));
  return list;
}

/// How far the cell file is off over one axis, and how long the recordings were there.
struct Axis {
  const char *id, *title, *unit;
  bool logarithmic;
};

json regimes(const workflow::DiagnoseResult& r) {
  constexpr Axis axes[] = {{"soc", "State of charge", "%", false},
                           {"current_c", "Current, charging to the right", "C", false},
                           {"temperature_c", "Temperature", "degrees C", false},
                           {"since_edge_s", "Time since a step of the current", "s", true}};
  const double capacity_ah = r.cell.parameters.capacity_ah;
  json list = json::array();
  for (const Axis& axis : axes) {
    std::vector<double> at, before, after;
    for (std::size_t n = 0; n < r.recordings.size(); ++n) {
      const workflow::RecordingComparison& c = r.recordings[n];
      const std::vector<double> soc = soc_of(r, n);
      double known_a = 0, edge_s = c.record.time_s.front();
      for (std::size_t k = 0; k < c.record.size(); ++k) {
        const double previous_a = known_a;
        if (std::isfinite(c.record.current_a[k])) known_a = c.record.current_a[k];
        if (std::abs(known_a - previous_a) > 0.1 * capacity_ah) edge_s = c.record.time_s[k];
        const std::string_view id = axis.id;
        double x = c.record.time_s[k] - edge_s;
        if (id == "soc")
          x = 100 * soc[k];
        else if (id == "current_c")
          x = known_a / capacity_ah;
        else if (id == "temperature_c")
          x = c.record.temperature_c.empty() ? std::nan("") : c.record.temperature_c[k];
        if (axis.logarithmic) x = std::log10(std::max(x, 0.5));
        at.push_back(x);
        before.push_back(c.record.voltage_v[k] - c.base_v[k]);
        after.push_back(c.record.voltage_v[k] - c.extended_v[k]);
      }
    }
    double low = 1e300, high = -1e300;
    for (const double x : at) {
      if (std::isfinite(x)) low = std::min(low, x), high = std::max(high, x);
    }
    if (!(high - low > 1e-6)) continue;
    std::vector<identification::ErrorFigure> error_before(regime_bins), error_after(regime_bins);
    for (std::size_t k = 0; k < at.size(); ++k) {
      if (!std::isfinite(at[k])) continue;
      const auto bin =
          static_cast<std::size_t>(std::min((at[k] - low) / (high - low) * regime_bins, regime_bins - 1.0));
      error_before[bin].add(before[k]);
      error_after[bin].add(after[k]);
    }
    json one = {{"title", axis.title},       {"unit", axis.unit},        {"logarithmic", axis.logarithmic},
                {"low", rounded(low, 4)},    {"high", rounded(high, 4)}, {"before_mv", json::array()},
                {"after_mv", json::array()}, {"time", json::array()}};
    for (std::size_t b = 0; b < regime_bins; ++b) {
      one["before_mv"].push_back(error_before[b].count() > 0 ? rounded(1e3 * error_before[b].rms(), 3) : json(nullptr));
      one["after_mv"].push_back(r.named() && error_after[b].count() > 0 ? rounded(1e3 * error_after[b].rms(), 3)
                                                                        : json(nullptr));
      one["time"].push_back(rounded(static_cast<double>(error_before[b].count()) / static_cast<double>(at.size()), 4));
    }
    for (const diagnosis::Regime& g : r.diagnosis.regimes) {
      if (g.axis != axis.id) continue;
      const auto place = [&](double x) {
        return g.axis == "soc" ? 100 * x : axis.logarithmic ? std::log10(std::max(x, 0.5)) : x;
      };
      one["found"] = {{"from", rounded(place(g.from), 4)},
                      {"to", rounded(place(g.to), 4)},
                      {"share", rounded(g.share, 3)},
                      {"usual", rounded(g.usual, 3)}};
    }
    list.push_back(std::move(one));
  }
  return list;
}

json limits(const workflow::DiagnoseResult& r) {
  json list = json::array();
  for (const diagnosis::DetectionLimit& l : r.diagnosis.limits) {
    const model::MechanismInfo& info = catalogue[l.mechanism];
    const model::Parameter& p = info.parameter[l.parameter];
    list.push_back({{"id", info.id},
                    {"name", text_of_mechanism(l.mechanism).name},
                    {"text", diagnosis::parameter_text(p, l.value, 0)},
                    {"ratio", rounded(l.value / p.upper(r.cell.parameters.capacity_ah), 7)}});
  }
  std::stable_sort(list.begin(), list.end(), [](const json& a, const json& b) { return a["ratio"] < b["ratio"]; });
  return list;
}

/// A warning with the file's name in place of its path.
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
  json report = {{"verdict", name_of(d.verdict)},
                 {"statement", d.statement},
                 {"named", r.named()},
                 {"subtitle", fmt::format("{} ({:.1f} h) against the cell file of {}", files, hours, r.cell.name)}};
  report["warnings"] = json::array();
  for (const files::Warning& w : r.warnings) report["warnings"].push_back(without_folder(w.text, r));
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
  report["tie"] = diagnosis::decision::same;
  report["detected"] = diagnosis::decision::detected;
  report["remains"] = {{"rmse_mv", rounded(1e3 * d.unexplained_rmse_v, 3)},
                       {"share", rounded(d.unexplained_share, 4)},
                       {"explained", rounded(d.explained_share, 4)}};
  report["regimes"] = regimes(r);
  report["limits"] = limits(r);
  report["not_testable"] = json::array();
  for (const diagnosis::NotTestable& n : d.not_testable)
    report["not_testable"].push_back(
        {{"id", catalogue[n.mechanism].id}, {"name", text_of_mechanism(n.mechanism).name}, {"reason", n.reason}});
  report["next"] = r.next ? json{{"why", diagnosis::why(*r.next)},
                                 {"instruction", diagnosis::instruction(*r.next)},
                                 {"command", diagnosis::command(*r.next)}}
                          : json(nullptr);
  report["charts"] = charts(r);
  return page(embedded::diagnosis_html, embedded::diagnosis_js, "bms diagnose",
              in_script(report.dump(-1, ' ', false, json::error_handler_t::replace)));
}

}  // namespace bms::reports
