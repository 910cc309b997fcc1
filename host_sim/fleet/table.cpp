#include "fleet/table.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "fleet/database.hpp"

namespace bms::fleet {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct ColumnInfo {
  const char* name;
  bool is_number;
};
constexpr ColumnInfo table_columns[] = {{"truck", false},
                                        {"cell_index", false},
                                        {"started_at", false},
                                        {"recording", false},
                                        {"kind", false},
                                        {"mechanism", false},
                                        {"parameter", false},
                                        {"value", true},
                                        {"std", true},
                                        {"unit", false},
                                        {"probability", true},
                                        {"gain", true},
                                        {"equivalent_to", false},
                                        {"settings", false},
                                        {"verdict", false},
                                        {"statement", false},
                                        {"error", false},
                                        {"initial_soc", true},
                                        {"initial_soc_sigma", true},
                                        {"task", false},
                                        {"arguments", false},
                                        {"version", false},
                                        {"cell", false},
                                        {"cell_sha256", false},
                                        {"recording_sha256", false},
                                        {"page", false},
                                        {"command", false}};
constexpr int column_count = static_cast<int>(std::size(table_columns));

struct Row {
  std::string kind = "verdict", mechanism, parameter, unit, equivalent_to, settings, verdict, statement, error;
  std::optional<double> value, std, probability, gain, initial_soc, initial_soc_sigma;
};

/// What all rows of a recording share.
struct Shared {
  Unit unit;
  std::string task, arguments, version, cell_sha256, recording_sha256, page, command;
};

std::optional<double> number_in(const Json& json, const char* name) {
  const auto found = json.find(name);
  return found == json.end() || !found->is_number() ? std::nullopt : std::optional(found->get<double>());
}

std::string text_in(const Json& json, const char* name) {
  const auto found = json.find(name);
  return found == json.end() || !found->is_string() ? "" : found->get<std::string>();
}

std::string joined(const Json& list) {
  std::string text;
  for (const Json& one : list) text += (text.empty() ? "" : " ") + one.get<std::string>();
  return text;
}

void add_diagnosis(const Json& result, std::vector<Row>& rows) {
  Row& verdict = rows.front();
  verdict.verdict = text_in(result, "verdict");
  verdict.statement = text_in(result, "statement");
  if (!result.at("recordings").empty()) {
    const Json& recording = result.at("recordings").at(0);
    verdict.initial_soc = number_in(recording, "initial_soc");
    verdict.initial_soc_sigma = number_in(recording, "initial_soc_sigma");
  }
  for (const Json& m : result.at("mechanisms")) {
    Row row;
    row.kind = "found";
    row.mechanism = text_in(m, "id");
    row.probability = number_in(m, "probability");
    row.gain = number_in(m, "gain");
    row.equivalent_to = joined(m.at("equivalent_to"));
    if (const Json& parameters = m.at("parameters"); !parameters.empty()) {
      row.parameter = text_in(parameters.at(0), "name");
      row.value = number_in(parameters.at(0), "value");
      row.std = number_in(parameters.at(0), "std");
      row.unit = text_in(parameters.at(0), "unit");
      row.settings = parameters.dump();
    }
    rows.push_back(std::move(row));
  }
  for (const Json& e : result.at("estimates")) {
    Row row;
    row.kind = "estimate";
    row.mechanism = text_in(e, "id");
    row.parameter = text_in(e, "parameter");
    row.value = number_in(e, "value");
    row.std = number_in(e, "std");
    row.unit = text_in(e, "unit");
    rows.push_back(std::move(row));
  }
}

void add_identification(const Json& result, std::vector<Row>& rows) {
  for (const Json& p : result.at("parameters")) {
    Row row;
    row.kind = "parameter";
    row.mechanism = fmt::format("{} at {:.3f}", text_in(p, "name"), number_in(p, "soc").value_or(0));
    row.parameter = text_in(p, "name");
    row.value = number_in(p, "value");
    row.std = number_in(p, "std");
    rows.push_back(std::move(row));
  }
}

void add_replay(const Json& result, std::vector<Row>& rows) {
  rows.front().initial_soc = number_in(result, "initial_soc");
  for (const char* part : {"soc", "voltage"}) {
    for (const auto& [name, value] : result.at(part).items()) {
      if (!value.is_number()) continue;
      Row row;
      row.kind = "figure";
      row.parameter = std::string(part) + "." + name;
      row.value = value.get<double>();
      rows.push_back(std::move(row));
    }
  }
}

/// Rows of a result file. The first one is the verdict.
std::vector<Row> rows_of(Task task, const Json& file) {
  std::vector<Row> rows(1);
  rows.front().error = text_in(file, "error");
  const Json& result = file.at("result");
  if (!result.is_object()) return rows;
  if (task == Task::diagnose) add_diagnosis(result, rows);
  if (task == Task::identify) add_identification(result, rows);
  if (task == Task::replay) add_replay(result, rows);
  return rows;
}

/// In the order of `table_columns`.
void insert(Statement& statement, const Shared& s, const Row& r) {
  int k = 0;
  const auto text = [&](const std::string& value) { statement.bind(k++, value); };
  const auto number = [&](const std::optional<double>& value) { statement.bind(k++, value); };
  for (const std::string* value :
       {&s.unit.truck, &s.unit.cell_index, &s.unit.started_at, &s.unit.recording, &r.kind, &r.mechanism, &r.parameter})
    text(*value);
  number(r.value);
  number(r.std);
  text(r.unit);
  number(r.probability);
  number(r.gain);
  for (const std::string* value : {&r.equivalent_to, &r.settings, &r.verdict, &r.statement, &r.error}) text(*value);
  number(r.initial_soc);
  number(r.initial_soc_sigma);
  for (const std::string* value :
       {&s.task, &s.arguments, &s.version, &s.unit.cell, &s.cell_sha256, &s.recording_sha256, &s.page, &s.command})
    text(*value);
  statement.step();
}

class Merger {
 public:
  Merger(const Depot& depot, Database& database) : depot_(depot), insert_(database, insert_sql()) {}

