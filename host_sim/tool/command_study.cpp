// bms study: the paper's comparison of models, optimisers and experiments, as tables and one page.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <vector>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/committed_figures.hpp"
#include "reports/json_study.hpp"
#include "reports/report_page.hpp"
#include "study/diagnose_paper.hpp"
#include "study/study.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

struct StudyOptions {
  std::string cell = "table9";  ///< OCV, capacity, and the initial values of the fits
  std::string recordings;       ///< folder with CSV files; empty: the simulated plant
  study::StudyOptions study;
  std::string out;              ///< folder: tables as CSV, study.json, study.html
  std::string readme;           ///< file with marks, to which the main tables are written
  bool diagnose_paper = false;  ///< instead of the study
  Output output;
};

/// A field of a CSV file, quoted if it contains a separator.
std::string field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// Cells with a value as numbers; the paper's values in columns of their own.
std::string csv_of(const files::PageTable& table) {
  std::vector<bool> has_paper(table.head.size(), false);
  for (const auto& row : table.rows) {
    for (std::size_t k = 0; k < row.size(); ++k) has_paper[k] = has_paper[k] || row[k].paper;
  }
  std::string csv;
  for (std::size_t k = 0; k < table.head.size(); ++k) {
    csv += (k > 0 ? "," : "") + field(table.head[k]);
    if (has_paper[k]) csv += "," + field("paper: " + table.head[k]);
  }
  csv += "\n";
  for (const auto& row : table.rows) {
    for (std::size_t k = 0; k < row.size(); ++k) {
      csv += (k > 0 ? "," : "") + (row[k].value ? fmt::format("{:.8g}", *row[k].value) : field(row[k].text));
      if (has_paper[k]) csv += row[k].paper ? fmt::format(",{:.8g}", *row[k].paper) : ",";
    }
    csv += "\n";
  }
  return csv;
}

/// A Markdown table of the columns that `shown` accepts; the paper's values follow in brackets.
std::string markdown_of(const files::PageTable& table, const std::vector<std::string>& left_out) {
  std::string head, line, rows;
  std::vector<bool> shown;
  for (const std::string& name : table.head) {
    shown.push_back(std::find(left_out.begin(), left_out.end(), name) == left_out.end());
    if (!shown.back()) continue;
    head += "| " + name + " ";
    line += "|---";
  }
  for (const auto& row : table.rows) {
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (!shown[k]) continue;
      rows += "| " + row[k].text + (row[k].paper ? fmt::format(" ({:.5g})", *row[k].paper) : "") + " ";
    }
    rows += "|\n";
  }
  return head + "|\n" + line + "|\n" + rows;
}

/// Writes tables between their marks in a file, "<!-- figures: ID -->".
void write_to_readme(const std::string& readme, const std::vector<files::PageTable>& tables,
                     const std::vector<std::string>& ids) {
  if (readme.empty()) return;
  for (const files::PageTable& table : tables) {
    if (std::find(ids.begin(), ids.end(), table.id) == ids.end()) continue;
    files::replace_figures(readme, table.id, markdown_of(table, {"in the paper", "holds if"}));
  }
}

const char* verdict_of(const study::StudyClaim& c) {
  if (!c.holds) return "not judged";
  return *c.holds ? "yes" : "no";
}

std::string page_of_study(const study::StudyResult& r) {
  files::PageContent content{"Models, optimisers and experiments",
                             fmt::format("{} identifications of {}.", r.fits, r.source),
                             {},
                             {},
                             r.charts};
  for (const measurement::Warning& w : r.warnings) content.warnings.push_back(w.text);
  files::PageTable claims{"claims",
                          "Statements of the paper in the run that the tables below show",
                          {"statement", "holds", "observation"},
                          {},
                          "One run proves little: see the shares over many cells."};
  for (const study::StudyClaim& c : r.claims)
    claims.rows.push_back({{c.claim, {}, {}}, {verdict_of(c), {}, {}}, {c.result, {}, {}}});
  const auto shares = [](const files::PageTable& t) { return t.id == "statements"; };
  for (const files::PageTable& t : r.tables) {
    if (shares(t)) content.tables.push_back(t);
  }
  content.tables.push_back(std::move(claims));
  for (const files::PageTable& t : r.tables) {
    if (!shares(t)) content.tables.push_back(t);
  }
  return reports::page_of(content);
}

study::StudyProgress study_progress() {
  const auto progress = progress_on_stderr(0.2, [](double, double left_s, const std::string& what) {
    return fmt::format("{}, about {:.0f} s left", what, std::isfinite(left_s) ? left_s : 0);
  });
  return [progress](std::size_t done, std::size_t all) {
    if (!progress) return;
    progress(static_cast<double>(done) / static_cast<double>(all), fmt::format("{} of {} identifications", done, all));
  };
}

