#include "fleet/manifest.hpp"

#include <glob.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/logs/time_text.hpp"
#include "files/text_file.hpp"

namespace bms::fleet {

namespace {

namespace fs = std::filesystem;
using files::BadInput;
using Use = std::function<void(const Unit&)>;

constexpr std::string_view columns = "recording,cell,truck,cell_index,started_at";

std::string absolute(const fs::path& path, const fs::path& folder) {
  return (path.is_absolute() ? path : fs::absolute(folder / path)).lexically_normal().string();
}

bool is_built_in(const std::string& cell) {
  const auto& cells = files::built_in_cells();
  return std::any_of(cells.begin(), cells.end(), [&](const files::BuiltInCell& c) { return c.name == cell; });
}

bool is_table(const fs::path& path) {
  const std::string name = path.filename().string();
  return name.ends_with(".csv") || name.ends_with(".csv.gz");
}

/// A recording that stands in a table more than once would count more than once.
class Seen {
 public:
  void add(const Unit& unit) { keys_.push_back(std::stoull(key_of(unit), nullptr, 16)); }
  bool repeated() {
    std::sort(keys_.begin(), keys_.end());
    return std::adjacent_find(keys_.begin(), keys_.end()) != keys_.end();
  }
  std::size_t count() const { return keys_.size(); }

 private:
  std::vector<std::uint64_t> keys_;
};

/// A table's header: where each column stands.
class Header {
 public:
  Header(const std::string& line, const std::string& path, std::size_t number) {
    const std::vector<std::string> names = fields_of(line);
    for (std::size_t k = 0; k < names.size(); ++k) at_[names[k]] = k;
    if (!at_.contains("recording"))
      throw BadInput(path, number, fmt::format("no column 'recording', expected a header with {}", columns));
  }
  std::string field(const std::vector<std::string>& fields, const char* name) const {
    const auto found = at_.find(name);
    return found == at_.end() || found->second >= fields.size() ? "" : fields[found->second];
  }
  std::size_t width() const { return at_.size(); }

 private:
  std::map<std::string, std::size_t> at_;
};

Unit unit_of(const Header& header, const std::vector<std::string>& fields, const std::string& default_cell,
             const fs::path& folder) {
  Unit unit;
  unit.recording = header.field(fields, "recording");
  const std::string cell = header.field(fields, "cell");
  unit.cell = default_cell;
  if (!cell.empty()) unit.cell = is_built_in(cell) ? cell : absolute(cell, folder);
  unit.truck = header.field(fields, "truck");
  unit.cell_index = header.field(fields, "cell_index");
  unit.started_at = header.field(fields, "started_at");
  if (!unit.recording.empty()) unit.recording = absolute(unit.recording, folder);
  return unit;
}

void read_table(const fs::path& path, const std::string& default_cell, const Use& use) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw BadInput(path.string(), 1, "cannot be read, expected a manifest");
  std::optional<Header> header;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line.front() == '#') continue;
    if (!header) {
      header.emplace(line, path.string(), number);
      continue;
    }
    const std::vector<std::string> fields = fields_of(line);
    if (fields.size() > header->width())
      throw BadInput(path.string(), number, fmt::format("{} fields, expected {}", fields.size(), header->width()));
    const Unit unit = unit_of(*header, fields, default_cell, path.parent_path());
    if (unit.recording.empty()) throw BadInput(path.string(), number, "no recording, expected a path");
    if (!unit.started_at.empty() && !started_s(unit.started_at))
      throw BadInput(path.string(), number,
                     "'" + unit.started_at + "' is not a date, expected one like 2026-03-05T06:00:00Z");
    use(unit);
  }
}

void use_files(std::vector<fs::path> paths, const std::string& default_cell, const Use& use) {
  std::sort(paths.begin(), paths.end());
  for (const fs::path& path : paths) {
    Unit unit;
    unit.recording = absolute(path, ".");
    unit.cell = default_cell;
    unit.truck = fs::path(unit.recording).parent_path().filename().string();
    use(unit);
  }
}

std::vector<fs::path> files_in(const std::string& folder) {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied)) {
    std::error_code error;
    if (entry.is_regular_file(error) && is_table(entry.path())) paths.push_back(entry.path());
  }
  return paths;
}

std::vector<fs::path> files_like(const std::string& pattern) {
  glob_t found{};
  std::vector<fs::path> paths;
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) paths.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  globfree(&found);
  std::erase_if(paths, [](const fs::path& path) { return fs::is_directory(path); });
  return paths;
}

}  // namespace

std::optional<double> started_s(const std::string& date) {
  constexpr std::size_t only_a_date = 10;  // 2026-03-05
  return files::date_s(date.size() == only_a_date ? date + "T00:00:00Z" : date, false);
}

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (std::size_t k = 0; k < line.size(); ++k) {
    const char c = line[k];
    if (quoted && c == '"' && k + 1 < line.size() && line[k + 1] == '"')
      fields.back() += line[++k];
    else if (c == '"')
      quoted = !quoted;
    else if (c == ',' && !quoted)
      fields.emplace_back();
    else
      fields.back() += c;
  }
  return fields;
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n\r#") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

void read_manifest(const std::string& manifest, const std::string& default_cell, const Use& use) {
  const std::string cell = is_built_in(default_cell) ? default_cell : absolute(default_cell, ".");
  Seen seen;
  const Use checked = [&](const Unit& unit) {
    if (unit.recording.find_first_of("\n\r") != std::string::npos)
      throw BadInput(unit.recording, 1, "a line end in a file name, expected a name without");
    seen.add(unit);
    use(unit);
  };
  std::error_code error;
  if (fs::is_directory(manifest, error))
    use_files(files_in(manifest), cell, checked);
  else if (fs::is_regular_file(manifest, error))
    read_table(fs::absolute(manifest), cell, checked);
  else
    use_files(files_like(manifest), cell, checked);
  if (seen.count() == 0) throw BadInput(manifest, 1, "no recording, expected a folder, a pattern or a table with some");
  if (seen.repeated())
    throw BadInput(manifest, 1, "names a recording more than once with the same cell, expected each once");
}

std::size_t write_manifest(const std::string& manifest, const std::string& default_cell, const fs::path& table) {
  std::size_t count = 0;
  files::write_file(table, [&](const files::Sink& sink) {
    sink(std::string(columns) + "\n");
    read_manifest(manifest, default_cell, [&](const Unit& u) {
      ++count;
      sink(fmt::format("{},{},{},{},{}\n", csv_field(u.recording), csv_field(u.cell), csv_field(u.truck),
                       csv_field(u.cell_index), csv_field(u.started_at)));
    });
  });
  return count;
}

std::string key_of(const Unit& unit) {
  constexpr std::size_t digits = 16;
  return files::sha256(unit.recording + '\n' + unit.cell).substr(0, digits);
}

}  // namespace bms::fleet
