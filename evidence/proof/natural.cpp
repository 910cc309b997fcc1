// Faults that nobody put in: real recordings in which something is wrong that a second instrument, a withheld
// thermocouple or a later test has measured. The cell file comes from healthy recordings of the same cell. Each
// recording is diagnosed alone, with its reference columns, and together with others: more data must not make the
// answer worse.
//
// Exit code: 0 done; 2 bad usage or a file that cannot be read; 3 internal error
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "diagnosis/diagnose.hpp"
#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "files/run_program.hpp"
#include "files/text_file.hpp"
#include "proof/natural_judge.hpp"
#include "proof/natural_truth.hpp"
#include "proof/not_run.hpp"
#include "proof/real_cell.hpp"
#include "workflow/diagnose_recordings.hpp"

namespace {

using bms::diagnosis::PreparedRecording;
using bms::measurement::Recording;
using bms::proof::Answer;
using bms::proof::Given;
using bms::proof::Judgement;
using bms::proof::NaturalCase;
using bms::proof::NotRun;
using bms::proof::Outcome;
using bms::proof::Prepared;
using bms::proof::RealSet;
using bms::proof::Truth;

struct Options {
  std::string data = "../shared/data", sets = "evidence/proof/semi_real.toml", list = "evidence/proof/natural.toml",
              only, json;
  bool set_aside = false, all = false, alone = false;
};

struct Result {
  NaturalCase of;
  Given given;
  std::vector<Truth> truths;
  Answer answer;
  Judgement judgement;
  bool worse = false;  ///< than with fewer data
  double wall_s = 0;
};

std::vector<NaturalCase> read_cases(bms::files::TomlTable& list) {
  std::vector<NaturalCase> cases;
  for (bms::files::TomlTable& t : list.tables("case")) {
    NaturalCase c;
    const auto text = [&](const char* key) { return t.has(key) ? t.text(key) : std::string(); };
    const auto texts = [&](const char* key) { return t.has(key) ? t.texts(key) : std::vector<std::string>(); };
    c.set = t.text("set");
    c.recording = t.text("recording");
    c.name = t.text("name");
    c.truths = t.texts("truth");
    c.set_aside = t.flag("set_aside");
    c.current = text("current");
    c.voltage = text("voltage");
    c.second = text("second");
    c.before = text("before");
    c.cycles = text("cycles");
    c.references = texts("references");
    c.also = texts("also");
    if (t.has("within")) c.within = t.number("within");
    if (t.has("without_temperature")) c.without_temperature = t.flag("without_temperature");
    t.finish();
    cases.push_back(std::move(c));
  }
  return cases;
}

std::string join(const std::vector<std::string>& list) {
  std::string text;
  for (const std::string& s : list) text += (text.empty() ? "" : ", ") + s;
  return text;
}

Recording read(const Options& o, const std::string& name, const bms::files::CellFile& cell) {
  bms::files::ReadOptions reading;
  reading.keep_all = true;
  return bms::workflow::read_for_diagnosis((std::filesystem::path(o.data) / name).string(), reading, cell);
}

/// Fewer data first.
std::vector<Given> variants(const Options& o, const NaturalCase& c) {
  std::vector<Given> list = {{}};
  if (o.alone) return list;
  const bool references = !c.references.empty(), second = !c.second.empty(), before = !c.before.empty();
  if (references) list.push_back({.references = true});
  if (second) list.push_back({.second = true});
  if (before) list.push_back({.before = true});
  if (references && second) list.push_back({.references = true, .second = true});
  if (references && before) list.push_back({.references = true, .before = true});
  return list;
}

bool has_fewer(const Given& a, const Given& b) {
  return a.references <= b.references && a.second <= b.second && a.before <= b.before;
}

Result run(const Options& o, const NaturalCase& c, const RealSet& set, const bms::files::CellFile& cell,
           const Given& given) {
  const auto begin = std::chrono::steady_clock::now();
  Result r{c, given, {}, {}, {}, false, 0};
  const Recording whole = read(o, c.recording, cell);
  r.truths = truths_of(c, whole, o.data, set.calibration, given);
  std::vector<PreparedRecording> records;
  const auto add = [&](const Recording& recording, const std::string& name) {
    records.push_back(bms::workflow::prepared(recording, name, cell, bms::workflow::start_of(recording, cell)).record);
  };
  if (given.before) add(read(o, c.before, cell), c.before);
  add(as_given(whole, c, given.references), c.recording);
  if (given.second) add(as_given(read(o, c.second, cell), c, given.references), c.second);
  bms::diagnosis::Options options;
  options.healthy = cell.healthy;
  r.answer = answer_of(bms::diagnosis::diagnose(cell.parameters, cell.mechanisms, records, options), records, r.truths);
  r.judgement = judge(r.answer, r.truths, c.also);
  r.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return r;
}

std::string truth_text(const Result& r) {
  std::string text;
  for (const Truth& t : r.truths)
    text += fmt::format("{}{} {:.4g}{}{} ({})", text.empty() ? "" : ", ", t.what, t.value, t.unit.empty() ? "" : " ",
                        t.unit, t.visible ? t.how : "no second instrument given");
  return text.empty() ? "nothing" : text;
}

std::string said(const Result& r) {
  std::string text = r.answer.verdict;
  for (const auto& cause : r.answer.causes) {
    text += (&cause == &r.answer.causes.front() ? " " : " + ") + cause.front().id;
    if (cause.size() > 1) text += fmt::format(" (or {} others)", cause.size() - 1);
  }
  if (!r.answer.data_faults.empty()) text += " " + join(r.answer.data_faults);
  for (const auto& [what, limit] : r.answer.limits) {
    if (r.answer.causes.empty()) text += fmt::format(", {} from {:.2g}", what, limit);
  }
  return text;
}

void print_line(const Result& r) {
  fmt::print("| {} | {} | {} | {} | {} | **{}**{}{}{} | {:.1f} |\n", r.of.name, name_of(r.given), truth_text(r),
             said(r), r.judgement.sizes, name_of(r.judgement.outcome), r.judgement.why.empty() ? "" : ": ",
             r.judgement.why, r.worse ? "; worse with more data" : "", r.wall_s);
  std::fflush(stdout);
}

/// Right ones, and what else, of one kind of truth and one half of the cells.
void print_counts(const std::vector<Result>& results) {
  fmt::print(
      "\n| truth | cells | cases | diagnoses | right | size off | undecided | wrong | worse with more data |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
  std::map<std::pair<std::string, bool>, std::vector<const Result*>> groups;
  for (const Result& r : results) {
    groups[{join(r.of.truths), r.of.set_aside}].push_back(&r);
    groups[{"~ all", r.of.set_aside}].push_back(&r);
  }
  for (const auto& [key, group] : groups) {
    std::map<Outcome, int> count;
    int worse = 0, cases = 0;
    for (const Result* r : group) {
      ++count[r->judgement.outcome];
      worse += r->worse ? 1 : 0;
      cases += has_fewer(r->given, {}) ? 1 : 0;
    }
    fmt::print("| {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", key.first, key.second ? "set aside" : "development",
               cases, group.size(), count[Outcome::right], count[Outcome::size_off], count[Outcome::undecided],
               count[Outcome::wrong], worse);
  }
}

nlohmann::ordered_json counts_of(const std::vector<Result>& results, const std::function<bool(const Given&)>& which) {
  std::map<Outcome, std::size_t> count;
  std::size_t cases = 0;
  for (const Result& r : results) {
    if (!which(r.given)) continue;
    ++cases;
    ++count[r.judgement.outcome];
  }
  return {{"cases", cases},
          {"right", count[Outcome::right]},
          {"size_off", count[Outcome::size_off]},
          {"undecided", count[Outcome::undecided]},
          {"wrong", count[Outcome::wrong]}};
}

/// Each case counts once, by the answer to its recording alone. The groups count diagnoses.
nlohmann::ordered_json json_of_counts(const std::vector<Result>& results) {
  const auto alone = [](const Given& g) { return !g.references && !g.second && !g.before; };
  nlohmann::ordered_json json = counts_of(results, alone);
  json["alone"] = counts_of(results, alone);
  json["with_recordings"] = counts_of(results, [](const Given& g) { return !g.references && (g.second || g.before); });
  json["with_references"] = counts_of(results, [](const Given& g) { return g.references; });
  return json;
}

std::string json_of(const std::vector<Result>& results, const NotRun& not_run) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Result& r : results)
    list.push_back({{"case", r.of.name},
                    {"kind", "natural"},
                    {"set_aside", r.of.set_aside},
                    {"given", name_of(r.given)},
                    {"truth", truth_text(r)},
                    {"said", said(r)},
                    {"sizes", r.judgement.sizes},
                    {"outcome", name_of(r.judgement.outcome)},
                    {"why", r.judgement.why},
                    {"worse_with_more_data", r.worse},
                    {"wall_s", r.wall_s}});
  const nlohmann::ordered_json json = {{"natural", json_of_counts(results)},
                                       {"skipped", not_run.skipped},
                                       {"without_cell_file", not_run.without_cell_file},
                                       {"results", list}};
  return json.dump(1) + "\n";
}

