#include "reports/fleet_page.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "diagnosis/texts.hpp"
#include "reports/embedded_files.hpp"
#include "reports/json_parts.hpp"
#include "reports/report_page.hpp"

namespace bms::reports {

namespace {

using fleet::Analysis;
using fleet::History;
using fleet::Issue;

constexpr double day_s = 86'400;

struct CauseText {
  std::string name, meaning, action;
};

CauseText cause_text(const std::string& cause) {
  if (cause == "unknown")
    return {"a difference that none of the known causes explains",
            "Its voltage differs from the model in a way that the diagnosis does not know.",
            "Check the instruments against trusted ones, then look at the pages of the recordings."};
  if (cause == "data_fault")
    return {"faults of the data", "The recordings have wrong signs, units, clocks or missing readings.",
            "Check the logger and its wiring."};
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const diagnosis::MechanismText& text = diagnosis::text_of_mechanism(m);
    if (text.id == cause) return {std::string(text.name), std::string(text.meaning), std::string(text.action)};
  }
  return {cause, "", ""};
}

/// Without dates: the number of the recording.
std::string date_of(const History& history, double day) {
  if (!history.first_day_s) return fmt::format("recording {:.0f}", day + 1);
  const auto seconds = static_cast<std::time_t>(*history.first_day_s + day_s * std::floor(day));
  return fmt::format("{:%Y-%m-%d}", fmt::gmtime(seconds));
}

std::string place_of(const Issue& issue) {
  const std::string truck = issue.truck.empty() ? "Battery" : "Truck " + issue.truck;
  return issue.cell_index.empty() ? truck + ", whole battery" : truck + ", cell " + issue.cell_index;
}

std::string chance_text(double probability) {
  if (probability < 1e-6) return "A healthy one would look like this in less than 1 of 1,000,000 cases.";
  return fmt::format("A healthy one would look like this in 1 of {:.0f} cases.", std::max(1.0, 1 / probability));
}

std::string size_text(const Issue& issue) {
  if (!issue.size) return "";
  if (issue.cause == "leakage" && issue.per_day)
    return fmt::format(" It loses {:.2f} % of its charge a day, compared with its neighbours.", 100 * *issue.per_day);
  if (issue.per_day)
    return fmt::format(" It changes by {:+.3g} {} a day and is now at {:+.3g} {}.", *issue.per_day, issue.unit,
                       issue.size->value, issue.unit);
  const bool share = issue.unit == "1";
  return fmt::format(" Size: {:.3g} \u00b1 {:.2g} {}.", (share ? 100 : 1) * issue.size->value,
                     (share ? 100 : 1) * issue.size->sigma, share ? "%" : issue.unit);
}

std::string why(const History& history, const Issue& issue) {
  std::string text = fmt::format("{} of {} shifts show it", issue.seen, issue.of);
  if (issue.onset_day) text += ", since " + date_of(history, *issue.onset_day);
  text += "." + size_text(issue);
  for (std::size_t k = 0; k < issue.also.size() && k < 2; ++k)
    text += (k == 0 ? " Its recordings also name " : ", ") + cause_text(issue.also[k]).name;
  return issue.also.empty() ? text : text + ".";
}

Json visit_of(const History& history, const Issue& issue) {
  const CauseText cause = cause_text(issue.cause);
  const fleet::Entry& shown = history.cells[issue.cell].entries[issue.entry];
  return {{"where", place_of(issue)},
          {"what", cause.name},
          {"why", why(history, issue) + " " + chance_text(issue.p_value)},
          {"meaning", cause.meaning},
          {"action", cause.action},
          {"cell", issue.cell},
          {"page", shown.page},
          {"recording", shown.recording.substr(shown.recording.rfind('/') + 1)}};
}

std::string crossing_text(const History& history, const fleet::Crossing& c) {
  return fmt::format("{}, between {} and {}", date_of(history, c.day), date_of(history, c.earliest),
                     c.latest ? date_of(history, *c.latest) : "never");
}

Json forecasts_of(const History& history, const Analysis& analysis) {
  struct Forecast {
    double day;
    Json row;
  };
  std::vector<Forecast> forecasts;
  for (std::size_t c = 0; c < history.cells.size(); ++c) {
    const fleet::CellTrends& t = analysis.trends[c];
    const auto add = [&](const char* what, const std::optional<fleet::Trend>& trend,
                         const std::optional<fleet::Crossing>& crossing) {
      if (!trend || !crossing) return;
      forecasts.push_back({crossing->day,
                           {{"cell", c},
                            {"what", what},
                            {"now", 100 * trend->level},
                            {"now_sigma", 100 * trend->level_sigma},
                            {"per_month", 3'000 * trend->per_day},
                            {"per_month_sigma", 3'000 * trend->per_day_sigma},
                            {"when", crossing_text(history, *crossing)}}});
    };
    add("resistance, growth", t.resistance, t.resistance_crossing);
    add("capacity, loss", t.capacity, t.capacity_crossing);
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
  if (!e.error.empty()) return e.error;
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

std::string statement(const History& history, const Issue& issue) {
  return fmt::format("{}: {}, {} of {} shifts{}", place_of(issue), cause_text(issue.cause).name, issue.seen, issue.of,
                     issue.onset_day ? " since " + date_of(history, *issue.onset_day) : "");
}

std::string fleet_report(const History& history, const Analysis& analysis, const std::string& to_depot) {
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
  page_data["recordings"] = recordings_of(history);
  return page(embedded::fleet_html, embedded::fleet_js, "bms fleet",
              in_script(page_data.dump(-1, ' ', false, Json::error_handler_t::replace)));
}

std::string json_of(const History& history, const Analysis& analysis) {
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
                              {"resistance_growth", trend_json(t.resistance)},
                              {"resistance_limit", crossing_json(history, t.resistance_crossing)},
                              {"capacity_loss", trend_json(t.capacity)},
                              {"capacity_limit", crossing_json(history, t.capacity_crossing)}});
  }
  return text_of(json);
}

}  // namespace bms::reports
