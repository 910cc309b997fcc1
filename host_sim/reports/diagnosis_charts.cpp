#include "reports/diagnosis_charts.hpp"

#include <algorithm>
#include <cmath>

#include "reports/report_page.hpp"

namespace bms::reports {

namespace {

using nlohmann::json;

constexpr std::size_t chart_rows = 40'000;  ///< of the charts, over all recordings

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
  if (r.named() || r.has_term()) {
    add("extended_v", 4, [&](std::size_t k) { return c.extended_v[k]; });
    add("after_mv", 2, [&](std::size_t k) { return 1e3 * (c.record.voltage_v[k] - c.extended_v[k]); });
  }
  if (holdout || r.holdouts.empty())
    add("half_width_v", 5, [&](std::size_t k) { return diagnosis::half_width_sigmas * c.interval.sigma_v[k]; });
  return chart;
}

}  // namespace

json rounded(double value, int decimals) {
  const double scale = std::pow(10, decimals);
  return std::isfinite(value) ? json(std::round(value * scale) / scale) : json(nullptr);
}

json diagnosis_charts(const workflow::DiagnoseResult& r) {
  json list = json::array();
  const std::size_t most = std::max<std::size_t>(2'000, chart_rows / (r.recordings.size() + r.holdouts.size()));
  for (const workflow::RecordingComparison& c : r.holdouts) list.push_back(chart_of(r, c, true, most));
  for (const workflow::RecordingComparison& c : r.recordings) list.push_back(chart_of(r, c, false, most));
  return list;
}

std::vector<std::string> interval_texts(const workflow::DiagnoseResult& r) {
  std::vector<std::string> texts;
  for (const workflow::RecordingComparison& c : r.holdouts) {
    if (c.interval.coverage.readings() > 0) texts.push_back(sentence_of(c.interval.coverage, c.record.name));
  }
  return texts;
}

}  // namespace bms::reports