/// The cases that are to be run, each with its set.
struct Work {
  std::vector<std::pair<NaturalCase, RealSet>> cases;
  NotRun not_run;
};

std::vector<std::string> files_of(const NaturalCase& c, const RealSet& set) {
  std::vector<std::string> files = files_of(set);
  for (const std::string& name : {c.recording, c.second, c.before, c.cycles}) {
    if (!name.empty()) files.push_back(name);
  }
  return files;
}

Work read_work(const Options& o) {
  const auto table = [](const std::string& path) {
    return bms::files::TomlTable::parse(bms::files::read_file(path), path, "a list of recordings");
  };
  bms::files::TomlTable shared = table(o.sets), own = table(o.list);
  std::vector<RealSet> sets = bms::proof::read_sets(shared);
  for (RealSet& s : bms::proof::read_sets(own)) sets.push_back(std::move(s));
  std::vector<NaturalCase> cases = read_cases(own);
  own.finish();
  Work work;
  bms::proof::Present present(o.data);
  for (NaturalCase& c : cases) {
    if (c.name.find(o.only) == std::string::npos || (!o.all && c.set_aside != o.set_aside)) continue;
    const auto set = std::find_if(sets.begin(), sets.end(), [&](const RealSet& s) { return s.name == c.set; });
    if (set == sets.end()) throw bms::files::BadInput(o.list, 1, "no set '" + c.set + "', expected one of the lists");
    if (present.has(c.name, files_of(c, *set))) work.cases.emplace_back(std::move(c), *set);
  }
  work.not_run.skipped = present.skipped();
  fmt::print(stderr, "{}", present.skipped_text("cases"));
  return work;
}

