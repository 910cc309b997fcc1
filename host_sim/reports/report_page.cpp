#include "reports/report_page.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/text_file.hpp"
#include "replay/capacity_estimate.hpp"
#include "reports/embedded_files.hpp"

namespace bms::reports {

std::vector<std::size_t> shown_rows(const measurement::Recording& r, std::size_t most) {
  std::vector<std::size_t> shown;
  const std::size_t stretch = 6 * r.rows() / most;
  for (std::size_t from = 0; from < r.rows(); from += std::max<std::size_t>(1, stretch)) {
    const std::size_t to = std::min(r.rows(), from + std::max<std::size_t>(1, stretch));
    std::set<std::size_t> picked = {from, to - 1};
    for (const auto* values : {&r.voltage_v, &r.current_a}) {
      if (stretch == 0) break;
      const auto begin = values->begin() + static_cast<std::ptrdiff_t>(from),
                 end = values->begin() + static_cast<std::ptrdiff_t>(to);
      const auto [lowest, highest] = std::minmax_element(begin, end);
      picked.insert(from + static_cast<std::size_t>(lowest - begin));
      picked.insert(from + static_cast<std::size_t>(highest - begin));
    }
    shown.insert(shown.end(), picked.begin(), picked.end());
  }
  return shown;
}

std::string in_script(std::string json) {
  for (std::size_t at = 0; (at = json.find('<', at)) != std::string::npos;)
    json.replace(at, 1, "\\u003c");  // a file name must not close the script element
  return json;
}

namespace {

using nlohmann::json;
using Value = std::function<double(std::size_t)>;

constexpr std::size_t drawn_rows = 20'000;  ///< in each of five charts: a browser draws them in about a second

/// Rounded, because further digits would only make the page larger.
json column(const std::vector<std::size_t>& rows, int decimals, const Value& value) {
  const double scale = std::pow(10, decimals);
  json values = json::array();
  for (const std::size_t k : rows) values.push_back(std::round(value(k) * scale) / scale);  // NaN becomes null
  return values;
}

std::string text_of(const json& page) { return page.dump(-1, ' ', false, json::error_handler_t::replace); }

std::string percent(double fraction) { return fmt::format("{:.2f} %", 100 * fraction); }
std::string file_name(const replay::ReplayResult& r) {
  return r.recording.path.substr(r.recording.path.rfind('/') + 1);
}
std::string millivolts(double v) { return fmt::format("{:.2f} mV", 1e3 * v); }

json figures(const replay::ReplayResult& r) {
  json f = json::array();
  const auto group = [&](const char* name) { f.push_back(json::array({name})); };
  const auto row = [&](const char* name, const std::string& value) { f.push_back(json::array({name, value})); };
  const auto percent_row = [&](const char* name, const std::optional<double>& value) {
    if (value) row(name, percent(*value));
  };
  group("State of charge");
  row("at the end", percent(r.soc.final));
  row("its standard deviation", percent(r.soc.final_sigma));
  percent_row("RMS error against the reference", r.soc.rmse);
  percent_row("largest error", r.soc.max_error);
  percent_row("RMS error after 30 minutes", r.soc.rmse_after_30min);
  percent_row("largest error after 30 minutes", r.soc.max_error_after_30min);
  percent_row("samples with the reference within two sigma", r.soc.within_2_sigma);
  if (r.soc.current_offset_a)
    row("offset of the current sensor at the end",
        fmt::format("{:+.0f} +- {:.0f} mA", 1e3 * *r.soc.current_offset_a, 1e3 * *r.soc.current_offset_sigma_a));
  group("Voltage");
  const replay::VoltageFigures& v = r.voltage;
  if (v.prediction_rmse_v) row("one-step prediction, RMS", millivolts(*v.prediction_rmse_v));
  if (v.prediction_max_v) row("one-step prediction, largest", millivolts(*v.prediction_max_v));
  if (v.open_loop_rmse_v) row("open loop, RMS", millivolts(*v.open_loop_rmse_v));
  if (v.open_loop_fit_percent) row("open loop, fit (Eq. A6)", fmt::format("{:.2f} %", *v.open_loop_fit_percent));
  group("Run");
  row("recording", file_name(r));
  row("cell", r.cell.name);
  row("samples", fmt::format("{}", r.track.rows.size()));
  row("duration", fmt::format("{:.2f} h", r.recording.duration_s() / 3600));
  row("computed by", r.target == "host" ? "this computer" : "emulated " + r.target);
  row("arithmetic", replay::name_of(r.scalar));
  if (r.verified_against) row("bit-identical on", *r.verified_against);
  return f;
}

std::string data(const replay::ReplayResult& r) {
  const auto rows = shown_rows(r.recording, drawn_rows);
  const auto& e = r.track.rows;
  const measurement::Recording& rec = r.recording;
  json page = {{"title", "State of charge over " + file_name(r)},
               {"statement", statement(r)},
               {"warnings", json::array()},
               {"figures", figures(r)}};
  for (const measurement::Warning& w : rec.warnings) page["warnings"].push_back(w.text);
  if (r.soc_column) {
    for (const measurement::SocEvent& event : r.soc_column->events)
      page["marks"].push_back({(event.time_s - rec.time_s.front()) / 3'600, measurement::name_of(event.fault)});
  }
  json& columns = page["columns"];
  const auto add = [&](const char* name, int decimals, const Value& value) {
    columns[name] = column(rows, decimals, value);
  };
  add("time_s", 3, [&](std::size_t k) { return rec.time_s[k] - rec.time_s.front(); });
  add("current_a", 3, [&](std::size_t k) { return rec.current_a[k]; });
  add("voltage_v", 4, [&](std::size_t k) { return rec.voltage_v[k]; });
  add("predicted_v", 4, [&](std::size_t k) { return e[k].voltage_predicted_v; });
  add("open_loop_v", 4, [&](std::size_t k) { return r.open_loop_v[k]; });
  add("innovation_mv", 2, [&](std::size_t k) { return 1e3 * (rec.voltage_v[k] - e[k].voltage_predicted_v); });
  add("soc", 5, [&](std::size_t k) { return e[k].soc; });
  add("two_sigma", 5, [&](std::size_t k) { return 2 * e[k].soc_sigma; });
  if (!rec.soc_ref.empty()) add("soc_ref", 5, [&](std::size_t k) { return rec.soc_ref[k]; });
  return in_script(text_of(page));
}

/// The page with each @NAME@ replaced by its content.
std::string filled(std::string_view page, const std::function<std::string(std::string_view)>& content) {
  std::string out;
  while (true) {
    const std::size_t begin = page.find('@');
    const std::size_t end = begin == std::string_view::npos ? begin : page.find('@', begin + 1);
    if (end == std::string_view::npos) break;
    out += page.substr(0, begin);
    out += content(page.substr(begin + 1, end - begin - 1));
    page.remove_prefix(end + 1);
  }
  return out += page;
}

/// Says first that the result is not reliable, and why.
std::string doubtful(const replay::ReplayResult& r) {
  if (r.doubts.empty()) return "";
  std::string reasons;
  for (const std::string& doubt : r.doubts) reasons += (reasons.empty() ? "" : "; ") + doubt;
  return fmt::format("The result is not reliable: {}. ", reasons);
}

}  // namespace

std::string statement(const replay::ReplayResult& r) {
  std::string text = doubtful(r);
  text += fmt::format("After {:.1f} hours the battery is at {:.1f} % (standard deviation {:.1f} %).",
                      r.recording.duration_s() / 3600, 100 * r.soc.final, 100 * r.soc.final_sigma);
  if (!r.track.rows.empty() && (r.track.rows.back().flags & estimator::soc_ambiguous) != 0)
    text += " More than one state of charge still fits the voltages.";
  const double first_s = r.recording.time_s.empty() ? 0 : r.recording.time_s.front();
  if (r.soc_column && !r.soc_column->is_count)
    text += " " + measurement::sentence_of(
                      *r.soc_column, first_s,
                      replay::capacity_differs(r) ? r.capacity->value_ah : r.cell.parameters.capacity_ah);
  constexpr std::size_t most_reasons = 3;
  for (std::size_t k = 0; k < std::min(most_reasons, r.reasons.size()); ++k) text += " " + r.reasons[k];
  if (r.soc.rmse) {
    text += fmt::format(
        " Its error against the reference was {:.2f} % RMS, {:.2f} % at most; the reference is within two sigma for "
        "{:.0f} % of the samples.",
        100 * *r.soc.rmse, 100 * *r.soc.max_error, 100 * *r.soc.within_2_sigma);
  }
  if (r.soc.current_offset_a && std::abs(*r.soc.current_offset_a) > 2 * *r.soc.current_offset_sigma_a) {
    text += fmt::format(" The current sensor seems to read {} by {:.0f} mA (standard deviation {:.0f} mA).",
                        *r.soc.current_offset_a < 0 ? "low" : "high", 1e3 * std::abs(*r.soc.current_offset_a),
                        1e3 * *r.soc.current_offset_sigma_a);
  }
  if (r.verified_against) {
    text += fmt::format(" {} computed bit-identical estimates.", *r.verified_against == "log"
                                                                     ? std::string("The firmware that wrote the log")
                                                                     : "The emulated " + *r.verified_against);
  }
  return text;
}

std::string in_markup(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

namespace {

constexpr std::string_view script_begin = "<script>", script_end = "</script>", policy_place = "@POLICY@";

/// Allows the scripts of the page, by their hashes; styles, because charts set them; and nothing else.
std::string policy_for(std::string_view page, Connections connections) {
  std::string policy = "default-src 'none'; script-src";
  for (std::size_t at = 0; (at = page.find(script_begin, at)) != std::string_view::npos;) {
    at += script_begin.size();
    const std::size_t end = page.find(script_end, at);
    policy += " 'sha256-" + files::sha256_base64(page.substr(at, end - at)) + "'";
    at = end;
  }
  policy += "; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";
  if (connections == Connections::own_server) policy += "; connect-src 'self'";
  return policy;
}

}  // namespace

std::string page(std::string_view body, std::string_view script, std::string_view title, const std::string& data,
                 Connections connections) {
  std::string text = filled(embedded::page_html, [&](std::string_view place) -> std::string {
    if (place == "POLICY") return std::string(policy_place);
    if (place == "TITLE") return in_markup(title);
    if (place == "BODY") return std::string(body);
    if (place == "DYGRAPH_CSS") return std::string(embedded::dygraph_css);
    if (place == "DYGRAPH_JS") return std::string(embedded::dygraph_js);
    if (place == "SYNCHRONIZER_JS") return std::string(embedded::synchronizer_js);
    if (place == "DRAWING_JS") return std::string(embedded::drawing_js);
    if (place == "PAGE_CSS") return std::string(embedded::page_css);
    if (place == "PAGE_JS") return std::string(script);
    if (place == "DATA") return data;
    return "";
  });
  const std::string policy = policy_for(text, connections);
  return text.replace(text.find(policy_place), policy_place.size(), policy);  // its first place is in the head
}

std::string policy_in(std::string_view page) {
  constexpr std::string_view before = "http-equiv=\"Content-Security-Policy\" content=\"";
  const std::size_t begin = page.find(before) + before.size();
  return std::string(page.substr(begin, page.find('"', begin) - begin));
}

namespace {

/// Of the value from the paper's number: points of percent, or a part of it.
std::string difference_of(const files::PageCell& c) {
  if (!c.value || !std::isfinite(*c.value)) return "";
  if (c.text.find('%') != std::string::npos) return fmt::format(" ({:+.1f} points)", *c.value - *c.paper);
  return *c.paper != 0 ? fmt::format(" ({:+.0f} %)", 100 * (*c.value / *c.paper - 1)) : "";
}

json table_of(const files::PageTable& t) {
  json rows = json::array();
  for (const auto& row : t.rows) {
    json cells = json::array();
    for (const files::PageCell& c : row) {
      json cell = {{"text", c.text}};
      if (c.paper) cell["paper"] = fmt::format("{:g}{}", *c.paper, difference_of(c));
      cells.push_back(std::move(cell));
    }
    rows.push_back(std::move(cells));
  }
  return {{"title", t.title}, {"note", t.note}, {"table", {{"head", t.head}, {"rows", std::move(rows)}}}};
}

double short_number(double value) { return std::round(value * 1e5) / 1e5; }

/// A value, or [low, middle, high] in a chart with bands.
json point_of(const files::PageChart& c, std::size_t column, std::size_t k) {
  const auto& values = c.columns[column];
  const bool missing = k >= values.size() || !std::isfinite(values[k]);
  if (c.half_band.empty()) return missing ? json(nullptr) : json(short_number(values[k]));
  if (missing) return json::array({nullptr, nullptr, nullptr});
  const double half = k < c.half_band[column].size() ? c.half_band[column][k] : 0;
  return json::array({short_number(values[k] - half), short_number(values[k]), short_number(values[k] + half)});
}

json chart_of(const files::PageChart& c) {
  json rows = json::array();
  const std::size_t every = std::max<std::size_t>(1, c.time_s.size() / 8'000);
  const bool time = c.x_title.empty();
  for (std::size_t k = 0; k < c.time_s.size(); k += every) {
    json row = json::array({time ? (c.time_s[k] - c.time_s.front()) / 3'600 : c.time_s[k]});
    for (std::size_t column = 0; column < c.columns.size(); ++column) row.push_back(point_of(c, column, k));
    rows.push_back(std::move(row));
  }
  json chart = {{"labels", c.labels}, {"rows", std::move(rows)}, {"bands", !c.half_band.empty()}};
  if (!time) chart["x"] = c.x_title;
  if (!c.right.empty()) chart["right"] = c.right;
  return {{"title", c.title}, {"chart", std::move(chart)}};
}

}  // namespace

std::string replay_report(const replay::ReplayResult& r) {
  return page(embedded::replay_html, embedded::replay_js, "bms replay", data(r));
}

namespace {

std::string content_page(const files::PageContent& p, bool charts_first) {
  json content = {
      {"title", p.title}, {"statement", p.statement}, {"warnings", p.warnings}, {"sections", json::array()}};
  json &sections = content["sections"], charts = json::array();
  for (const files::PageChart& c : p.charts) charts.push_back(chart_of(c));
  for (const files::PageTable& t : p.tables) sections.push_back(table_of(t));
  sections.insert(charts_first ? sections.begin() : sections.end(), charts.begin(), charts.end());
  return page(embedded::study_html, embedded::study_js, p.title, in_script(text_of(content)));
}

}  // namespace

std::string page_of(const files::PageContent& p) { return content_page(p, false); }

std::string page_with_charts_first(const files::PageContent& p) { return content_page(p, true); }

}  // namespace bms::reports
