#include "fleet/history.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "fleet/database.hpp"
#include "fleet/manifest.hpp"

namespace bms::fleet {

namespace {

constexpr double day_s = 86'400;
constexpr const char* query =
    "SELECT truck, cell_index, started_at, recording, kind, mechanism, value, std, unit, probability, gain, "
    "equivalent_to, verdict, statement, error, initial_soc, initial_soc_sigma, page, task, version "
    "FROM fleet WHERE kind <> 'figure' AND kind <> 'parameter' ORDER BY rowid";
enum Column {
  truck,
  cell_index,
  started_at,
  recording,
  kind,
  mechanism,
  value,
  std_dev,
  unit,
  probability,
  gain,
  equivalent_to,
  verdict,
  statement,
  error,
  initial_soc,
  initial_soc_sigma,
  page,
  task,
  version
};

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

std::optional<Strength> strength_in(const Statement& row) {
  const auto v = row.number(value), s = row.number(std_dev);
  return v && s && *s > 0 ? std::optional(Strength{*v, *s}) : std::nullopt;
}

/// A mechanism that was found replaces the estimate of it.
void set_quantities(const std::string& id, const std::optional<Strength>& strength, Entry& entry) {
  if (!strength) return;
  if (id == "resistance_growth") entry.resistance = strength;
  if (id == "capacity_change") entry.capacity = strength;
  if (id == "current_offset") entry.current_offset = strength;
}

void add_row(const Statement& row, Entry& entry) {
  const std::string id = row.text(mechanism);
  const auto strength = strength_in(row);
  set_quantities(id, strength, entry);
  if (row.text(kind) != "found") return;
  entry.named.push_back({id, row.text(unit), row.number(probability).value_or(0), row.number(gain).value_or(0),
                         strength, words_of(row.text(equivalent_to))});
}

/// A leakage takes the place of an offset of the current sensor: the recording of one cell shows their sum.
void add_leakage(Entry& entry) {
  const Named* leakage = entry.find("leakage");
  if (leakage == nullptr || !leakage->strength) return;
  const Strength other = entry.current_offset.value_or(Strength{0, leakage->strength->sigma});
  entry.current_offset = {other.value + leakage->strength->value, leakage->strength->sigma};
}

/// Days from dates; where a recording has none, its number in the cell.
void set_days(History& history, std::vector<std::vector<std::optional<double>>>& started) {
  double first = std::numeric_limits<double>::infinity();
  bool dated = true;
  for (const auto& of_cell : started) {
    for (const auto& s : of_cell) {
      dated = dated && s;
      first = std::min(first, s.value_or(first));
    }
  }
  if (dated && std::isfinite(first)) history.first_day_s = std::floor(first / day_s) * day_s;
  for (std::size_t c = 0; c < history.cells.size(); ++c) {
    auto& entries = history.cells[c].entries;
    for (std::size_t k = 0; k < entries.size(); ++k)
      entries[k].day = history.first_day_s ? (*started[c][k] - *history.first_day_s) / day_s : static_cast<double>(k);
    std::stable_sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.day < b.day; });
  }
}

}  // namespace

bool Named::may_be(const std::string& id) const {
  return mechanism == id || std::find(equivalent.begin(), equivalent.end(), id) != equivalent.end();
}

bool Entry::usable() const { return error.empty() && verdict != "NOT_TESTABLE" && !verdict.empty(); }

const Named* Entry::find(const std::string& id) const {
  const auto found = std::find_if(named.begin(), named.end(), [&](const Named& n) { return n.mechanism == id; });
  return found == named.end() ? nullptr : &*found;
}

History read_history(const std::filesystem::path& table) {
  Database database(table, Database::Open::read);
  Statement row(database, query);
  History history;
  std::vector<std::vector<std::optional<double>>> started;
  while (row.step()) {
    if (row.text(kind) != "verdict") {  // follows the verdict of its recording
      if (!history.cells.empty()) add_row(row, history.cells.back().entries.back());
      continue;
    }
    const std::string of_truck = row.text(truck), index = row.text(cell_index);
    if (history.cells.empty() || history.cells.back().truck != of_truck || history.cells.back().cell_index != index) {
      history.cells.push_back({of_truck, index, {}});
      started.emplace_back();
    }
    Entry entry;
    entry.recording = row.text(recording);
    entry.page = row.text(page);
    entry.verdict = row.text(verdict);
    entry.statement = row.text(statement);
    entry.error = row.text(error);
    const auto soc = row.number(initial_soc), sigma = row.number(initial_soc_sigma);
    if (soc && sigma) entry.initial_soc = {*soc, *sigma};
    history.cells.back().entries.push_back(std::move(entry));
    started.back().push_back(row.text(started_at).empty() ? std::nullopt : started_s(row.text(started_at)));
    history.task = row.text(task);
    history.version = row.text(version);
    ++history.recordings;
  }
  for (CellHistory& cell : history.cells)
    for (Entry& entry : cell.entries) add_leakage(entry);
  set_days(history, started);
  return history;
}

}  // namespace bms::fleet
