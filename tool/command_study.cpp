#include "tool/command_study.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <vector>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "reports/json_results.hpp"
#include "reports/report_page.hpp"
#include "study/study.hpp"

namespace bms::tool {

namespace {

/// Quoted where a spreadsheet would stumble.
std::string field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// Numbers where there are numbers; the paper's in columns of their own.
std::string csv_of(const files::PageTable& table) {
  std::vector<bool> beside(table.head.size(), false);
  for (const auto& row : table.rows) {
    for (std::size_t k = 0; k < row.size(); ++k) beside[k] = beside[k] || row[k].paper;
  }
  std::string csv;
  for (std::size_t k = 0; k < table.head.size(); ++k) {
    csv += (k > 0 ? "," : "") + field(table.head[k]);
    if (beside[k]) csv += "," + field("paper: " + table.head[k]);
  }
  csv += "\n";
  for (const auto& row : table.rows) {
    for (std::size_t k = 0; k < row.size(); ++k) {
      csv += (k > 0 ? "," : "") + (row[k].value ? fmt::format("{:.8g}", *row[k].value) : field(row[k].text));
      if (beside[k]) csv += row[k].paper ? fmt::format(",{:.8g}", *row[k].paper) : ",";
    }
    csv += "\n";
  }
  return csv;
}

std::string page_of_study(const study::StudyResult& r) {
  files::PageContent content{"Models, optimisers and experiments",
                             fmt::format("{} identifications of {}.", r.fits, r.source),
                             {},
                             {},
                             r.charts};
  for (const measurement::Warning& w : r.warnings) content.warnings.push_back(w.text);
  files::PageTable claims{
      "claims", "What the paper says, and whether it holds here", {"statement", "holds", "evidence"}, {}, ""};
  for (const study::StudyClaim& c : r.claims)
    claims.rows.push_back({{c.claim, {}, {}}, {c.holds ? "yes" : "no", {}, {}}, {c.result, {}, {}}});
  content.tables.push_back(std::move(claims));
  content.tables.insert(content.tables.end(), r.tables.begin(), r.tables.end());
  return reports::page_of(content);
}

study::StudyProgress progress_on_terminal() {
  if (!isatty(2)) return {};
  const auto begin = std::chrono::steady_clock::now();
  return [begin](std::size_t done, std::size_t all) {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    fmt::print(stderr, "\r{} of {} identifications, about {:.0f} s left   {}", done, all,
               seconds / static_cast<double>(done) * static_cast<double>(all - done), done == all ? "\n" : "");
  };
}

}  // namespace

int run(const StudyOptions& options) {
  const files::CellFile cell = files::read_cell(options.cell);
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error)
    throw files::BadInput(options.out, 1, "cannot be made (" + error.message() + "), expected a folder to write to");

  study::StudyResult result;
  if (options.recordings.empty()) {
    result = study::study_plant(cell.parameters, options.seed, progress_on_terminal());
  } else {
    if (!std::filesystem::is_directory(options.recordings, error))
      throw files::BadInput(options.recordings, 1, "no folder, expected one with recordings in CSV");
    std::vector<std::string> paths;
    for (const auto& entry : std::filesystem::directory_iterator(options.recordings)) {
      if (entry.path().extension() == ".csv") paths.push_back(entry.path().string());
    }
    std::sort(paths.begin(), paths.end());
    result = study::study_recordings(cell.parameters, paths, progress_on_terminal());
  }
  const std::filesystem::path folder = options.out;
  for (const files::PageTable& table : result.tables)
    write_output((folder / (table.id + ".csv")).string(), csv_of(table));
  const std::string json = reports::json_of(result), page = page_of_study(result);
  write_output((folder / "study.json").string(), json);
  write_output((folder / "study.html").string(), page);
  if (!options.output.json.empty()) write_output(options.output.json, json);
  if (!options.output.report.empty()) write_output(options.output.report, page);

  for (const measurement::Warning& w : result.warnings) warn(w.text);
  std::string text =
      fmt::format("{} identifications in {:.1f} s, of {}.\n", result.fits, result.seconds, result.source);
  for (const study::StudyClaim& c : result.claims)
    text += fmt::format("  {} {}: {}\n", c.holds ? "yes" : "no ", c.claim, c.result);
  print_summary(options.output, text + "Report: " + (folder / "study.html").string());
  return 0;
}

}  // namespace bms::tool
