#include "reports/fleet_page.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "reports/embedded_files.hpp"
#include "reports/fleet_texts.hpp"
#include "reports/json_parts.hpp"
#include "reports/report_page.hpp"

namespace bms::reports {

namespace {

using fleet::Analysis;
using fleet::History;
using fleet::Issue;

Json visit_of(const History& history, const Issue& issue) {
  const CauseText cause = cause_text(issue.cause);
  const fleet::Entry& shown = history.cells[issue.cell].entries[issue.entry];
  return {{"where", place_of(issue.truck, issue.cell_index)},
          {"what", cause.name},
          {"why", why(history, issue)},
          {"meaning", cause.meaning},
          {"action", cause.action},
          {"cell", issue.cell},
          {"page", shown.page},
          {"recording", shown.recording.substr(shown.recording.rfind('/') + 1)}};
}

Json forecasts_of(const History& history, const Analysis& analysis) {
  struct Forecast {
    double day;
    Json row;
  };
  std::vector<Forecast> forecasts;
  for (std::size_t c = 0; c < history.cells.size(); ++c) {
    const fleet::CellTrends& t = analysis.trends[c];
    const auto add = [&](const char* what, const fleet::Course& course) {
      if (!course.crossing) return;
      const fleet::Trend& trend = *course.trend;
      forecasts.push_back({course.crossing->day,
                           {{"cell", c},
                            {"what", what},
                            {"now", 100 * trend.level},
                            {"now_sigma", 100 * trend.level_sigma},
                            {"per_month", 3'000 * trend.per_day},
                            {"per_month_sigma", 3'000 * trend.per_day_sigma},
                            {"when", crossing_text(history, *course.crossing)}}});
    };
    add("resistance, growth", t.resistance);
    add("capacity, loss", t.capacity);
  }
  std::stable_sort(forecasts.begin(), forecasts.end(), [](const auto& a, const auto& b) { return a.day < b.day; });
  Json list = Json::array();
  for (Forecast& f : forecasts) list.push_back(std::move(f.row));
  return list;
}

/// Numbers texts in the order in which they first occur.
class Numbered {
 public:
  std::size_t number_of(const std::string& text) {
    const auto [at, added] = numbers_.try_emplace(text, numbers_.size());
    if (added) texts_.push_back(text);
    return at->second;
  }
  const Json& texts() const { return texts_; }

 private:
  std::map<std::string, std::size_t> numbers_;
  Json texts_ = Json::array();
};

std::string found_text(const fleet::Entry& e) {
  if (!e.error.empty()) return reason_of(e);
  std::string text;
  for (const fleet::Named& n : e.named) text += (text.empty() ? "" : ", ") + n.mechanism;
  return text;
}

/// Per mille, rounded: a page of 24,000 recordings must stay small.
Json per_mille(const std::optional<fleet::Strength>& s, double fleet::Strength::*part) {
  return s && std::isfinite((*s).*part) ? Json(std::round(1e4 * (*s).*part) / 10) : Json(nullptr);
}

/// One array per column.
Json recordings_of(const History& history) {
  Numbered verdicts, found;
  Json table = {{"cell", Json::array()},  {"day", Json::array()},  {"verdict", Json::array()},
                {"found", Json::array()}, {"page", Json::array()}, {"r", Json::array()},
                {"rs", Json::array()},    {"q", Json::array()},    {"qs", Json::array()}};
  for (std::size_t c = 0; c < history.cells.size(); ++c) {
    for (const fleet::Entry& e : history.cells[c].entries) {
      table["cell"].push_back(c);
      table["day"].push_back(std::round(100 * e.day) / 100);
      table["verdict"].push_back(verdicts.number_of(e.error.empty() ? e.verdict : "ERROR"));
      table["found"].push_back(found.number_of(found_text(e)));
      table["page"].push_back(e.page.substr(e.page.rfind('/') + 1));
      table["r"].push_back(per_mille(e.resistance, &fleet::Strength::value));
      table["rs"].push_back(per_mille(e.resistance, &fleet::Strength::sigma));
      table["q"].push_back(per_mille(e.capacity, &fleet::Strength::value));
      table["qs"].push_back(per_mille(e.capacity, &fleet::Strength::sigma));
    }
  }
  table["verdicts"] = verdicts.texts();
  table["texts"] = found.texts();
  return table;
}

std::string headline(const History& history, const Analysis& analysis) {
  const auto confirmed =
      std::count_if(analysis.issues.begin(), analysis.issues.end(), [](const Issue& issue) { return issue.confirmed; });
  std::string text = confirmed == 0 ? "No battery needs a visit."
                                    : fmt::format("{} {} a visit. First: {}.", confirmed,
                                                  confirmed == 1 ? "place needs" : "places need",
                                                  statement(history, analysis.issues.front()));
  return text + fmt::format(" {} recordings of {} cells in {} trucks; {} could not be read.", history.recordings,
                            history.cells.size(), analysis.trucks, analysis.errors);
}

Json trend_json(const std::optional<fleet::Trend>& t) {
  if (!t) return nullptr;
  return {{"value", number(t->level)},
          {"std", number(t->level_sigma)},
          {"per_day", number(t->per_day)},
          {"per_day_std", number(t->per_day_sigma)}};
}

Json crossing_json(const History& history, const std::optional<fleet::Crossing>& c) {
  if (!c) return nullptr;
  return {{"day", date_of(history, c->day)},
          {"earliest", date_of(history, c->earliest)},
          {"latest", c->latest ? Json(date_of(history, *c->latest)) : Json(nullptr)}};
}

}  // namespace

std::string fleet_report(const History& history, const Analysis& analysis, const fleet::AnalysisOptions& options,
                         const std::string& to_depot) {
  Json page_data = {{"title", "What to visit first"},
                    {"statement", headline(history, analysis)},
                    {"to_depot", to_depot},
                    {"dated", history.first_day_s.has_value()},
                    {"first_day_s", history.first_day_s.value_or(0)},
                    {"visits", Json::array()},
                    {"watch", Json::array()},
                    {"cells", Json::array()}};
  for (const Issue& issue : analysis.issues)
    page_data[issue.confirmed ? "visits" : "watch"].push_back(visit_of(history, issue));
  for (const fleet::CellHistory& cell : history.cells) page_data["cells"].push_back({cell.truck, cell.cell_index});
  page_data["forecasts"] = forecasts_of(history, analysis);
  page_data["limits"] = limit_sentences(history, analysis, options);
  page_data["recordings"] = recordings_of(history);
  return page(embedded::fleet_html, embedded::fleet_js, "bms fleet",
              in_script(page_data.dump(-1, ' ', false, Json::error_handler_t::replace)));
}

std::string json_of(const History& history, const Analysis& analysis, const fleet::AnalysisOptions& options) {
  Json json = {{"command", "fleet report"},     {"recordings", history.recordings}, {"errors", analysis.errors},
               {"cells", history.cells.size()}, {"trucks", analysis.trucks},        {"issues", Json::array()}};
  for (const Issue& i : analysis.issues) {
    json["issues"].push_back({{"truck", i.truck},
                              {"cell", i.cell_index.empty() ? Json(nullptr) : Json(i.cell_index)},
                              {"cause", i.cause},
                              {"also", i.also},
                              {"confirmed", i.confirmed},
                              {"seen", i.seen},
                              {"of", i.of},
                              {"onset", i.onset_day ? Json(date_of(history, *i.onset_day)) : Json(nullptr)},
                              {"p_value", number(i.p_value)},
                              {"false_discovery_rate", number(i.rate)},
                              {"value", i.size ? number(i.size->value) : Json(nullptr)},
                              {"std", i.size ? number(i.size->sigma) : Json(nullptr)},
                              {"unit", i.unit},
                              {"per_day", i.per_day ? number(*i.per_day) : Json(nullptr)},
                              {"recording", history.cells[i.cell].entries[i.entry].recording},
                              {"statement", statement(history, i)}});
  }
  json["ageing"] = Json::array();
  for (std::size_t c = 0; c < history.cells.size(); ++c) {
    const fleet::CellTrends& t = analysis.trends[c];
    json["ageing"].push_back({{"truck", history.cells[c].truck},
                              {"cell", history.cells[c].cell_index},
                              {"resistance_growth", trend_json(t.resistance.trend)},
                              {"resistance_limit", crossing_json(history, t.resistance.crossing)},
                              {"capacity_loss", trend_json(t.capacity.trend)},
                              {"capacity_limit", crossing_json(history, t.capacity.crossing)}});
  }
  json["limits"] = limit_sentences(history, analysis, options);
  json["unreadable"] = Json::array();
  for (const fleet::CellHistory& cell : history.cells) {
    for (const fleet::Entry& e : cell.entries)
      if (!e.error.empty()) json["unreadable"].push_back({{"recording", e.recording}, {"reason", reason_of(e)}});
  }
  return text_of(json);
}

}  // namespace bms::reports
