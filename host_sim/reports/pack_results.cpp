#include "reports/pack_results.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "diagnosis/pack/pack_texts.hpp"
#include "reports/json_parts.hpp"
#include "reports/report_page.hpp"

namespace bms::reports {

namespace dp = diagnosis::pack;

namespace {

constexpr std::size_t most_points = 3'000;  // of a chart

/// Counted from 1; null for what all cells share.
Json number_of(const std::optional<std::size_t>& cell) { return cell ? Json(*cell + 1) : Json(nullptr); }

Json cells_of(const dp::PackFinding& f) {
  Json cells = Json::array();
  for (const std::size_t c : f.cells) cells.push_back(c + 1);
  if (f.cells.empty() && f.cell && f.cause != dp::Cause::thermistor) cells.push_back(*f.cell + 1);
  if (f.cause == dp::Cause::sense_wire) cells.push_back(*f.cell + 2);
  return cells;
}

Json mechanism_of(const dp::PackFinding& f) {
  const dp::CauseText& text = dp::text_of(f.cause);
  Json rivals = Json::array();
  for (const dp::Rival& r : f.rivals)
    rivals.push_back(
        {{"id", dp::text_of(r.cause).id}, {"cell", number_of(r.cell)}, {"probability", number(r.probability)}});
  const bool of_sensor = f.cause == dp::Cause::thermistor;
  return {
      {"id", dp::id_of(f)},
      {"cell", of_sensor ? Json(nullptr) : number_of(f.cell)},
      {"cells", cells_of(f)},
      {"sensor", of_sensor ? number_of(f.cell) : Json(nullptr)},
      {"name", text.name},
      {"data_fault", dp::is_of_data(f.cause)},
      {"probability", number(f.probability)},
      {"parameters",
       Json::array(
           {{{"name", text.parameter}, {"value", number(f.value)}, {"std", number(f.sigma)}, {"unit", text.unit}}})},
      {"log_likelihood_gain", number(f.gain)},
      {"could_also_be", std::move(rivals)},
      {"named_after_s", optional(f.after_s)},
      {"sentence", dp::sentence_of(f)},
      {"because", f.because},
      {"meaning", text.meaning},
      {"action", text.action}};
}

Json isolability_of(const dp::Isolability& i) {
  Json ids = Json::array(), added = Json::array();
  for (const dp::Cause c : i.causes) ids.push_back(dp::text_of(c).id);
  for (const auto& s : i.added) added.push_back({{"sensor", s.name}, {"more_pairs", s.pairs}});
  return {{"ids", std::move(ids)}, {"separable", i.separable}, {"added_sensors", std::move(added)}};
}

Json channels_of(const dp::Channels& channels) {
  Json list = Json::array();
  for (std::size_t c = 0; c < channels.cells.size(); ++c) {
    const dp::ChannelState& s = channels.cells[c];
    list.push_back({{"cell", c + 1},
                    {"held_s", optional(s.held_s)},
                    {"unchanged_share", number(s.frozen_share)},
                    {"missing_share", number(s.missing_share)},
                    {"impossible_readings", s.glitches},
                    {"fresh_ohm", number(s.fresh_ohm)},
                    {"stale_ohm", number(s.stale_ohm)}});
  }
  return list;
}

files::PageTable finding_table(const dp::PackDiagnosis& d) {
  files::PageTable table{
      "findings", "Findings", {"where", "what", "size", "probability", "what else", "since", "what to do"}, {}, ""};
  for (const dp::PackFinding& f : d.findings) {
    const dp::CauseText& text = dp::text_of(f.cause);
    const bool shared = f.cause == dp::Cause::shared;
    table.rows.push_back(
        {files::text_cell(shared ? "all cells" : dp::place_of(f)),
         files::text_cell(shared ? dp::id_of(f) : std::string(text.name)),
         files::text_cell(shared ? "" : dp::size_text(f)),
         files::text_cell(fmt::format("{:.0f} %", std::floor(100 * f.probability))),
         files::text_cell(dp::rivals_text(f)), files::text_cell(dp::time_text(f)),
         files::text_cell(shared ? f.because : fmt::format("{} {} {}", f.because, text.meaning, text.action))});
  }
  return table;
}

files::PageTable isolability_table(const dp::PackDiagnosis& d) {
  const dp::Isolability& i = d.isolability;
  files::PageTable table{"isolability", "What this recording can distinguish, for a typical cell", {"present"}, {}, ""};
  for (const dp::Cause c : i.causes) table.head.push_back(std::string(dp::text_of(c).id));
  for (std::size_t a = 0; a < i.causes.size(); ++a) {
    std::vector<files::PageCell> row = {files::text_cell(std::string(dp::text_of(i.causes[a]).id))};
    for (std::size_t b = 0; b < i.causes.size(); ++b) {
      const char* const text = i.separable[a][b] ? "yes" : "no";
      row.push_back(files::text_cell(a == b ? fmt::format("found: {}", text) : text));
    }
    table.rows.push_back(std::move(row));
  }
  for (const auto& s : i.added) table.note += fmt::format("With {}: {} more pairs. ", s.name, s.pairs);
  return table;
}

files::PageTable limit_table(const dp::PackDiagnosis& d) {
  files::PageTable table{"limits", "Smallest size that would be named in a typical cell", {"cause", "size"}, {}, ""};
  for (const dp::PackLimit& l : d.detection_limits) {
    const std::string text = dp::limit_text(l);
    table.rows.push_back(
        {files::text_cell(text.substr(0, text.find(' '))), files::text_cell(text.substr(text.find(' ') + 1))});
  }
  table.note = dp::not_visible_text(d);
  return table;
}

/// Differences to the median of all cells: those with findings, the others as one band.
files::PageChart difference_chart(const workflow::PackResult& r) {
  files::PageChart chart{"Cell voltages minus their median, mV", {}, {}, {}};
  std::vector<std::size_t> shown;
  for (const dp::PackFinding& f : r.diagnosis.findings) {
    if (!f.cell || f.cause == dp::Cause::thermistor) continue;
    for (const std::size_t c : {*f.cell, *f.cell + (f.cause == dp::Cause::sense_wire ? 1U : 0U)}) {
      if (std::find(shown.begin(), shown.end(), c) == shown.end()) shown.push_back(c);
    }
  }
  for (const std::size_t c : shown) chart.labels.push_back(fmt::format("cell {}", c + 1));
  chart.labels.push_back("lowest");
  chart.labels.push_back("highest");
  chart.columns.resize(chart.labels.size());
  const auto& cells = r.recording.cell_voltage_v;
  const std::size_t every = std::max<std::size_t>(1, r.recording.rows() / most_points);
  std::vector<double> row;
  for (std::size_t k = 0; k < r.recording.rows(); k += every) {
    row.clear();
    for (const measurement::Column& c : cells) {
      if (std::isfinite(c[k])) row.push_back(c[k]);
    }
    if (row.empty()) continue;
    std::sort(row.begin(), row.end());
    const double middle = row[row.size() / 2];
    chart.time_s.push_back(r.recording.time_s[k]);
    for (std::size_t n = 0; n < shown.size(); ++n) chart.columns[n].push_back(1e3 * (cells[shown[n]][k] - middle));
    chart.columns[shown.size()].push_back(1e3 * (row.front() - middle));
    chart.columns[shown.size() + 1].push_back(1e3 * (row.back() - middle));
  }
  return chart;
}

files::PageChart current_chart(const workflow::PackResult& r) {
  files::PageChart chart{
      "Current, A, and state of charge of the median cell, %", {"current", "state of charge"}, {}, {{}, {}}};
  const std::size_t every = std::max<std::size_t>(1, r.recording.rows() / most_points);
  for (std::size_t k = 0; k < r.recording.rows(); k += every) {
    chart.time_s.push_back(r.recording.time_s[k]);
    chart.columns[0].push_back(r.recording.current_a[k]);
    chart.columns[1].push_back(100 * r.pack.soc[k]);
  }
  return chart;
}

}  // namespace

std::string json_of(const workflow::PackResult& r) {
  const dp::PackDiagnosis& d = r.diagnosis;
  Json mechanisms = Json::array(), limits = Json::array(), unexplained = Json::array(), reference = Json::array();
  for (const dp::PackFinding& f : d.findings) mechanisms.push_back(mechanism_of(f));
  for (const dp::PackLimit& l : d.detection_limits)
    limits.push_back({{"id", dp::text_of(l.cause).id},
                      {"parameter", dp::text_of(l.cause).parameter},
                      {"value", number(l.value)},
                      {"unit", dp::text_of(l.cause).unit}});
  Json not_visible = Json::array();
  for (const dp::Cause c : d.not_visible) not_visible.push_back(dp::text_of(c).id);
  for (const dp::UnexplainedCell& u : d.unexplained)
    unexplained.push_back({{"cell", u.cell + 1}, {"rms_v", number(u.rms_v)}, {"usual_v", number(u.usual_v)}});
  for (const std::size_t c : d.reference) reference.push_back(c + 1);
  return text_of({{"command", "diagnose"},
                  {"pack", true},
                  {"verdict", diagnosis::name_of(d.verdict)},
                  {"statement", d.statement},
                  {"cells", d.cells},
                  {"sensors", r.recording.cell_temperature_c.size()},
                  {"samples", r.recording.rows()},
                  {"duration_s", number(d.duration_s)},
                  {"mechanisms", std::move(mechanisms)},
                  {"unexplained", std::move(unexplained)},
                  {"shared", r.shared},
                  {"channels", channels_of(d.channels)},
                  {"pack_ohm_per_cell", optional(d.channels.pack_ohm)},
                  {"isolability", isolability_of(d.isolability)},
                  {"detection_limits", std::move(limits)},
                  {"not_visible", std::move(not_visible)},
                  {"reference_cells", std::move(reference)},
                  {"noise_floor_v", number(d.noise_v)},
                  {"soc_column", soc_column_of(r.soc_column)},
                  {"wall_s", r.wall_s},
                  {"warnings", warnings_of(r.warnings)}});
}

std::string pack_report(const workflow::PackResult& r) {
  files::PageContent page{
      fmt::format("Pack: {}", diagnosis::name_of(r.diagnosis.verdict)), r.diagnosis.statement, {}, {}, {}};
  for (const measurement::Warning& w : r.warnings) page.warnings.push_back(w.text);
  if (!r.diagnosis.findings.empty()) page.tables.push_back(finding_table(r.diagnosis));
  page.tables.push_back({"shared",
                         "What all cells share",
                         {"the mean of the cells against the cell file"},
                         {{files::text_cell(r.shared)}},
                         ""});
  page.tables.push_back(isolability_table(r.diagnosis));
  page.tables.push_back(limit_table(r.diagnosis));
  page.charts = {difference_chart(r), current_chart(r)};
  return page_of(page);
}

}  // namespace bms::reports
