#include "update/depot_update.hpp"

#include <algorithm>
#include <fstream>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "fleet/manifest.hpp"

namespace bms::update {

namespace {

namespace fs = std::filesystem;
using files::BadInput;

constexpr const char* columns = "truck,bus,state,runs,cell,image,reason";

/// A table with a header; lines that are empty or begin with # are no rows.
class Table {
 public:
  explicit Table(const fs::path& path) : path_(path.string()) {
    std::ifstream in(path, std::ios::binary);
    if (!in) throw BadInput(path_, 1, "cannot be read, expected a table of trucks");
    std::string line;
    for (std::size_t number = 1; std::getline(in, line); ++number) {
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (line.empty() || line.front() == '#') continue;
      const auto fields = fleet::fields_of(line);
      if (at_.empty()) {
        for (std::size_t k = 0; k < fields.size(); ++k) at_[fields[k]] = k;
      } else {
        rows_.push_back({number, fields});
      }
    }
  }
  void expect(const char* column, const char* expected) const {
    if (!at_.contains(column))
      throw BadInput(path_, 1, fmt::format("no column '{}', expected a header with {}", column, expected));
  }
  struct Row {
    std::size_t number;
    std::vector<std::string> fields;
  };
  const std::vector<Row>& rows() const { return rows_; }
  std::string field(const Row& row, const char* column) const {
    const auto found = at_.find(column);
    return found == at_.end() || found->second >= row.fields.size() ? "" : row.fields[found->second];
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  std::map<std::string, std::size_t> at_;
  std::vector<Row> rows_;
};

void write_rows(const fs::path& out, const std::vector<TruckRow>& rows) {
  std::string text = std::string(columns) + "\n";
  for (const TruckRow& r : rows) {
    const char* separator = "";
    for (const std::string* field : {&r.truck, &r.bus, &r.state, &r.runs, &r.cell, &r.image, &r.reason}) {
      text += separator + fleet::csv_field(*field);
      separator = ",";
    }
    text += "\n";
  }
  files::write_file(out, text);
}

}  // namespace

std::vector<Truck> read_trucks(const fs::path& path) {
  const Table table(path);
  table.expect("truck", "truck,bus,key");
  table.expect("bus", "truck,bus,key");
  std::vector<Truck> trucks;
  std::set<std::string> known;
  for (const auto& row : table.rows()) {
    Truck truck{table.field(row, "truck"), table.field(row, "bus"), {}};
    if (truck.bus.empty()) continue;
    if (truck.name.empty()) throw BadInput(table.path(), row.number, "a bus without a truck, expected its name");
    if (!known.insert(truck.name).second) continue;
    const std::string key = table.field(row, "key");
    if (!key.empty()) truck.key = fs::absolute(path.parent_path() / key).lexically_normal();
    trucks.push_back(std::move(truck));
  }
  if (trucks.empty()) throw BadInput(table.path(), 1, "has no truck with a bus, expected at least one");
  return trucks;
}

std::vector<TruckRow> read_rows(const fs::path& path) {
  if (!fs::exists(path)) return {};
  const Table table(path);
  for (const char* column : {"truck", "state", "image"}) table.expect(column, columns);
  std::vector<TruckRow> rows;
  for (const auto& row : table.rows()) {
    rows.push_back({table.field(row, "truck"), table.field(row, "bus"), table.field(row, "state"),
                    table.field(row, "runs"), table.field(row, "cell"), table.field(row, "image"),
                    table.field(row, "reason")});
  }
  return rows;
}

std::vector<TruckRow> update_trucks(const std::vector<Truck>& trucks, const std::string& image, const fs::path& out,
                                    const UpdateOne& update, const std::function<void(const TruckRow&)>& done) {
  const auto earlier = read_rows(out);
  std::vector<TruckRow> rows;
  std::map<std::string, std::size_t> next_of_bus;
  for (const Truck& truck : trucks) {
    const auto before = std::ranges::find(earlier, truck.name, &TruckRow::truck);
    rows.push_back({truck.name, truck.bus, "waiting", "", "", image, ""});
    if (before != earlier.end()) {
      rows.back().runs = before->runs;
      rows.back().cell = before->cell;
    }
    if (before != earlier.end() && before->state == "done" && before->image == image)
      rows.back() = *before;
    else
      next_of_bus.try_emplace(truck.bus, rows.size() - 1);
  }
  write_rows(out, rows);
  std::mutex one_at_a_time;
  std::vector<std::jthread> buses;
  for (const auto& [bus, k] : next_of_bus) {
    buses.emplace_back([&, k = k] {
      TruckRow row = rows[k];
      try {
        const UpdateResult result = update(trucks[k]);
        row.state = name_of(result.outcome);
        row.reason = result.reason;
        const bool of_cell = result.kind == boot::Kind::cell, is_done = result.outcome == UpdateResult::Outcome::done;
        if (!result.from.empty()) (of_cell ? row.cell : row.runs) = is_done ? result.to : result.from;
        if (!of_cell && is_done) row.cell.clear();  // constants are for one application
      } catch (const std::exception& error) {
        row.state = "refused";
        row.reason = error.what();
      }
      const std::lock_guard lock(one_at_a_time);
      rows[k] = row;
      write_rows(out, rows);
      done(row);
    });
  }
  buses.clear();
  return rows;
}

}  // namespace bms::update