  MergeCounts merge() {
    read_manifest(depot_.manifest().string(), "table9", [&](const Unit& unit) { add(unit); });
    return counts_;
  }

 private:
  static std::string insert_sql() {
    std::string places;
    for (int k = 0; k < column_count; ++k) places += k == 0 ? "?" : ", ?";
    return "INSERT INTO unsorted.fleet VALUES (" + places + ")";
  }

  void add(const Unit& unit) {
    const std::string key = key_of(unit);
    Shared shared{unit, name_of(depot_.task), "", depot_.version, "", "", "", command_of(depot_, unit)};
    for (const std::string& a : depot_.arguments) shared.arguments += (shared.arguments.empty() ? "" : " ") + a;
    std::vector<Row> rows(1);
    ++counts_.recordings;
    if (fs::exists(depot_.result(key))) {
      rows = read(depot_.result(key), key, shared);
      counts_.errors += rows.front().error.empty() ? 0 : 1;
      if (!rows.front().verdict.empty()) ++counts_.verdicts[rows.front().verdict];
    } else {
      rows.front().error = "not run";
      ++counts_.missing;
    }
    for (const Row& row : rows) insert(insert_, shared, row);
    counts_.rows += rows.size();
  }

  std::vector<Row> read(const fs::path& path, const std::string& key, Shared& shared) const {
    try {
      const Json file = Json::parse(files::read_file(path));
      shared.version = text_in(file, "version");
      shared.cell_sha256 = text_in(file, "cell_sha256");
      shared.recording_sha256 = text_in(file, "recording_sha256");
      if (file.value("page", false)) shared.page = fs::relative(depot_.page(key), depot_.folder).string();
      return rows_of(depot_.task, file);
    } catch (const nlohmann::json::exception& error) {
      throw files::BadInput(path.string(), 1,
                            std::string(error.what()) + ", expected a result; remove it to run again");
    }
  }

  const Depot& depot_;
  Statement insert_;
  MergeCounts counts_;
};

std::string create(const std::string& table) {
  std::string list;
  for (const ColumnInfo& c : table_columns)
    list += fmt::format("{}{} {}", list.empty() ? "" : ", ", c.name, c.is_number ? "REAL" : "TEXT NOT NULL");
  return "CREATE TABLE " + table + " (" + list + ");";
}

std::string csv_line(const Statement& row) {
  std::string line;
  for (int k = 0; k < column_count; ++k) {
    if (k > 0) line += ',';
    if (!table_columns[k].is_number)
      line += csv_field(row.text(k));
    else if (const auto number = row.number(k))
      line += fmt::format("{}", *number);
  }
  return line + "\n";
}

void write_csv(Database& database, const fs::path& path) {
  files::write_file(path, [&](const files::Sink& sink) {
    std::string head;
    for (const ColumnInfo& c : table_columns) head += (head.empty() ? "" : ",") + std::string(c.name);
    sink(head + "\n");
    Statement all(database, "SELECT * FROM fleet ORDER BY rowid");
    while (all.step()) sink(csv_line(all));
  });
}

/// The finished file gets its name after it was forced to the disk.
void put_in_place(const fs::path& from, const fs::path& to) {
  const int file = open(from.c_str(), O_RDONLY | O_CLOEXEC);
  const bool forced = file >= 0 && fsync(file) == 0;
  if (file >= 0) close(file);
  if (!forced || std::rename(from.c_str(), to.c_str()) != 0)
    throw files::BadInput(to.string(), 1, "cannot be written, expected a place on the disk");
}

}  // namespace

MergeCounts merge(const Depot& depot) {
  const fs::path unfinished = depot.folder / fmt::format("fleet.sqlite.{}", getpid());
  fs::remove(unfinished);
  MergeCounts counts;
  {
    Database database(unfinished, Database::Open::create);
    database.run(
        "PRAGMA page_size = 4096; PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; ATTACH '' AS unsorted;"
        "PRAGMA main.cache_size = -256; PRAGMA unsorted.cache_size = -256;");  // kB: rows are written once, in order
    database.run("BEGIN;" + create("unsorted.fleet"));
    counts = Merger(depot, database).merge();
    // the index of a cell is a number for most people, and text for others
    database.run("COMMIT; BEGIN;" + create("fleet") +
                 "INSERT INTO main.fleet SELECT * FROM unsorted.fleet ORDER BY truck, CAST(cell_index AS INTEGER), "
                 "cell_index, started_at, recording, cell, kind = 'verdict' DESC, kind, mechanism, parameter;"
                 "CREATE INDEX by_kind ON fleet (kind, mechanism); COMMIT;");
    write_csv(database, depot.folder / "fleet.csv");
  }
  put_in_place(unfinished, depot.folder / "fleet.sqlite");
  return counts;
}

}  // namespace bms::fleet
