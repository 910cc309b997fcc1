#include "reports/fleet_texts.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "diagnosis/texts.hpp"

namespace bms::reports {

namespace {

using fleet::Analysis;
using fleet::Course;
using fleet::History;
using fleet::Issue;

constexpr double day_s = 86'400;
constexpr std::size_t most_lines = 20;  ///< of a kind on the terminal; the page has all

std::string cases(double probability) {
  if (probability < 1e-6) return "less than 1 of 1,000,000 cases";
  return fmt::format("1 of {:.0f} cases", std::max(1.0, 1 / probability));
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

std::string shown_text(const Issue& issue) {
  if (issue.of == 1) return "its only shift shows it";
  return fmt::format("{} of {} shifts {} it", issue.seen, issue.of, issue.seen == 1 ? "shows" : "show");
}

bool names(const Issue& issue, const char* cause) {
  return issue.cause == cause || std::find(issue.also.begin(), issue.also.end(), cause) != issue.also.end();
}

/// Why the day of a limit is not known.
std::string no_day_text(const Course& course) {
  switch (course.outlook) {
    case fleet::Outlook::few_readings:
      return fmt::format("{} {}, a trend needs {}", course.readings.size(),
                         course.readings.size() == 1 ? "reading" : "readings", fleet::fewest_readings);
    case fleet::Outlook::short_time:
      return fmt::format("its readings cover less than {:.0f} days", fleet::shortest_days);
    case fleet::Outlook::far:
      return fmt::format("not within {:.0f} years", fleet::forecast_days / 365);
    default:
      return fmt::format("no trend towards it: {:+.1f} \u00b1 {:.1f} % in 30 days", 3'000 * course.trend->per_day,
                         3'000 * course.trend->per_day_sigma);
  }
}

/// what: "growth of the resistance".
std::string limit_sentence(const History& history, const std::string& place, const char* what, const Course& course,
                           double limit) {
  const double day = course.readings.back().day;
  const double value = course.trend ? course.trend->at(day) : course.readings.back().value;
  const double sigma = course.trend ? course.trend->level_sigma : course.readings.back().sigma;
  const std::string now =
      fmt::format("{}: {} {:.0f} \u00b1 {:.0f} % on {}", place, what, 100 * value, 100 * sigma, date_of(history, day));
  if (course.outlook == fleet::Outlook::reached)
    return fmt::format("{}, so the limit of {:.0f} % is reached.", now, 100 * limit);
  if (course.crossing)
    return fmt::format("{}; it reaches the limit of {:.0f} % on {}.", now, 100 * limit,
                       crossing_text(history, *course.crossing));
  return fmt::format("{}; when it reaches the limit of {:.0f} % cannot be said: {}.", now, 100 * limit,
                     no_day_text(course));
}

/// Adds the lines of one kind; many of a kind would push the others off the screen.
void add_lines(const std::string& title, const std::vector<std::string>& lines, std::string& text) {
  if (lines.empty()) return;
  text += (text.empty() ? "" : "\n") + title;
  for (std::size_t k = 0; k < std::min(lines.size(), most_lines); ++k) text += "\n  " + lines[k];
  if (lines.size() > most_lines) text += fmt::format("\n  and {} more", lines.size() - most_lines);
}

}  // namespace

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

std::string date_of(const History& history, double day) {
  if (!history.first_day_s) return fmt::format("recording {:.0f}", day + 1);
  const auto seconds = static_cast<std::time_t>(*history.first_day_s + day_s * std::floor(day));
  return fmt::format("{:%Y-%m-%d}", fmt::gmtime(seconds));
}

std::string place_of(const std::string& truck, const std::string& cell_index) {
  const std::string of = truck.empty() ? "Battery" : "Truck " + truck;
  return cell_index.empty() ? of + ", whole battery" : of + ", cell " + cell_index;
}

std::string statement(const History& history, const Issue& issue) {
  return fmt::format("{}: {}, {} of {} {}{}", place_of(issue.truck, issue.cell_index), cause_text(issue.cause).name,
                     issue.seen, issue.of, issue.of == 1 ? "shift" : "shifts",
                     issue.onset_day ? " since " + date_of(history, *issue.onset_day) : "");
}

std::string why(const History& history, const Issue& issue) {
  std::string text = shown_text(issue);
  text.front() = text.front() == 'i' ? 'I' : text.front();
  if (issue.onset_day) text += ", since " + date_of(history, *issue.onset_day);
  text += "." + size_text(issue);
  for (std::size_t k = 0; k < issue.also.size() && k < 2; ++k)
    text += (k == 0 ? " Its recordings also name " : ", ") + cause_text(issue.also[k]).name;
  if (!issue.also.empty()) text += ".";
  if (issue.confirmed) return text + " A healthy one would look like this in " + cases(issue.p_value) + ".";
  if (issue.size && !issue.per_day) text += " That error is the error of the size, if the cause is right.";
  return text + fmt::format(
                    " Whether it is right is not confirmed: a healthy one is named like this in {}, and many are "
                    "compared. Record it again.",
                    cases(issue.p_value));
}

std::string crossing_text(const History& history, const fleet::Crossing& c) {
  return fmt::format("{}, between {} and {}", date_of(history, c.day), date_of(history, c.earliest),
                     c.latest ? date_of(history, *c.latest) : "never");
}

std::vector<std::string> limit_sentences(const History& history, const Analysis& analysis,
                                         const fleet::AnalysisOptions& options) {
  std::vector<std::string> sentences;
  for (std::size_t c = 0; c < history.cells.size(); ++c) {
    const fleet::CellHistory& cell = history.cells[c];
    const auto add = [&](const char* cause, const char* what, const Course& course, double limit) {
      if (course.readings.empty()) return;
      const bool named = std::any_of(analysis.issues.begin(), analysis.issues.end(), [&](const Issue& issue) {
        return issue.truck == cell.truck && issue.cell_index == cell.cell_index && names(issue, cause);
      });
      if (!named && course.outlook != fleet::Outlook::reached && !course.crossing) return;
      sentences.push_back(limit_sentence(history, place_of(cell.truck, cell.cell_index), what, course, limit));
    };
    const fleet::CellTrends& trends = analysis.trends[c];
    add("resistance_growth", "growth of the resistance", trends.resistance, options.resistance_limit);
    add("capacity_change", "loss of capacity", trends.capacity, options.capacity_limit);
  }
  return sentences;
}

std::string reason_of(const fleet::Entry& entry) {
  std::string reason = entry.error;
  if (reason.starts_with(entry.recording + ":")) reason.erase(0, entry.recording.size() + 1);
  const std::size_t after_line = reason.find_first_not_of("0123456789");
  if (after_line > 0 && reason.compare(after_line, 2, ": ") == 0)
    reason = "line " + reason.substr(0, after_line) + reason.substr(after_line);
  return reason;
}

std::string summary(const History& history, const Analysis& analysis, const fleet::AnalysisOptions& options) {
  std::vector<std::string> visits, watched, unreadable;
  for (const Issue& issue : analysis.issues) {
    if (issue.confirmed)
      visits.push_back(statement(history, issue));
    else
      watched.push_back(statement(history, issue) + ". " + why(history, issue));
  }
  for (const fleet::CellHistory& cell : history.cells) {
    for (const fleet::Entry& entry : cell.entries) {
      if (!entry.error.empty())
        unreadable.push_back(place_of(cell.truck, cell.cell_index) + ", " + entry.recording + ": " + reason_of(entry));
    }
  }
  std::string text;
  if (visits.empty()) text = "No battery needs a visit.";
  for (const std::string& visit : visits) text += (text.empty() ? "" : "\n") + visit;
  add_lines("Named, but not confirmed:", watched, text);
  add_lines("Limits:", limit_sentences(history, analysis, options), text);
  add_lines("Not read:", unreadable, text);
  return text;
}

}  // namespace bms::reports