void run_all(const Options& o) {
  Work work = read_work(o);
  std::map<std::string, std::optional<Prepared>> prepared_sets;
  std::vector<Result> results;
  std::size_t at = 0;
  fmt::print("| case | given | truly there | said | size | judged | s |\n|---|---|---|---|---|---|---|\n");
  for (const auto& [c, set] : work.cases) {
    fmt::print(stderr, "case {} of {}: {}\n", ++at, work.cases.size(), c.name);
    auto& prepared = prepared_sets[c.set];
    try {
      if (!prepared) prepared = prepare(o.data, set, true);
    } catch (const std::runtime_error& error) {  // no cell file, no case
      fmt::print("| {} | - | - | no cell file: {} | | | |\n", c.name, error.what());
      ++work.not_run.without_cell_file;
      continue;
    }
    const std::size_t first = results.size();
    for (const Given& given : variants(o, c)) {
      Result r = run(o, c, set, prepared->cell, given);
      for (std::size_t k = first; k < results.size(); ++k)
        r.worse |= has_fewer(results[k].given, given) && made_worse(results[k].judgement, r.judgement);
      print_line(r);
      results.push_back(std::move(r));
    }
  }
  print_counts(results);
  if (!o.json.empty()) bms::files::write_file(o.json, json_of(results, work.not_run));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Diagnose real recordings with faults that nobody put in, next to the measurement that was withheld"};
  app.name("natural");
  app.footer("Example: natural --data ../shared/data --only B0025");
  Options o;
  app.add_option("--data", o.data, "folder with the recordings")->capture_default_str()->type_name("FOLDER");
  app.add_option("--list", o.list, "cases, and sets of their own")->capture_default_str()->type_name("FILE");
  app.add_option("--sets", o.sets, "sets of recordings")->capture_default_str()->type_name("FILE");
  app.add_option("--only", o.only, "run only cases whose name contains TEXT")->type_name("TEXT");
  app.add_option("--json", o.json, "write every result to FILE")->type_name("FILE");
  app.add_flag("--set-aside", o.set_aside, "run the cells that decided nothing instead of those of the development");
  app.add_flag("--all", o.all, "run both");
  app.add_flag("--alone", o.alone, "diagnose each recording alone only");
  return bms::files::run_program(app, argc, argv, [&] { run_all(o); });
}