/// The recordings of the folder, sorted by name; none if there is no folder.
std::vector<std::string> recordings_of(const StudyOptions& options) {
  std::vector<std::string> paths;
  if (options.recordings.empty()) return paths;
  std::error_code error;
  if (!std::filesystem::is_directory(options.recordings, error))
    throw files::BadInput(options.recordings, 1, "no folder, expected one with recordings in CSV");
  for (const auto& entry : std::filesystem::directory_iterator(options.recordings)) {
    const std::string path = entry.path().string();
    if (path.ends_with(".csv") || path.ends_with(".csv.gz")) paths.push_back(path);
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

/// Files of the folder of results that do not depend on the tables.
std::vector<std::string> files_of_results(const StudyOptions& options) {
  const std::filesystem::path folder = options.out;
  return {(folder / "study.json").string(), (folder / "study.html").string()};
}

study::StudyResult compute(const StudyOptions& options, const files::CellFile& cell,
                           const std::vector<std::string>& recordings) {
  if (options.recordings.empty()) return study::study_plant(cell.parameters, options.study, study_progress());
  return study::study_recordings(cell.parameters, recordings, options.study, study_progress());
}

void write(const StudyOptions& options, const std::vector<std::string>& recordings, const study::StudyResult& result) {
  const std::filesystem::path folder = options.out;
  std::vector<std::string> outputs = files_of_results(options);
  for (const files::PageTable& table : result.tables) outputs.push_back((folder / (table.id + ".csv")).string());
  options.output.protect(recordings, outputs);
  for (const files::PageTable& table : result.tables)
    write_output((folder / (table.id + ".csv")).string(), csv_of(table));
  const std::string json = reports::json_of(result), page = page_of_study(result);
  write_output((folder / "study.json").string(), json);
  write_output((folder / "study.html").string(), page);
  if (!options.output.json.empty()) write_output(options.output.json, json);
  if (!options.output.report.empty()) write_output(options.output.report, page);
  write_to_readme(options.readme, result.tables, {"statements"});
  for (const measurement::Warning& w : result.warnings) warn(w.text);
  std::string text =
      fmt::format("{} identifications in {:.1f} s, of {}.\n", result.fits, result.seconds, result.source);
  for (const study::StudyClaim& c : result.claims)
    text += fmt::format("  {:10} {}: {}\n", verdict_of(c), c.claim, c.result);
  print_summary(options.output, text + "Report: " + (folder / "study.html").string());
}

/// --diagnose-paper: result to JSON and, if asked for, a page and tables.
void diagnose_paper(const StudyOptions& options, const files::CellFile& cell) {
  const study::PaperDiagnosis found = study::diagnose_paper(cell.parameters);
  const std::string json = reports::json_of(found);
  const std::vector<files::PageTable> tables = study::tables_of(found);
  const std::string page =
      reports::page_of({"Which physics the published figures ask for", found.statement, {}, tables, {}});
  if (!options.out.empty()) {
    const std::filesystem::path folder = options.out;
    for (const files::PageTable& table : tables) write_output((folder / (table.id + ".csv")).string(), csv_of(table));
    write_output((folder / "paper.json").string(), json);
    write_output((folder / "paper.html").string(), page);
  }
  if (!options.output.json.empty()) write_output(options.output.json, json);
  if (!options.output.report.empty()) write_output(options.output.report, page);
  write_to_readme(options.readme, tables,
                  {"physics", "candidates", "held_out", "misfits", "contradictions", "consistency"});
  std::string text = found.statement + "\n";
  for (const study::PaperPhysics& p : found.physics)
    text += fmt::format("  {:22} {:.4g} {} ({:.3g} to {:.3g})\n", p.id, p.value, p.unit, p.low, p.high);
  print_summary(options.output, text);
}

class StudyCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c =
        *app.add_subcommand("study", "Compare models, optimisers and experiments as the paper does (Tables 4 to 9)");
    c.footer("Example: bms study --out study");
    c.add_option("--recordings", o_.recordings, "folder with recordings; a simulated cell is used if not given")
        ->type_name("DIR");
    c.add_option("--cell", o_.cell, cell_help("OCV, capacity and initial values"))->capture_default_str();
    c.add_option("--seed", o_.study.seed, "seed of the simulated cell's noise")->capture_default_str();
    c.add_option("--seeds", o_.study.seeds, "cells of each kind for the shares; 0: one run only")
        ->capture_default_str();
    c.add_option("--out", o_.out, "folder for the tables (CSV, JSON) and the page")->type_name("DIR");
    c.add_option("--readme", o_.readme, "write the main tables to FILE, between '<!-- figures: ID -->' and their end")
        ->type_name("FILE");
    c.add_flag("--diagnose-paper", o_.diagnose_paper,
               "find which physics the published figures of the paper ask for, instead of the study");
    add_output(c, o_.output);
    return &c;
  }

  int run() override {
    o_.output.set_own("");
    if (o_.out.empty() && !o_.diagnose_paper)
      throw files::BadInput("--out", 1, "missing, expected a folder for the tables and the page");
    const std::vector<std::string> recordings = recordings_of(o_);
    std::vector<std::string> inputs = recordings;
    inputs.push_back(o_.cell);
    o_.output.protect(inputs, files_of_results(o_));
    const files::CellFile cell = files::read_cell(o_.cell);
    std::error_code error;
    if (!o_.out.empty()) std::filesystem::create_directories(o_.out, error);
    if (error) {
      throw files::BadInput(o_.out, 1, "cannot be created (" + error.message() + "), expected a folder to write to");
    }
    if (o_.diagnose_paper) {
      diagnose_paper(o_, cell);
      return 0;
    }
    write(o_, recordings, compute(o_, cell, recordings));
    return 0;
  }

 private:
  StudyOptions o_;
};

}  // namespace

std::unique_ptr<Command> study_command() { return std::make_unique<StudyCommand>(); }

}  // namespace bms::tool
