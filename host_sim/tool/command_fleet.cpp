// bms fleet: a task on every recording of a depot, the table of all results, and what it means.
#include <atomic>
#include <csignal>
#include <filesystem>
#include <thread>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/bad_input.hpp"
#include "fleet/analysis.hpp"
#include "fleet/run.hpp"
#include "fleet/slurm.hpp"
#include "fleet/table.hpp"
#include "numerics/in_parallel.hpp"
#include "reports/fleet_page.hpp"
#include "reports/fleet_texts.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

using files::BadInput;

volatile std::sig_atomic_t interrupts = 0;
void on_interrupt(int) { interrupts = 1; }

/// Without SA_RESTART: waiting for a unit ends.
void stop_on_interrupt() {
  struct sigaction action {};
  action.sa_handler = on_interrupt;
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
}

std::string progress_line(double done, double left_s, const std::string& what) {
  return fmt::format("{:3.0f} %, about {:.0f} s left: {:30}", 100 * done, left_s, what);
}

/// "Verdicts: 30 NO_MISMATCH, 3 CAUSE, 1 without a verdict.", the most frequent first.
std::string verdicts_text(const fleet::MergeCounts& merged) {
  std::vector<std::pair<std::string, std::size_t>> order(merged.verdicts.begin(), merged.verdicts.end());
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  std::string text;
  std::size_t all = 0;
  for (const auto& [verdict, count] : order) {
    text += fmt::format("{} {} {}", text.empty() ? "Verdicts:" : ",", count, verdict);
    all += count;
  }
  if (merged.recordings > all) text += fmt::format(", {} without a verdict", merged.recordings - all);
  return text + ".";
}

struct FleetOptions {
  std::string manifest, task, out, cell = "table9", pages = "all", part;
  std::vector<std::string> arguments;
  std::size_t jobs = std::max(1U, std::thread::hardware_concurrency());
  std::string engine = "local";
  bool dry_run = false;
  fleet::SlurmOptions slurm;
  fleet::AnalysisOptions analysis;
  Output output;
};

/// "3/16": every 16th unit, from the third, counted from 0.
void set_part(const std::string& text, fleet::RunOptions& options) {
  if (text.empty()) return;
  const std::size_t slash = text.find('/');
  try {
    options.part = std::stoul(text.substr(0, slash));
    options.parts = slash == std::string::npos ? 0 : std::stoul(text.substr(slash + 1));
  } catch (const std::exception&) {
    options.parts = 0;
  }
  if (options.part >= options.parts)
    throw BadInput("--part", 1, "'" + text + "' is not a part, expected one like 0/16 to 15/16");
}

fleet::Depot depot_of(const FleetOptions& o) {
  fleet::Depot depot;
  depot.folder = std::filesystem::absolute(o.out).lexically_normal();
  depot.task = fleet::task_of(o.task);
  depot.arguments = o.arguments;
  depot.version = BMS_VERSION;
  for (const fleet::Pages pages : {fleet::Pages::all, fleet::Pages::found, fleet::Pages::none}) {
    if (o.pages == name_of(pages)) depot.pages = pages;
  }
  return depot;
}

class RunAction {
 public:
  explicit RunAction(FleetOptions& options) : o_(options) {}

  CLI::App* add(CLI::App& fleet) {
    CLI::App& c = *fleet.add_subcommand("run", "Run a task on every recording that has no result yet; then merge");
    c.footer(
        "Example: bms fleet run --manifest depot.csv --task diagnose --out depot -- --initial-soc 0.95\n"
        "Options of the task follow after --. A manifest has the columns recording,cell,truck,cell_index,started_at.");
    c.add_option("--manifest", o_.manifest, "table of recordings, a folder, or a pattern in quotes")
        ->required()
        ->check(not_empty());
    c.add_option("--task", o_.task, "replay, identify or diagnose")
        ->required()
        ->check(CLI::IsMember({"replay", "identify", "diagnose"}));
    c.add_option("--out", o_.out, "folder of the results")->required()->check(not_empty())->type_name("DIR");
    c.add_option("--cell", o_.cell, cell_help("of recordings for which the manifest names no cell"))
        ->capture_default_str();
    jobs_ = c.add_option("--jobs", o_.jobs, "recordings at a time; with slurm 1 if not given")
                ->check(CLI::Range(1, 1'024))
                ->capture_default_str();
    c.add_option("--pages", o_.pages, "recordings with a page of their own: all, those with a finding, or none")
        ->check(CLI::IsMember({"all", "found", "none"}))
        ->capture_default_str();
    c.add_option("--part", o_.part, "only every N-th recording, from the K-th; does not merge")->type_name("K/N");
    c.add_option("arguments", o_.arguments, "options of the task, after --");
    add_slurm(c);
    add_json(c, o_.output);
    return &c;
  }

  int run() {
    if (o_.engine == "slurm") return run_slurm();
    fleet::RunOptions options;
    set_part(o_.part, options);
    const fleet::Depot depot = depot_of(o_);
    open_depot(depot);
    std::error_code error;
    const bool own = std::filesystem::equivalent(o_.manifest, depot.manifest(), error);
    const std::size_t units = own ? 0 : fleet::write_manifest(o_.manifest, o_.cell, depot.manifest());
    stop_on_interrupt();
    const auto progress = progress_on_stderr(0.5, progress_line);
    options.program = std::filesystem::read_symlink("/proc/self/exe");
    options.jobs = o_.jobs;
    options.processors = std::max<std::size_t>(1, numerics::best_pieces() / std::max<std::size_t>(1, o_.jobs));
    options.stopped = [] { return interrupts != 0; };
    options.done = [&](std::size_t done) {
      if (progress && units > 0) progress(static_cast<double>(done) / static_cast<double>(units), depot.folder);
    };
    const fleet::RunCounts counts = run_units(depot, options);
    fleet::MergeCounts merged;
    if (interrupts == 0 && o_.part.empty()) merged = merge(depot);
    return report(depot, counts, merged);
  }

 private:
  void add_slurm(CLI::App& c) {
    c.add_option("--engine", o_.engine, "local: this computer; slurm: a job array and a job that merges")
        ->check(CLI::IsMember({"local", "slurm"}))
        ->capture_default_str();
    c.add_flag("--dry-run", o_.dry_run, "slurm: print the scripts and submit nothing");
    c.add_option("--units-per-task", o_.slurm.units_per_task, "slurm: recordings for each task of the array")
        ->check(CLI::Range(1, 1'000'000))
        ->capture_default_str();
    c.add_option("--most-tasks", o_.slurm.most_tasks, "slurm: largest array that the cluster takes")
        ->check(CLI::Range(1, 1'000'000))
        ->capture_default_str();
    c.add_option("--at-once", o_.slurm.at_once, "slurm: tasks at the same time; 0: no limit");
    c.add_option("--partition", o_.slurm.partition, "slurm: partition");
    c.add_option("--time", o_.slurm.time_limit, "slurm: limit of a task, such as 02:00:00");
    c.add_option("--memory", o_.slurm.memory, "slurm: memory of a task, such as 2G");
    c.add_option("--module", o_.slurm.modules, "slurm: module to load, repeatable")
        ->allow_extra_args(false)
        ->take_all();
    c.add_option("--sbatch", o_.slurm.sbatch, "slurm: further option of sbatch, such as --sbatch=--account=bms")
        ->allow_extra_args(false)
        ->take_all();
  }

  int run_slurm() {
    if (!o_.part.empty()) throw BadInput("--part", 1, "set by the job array, expected no --part");
    const fleet::Depot depot = depot_of(o_);
    open_depot(depot);
    const std::size_t units = fleet::write_manifest(o_.manifest, o_.cell, depot.manifest());
    // one process at a time is what a cluster counts on
    o_.slurm.jobs = jobs_->count() > 0 ? o_.jobs : 1;
    const fleet::SlurmScripts scripts =
        slurm_scripts(depot, std::filesystem::read_symlink("/proc/self/exe"), units, o_.slurm);
    if (o_.dry_run) {
      print_summary(o_.output, scripts.units + "\n" + scripts.merge);
      return 0;
    }
    const fleet::SlurmJobs jobs = submit(depot, scripts);
    const nlohmann::ordered_json json = {{"command", "fleet run"},  {"engine", "slurm"},
                                         {"recordings", units},     {"tasks", scripts.tasks},
                                         {"array_job", jobs.array}, {"merge_job", jobs.merge}};
    if (!o_.output.json.empty()) write_output(o_.output.json, json.dump(1) + "\n");
    print_summary(o_.output,
                  fmt::format("{} recordings in {} tasks: job {}; job {} merges them into {}.", units, scripts.tasks,
                              jobs.array, jobs.merge, (depot.folder / "fleet.sqlite").string()));
    return 0;
  }

  int report(const fleet::Depot& depot, const fleet::RunCounts& counts, const fleet::MergeCounts& merged) {
    const nlohmann::ordered_json json = {
        {"command", "fleet run"},     {"task", name_of(depot.task)},       {"out", depot.folder.string()},
        {"recordings", counts.units}, {"finished_before", counts.skipped}, {"ran", counts.ran},
        {"errors", counts.errors},    {"unfinished", counts.unfinished},   {"rows", merged.rows},
        {"verdicts", merged.verdicts}};
    if (!o_.output.json.empty()) write_output(o_.output.json, json.dump(1) + "\n");
    print_summary(o_.output,
                  fmt::format("{} recordings: {} finished before, {} now, {} of these with an error{}.", counts.units,
                              counts.skipped, counts.ran, counts.errors,
                              counts.unfinished > 0 ? fmt::format("; {} are not finished", counts.unfinished) : ""));
    if (merged.errors > 0)
      warn(fmt::format("{} of {} recordings have an error; the rows of fleet.csv say which", merged.errors,
                       merged.recordings));
    if (!merged.verdicts.empty()) print_summary(o_.output, verdicts_text(merged));
    if (interrupts != 0 || counts.unfinished > 0)
      warn("not all recordings are finished; the same command continues with those that are not");
    if (interrupts == 0 && o_.part.empty())
      print_summary(o_.output, "Table: " + (depot.folder / "fleet.sqlite").string() + " and fleet.csv");
    return interrupts != 0 || counts.unfinished > 0 ? 1 : 0;
  }

  FleetOptions& o_;
  CLI::Option* jobs_ = nullptr;
};

class FleetCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand("fleet", "Run a task on many recordings of a depot and compare the results");
    c.footer("Example: bms fleet run --manifest depot.csv --task diagnose --out depot");
    c.require_subcommand(1);
    run_ = action_.add(c);
    merge_ = c.add_subcommand("merge", "Write the table of all results again, also of an unfinished run");
    merge_->footer("Example: bms fleet merge depot");
    merge_->add_option("folder", o_.out, "folder of the results")->required()->check(not_empty())->type_name("DIR");
    add_json(*merge_, o_.output);
    report_ = c.add_subcommand("report", "Say what to visit first and why, how cells age, and list every recording");
    report_->footer("Example: bms fleet report depot --report depot.html");
    report_->add_option("folder", o_.out, "folder of the results")->required()->check(not_empty())->type_name("DIR");
    report_
        ->add_option("--false-discovery-rate", o_.analysis.false_discovery_rate,
                     "share of the places to visit that may be healthy")
        ->check(Within(1e-6, 0.5))
        ->capture_default_str();
    report_->add_option("--resistance-limit", o_.analysis.resistance_limit, "growth at which a cell is replaced")
        ->check(Within(0.01, 10.0))
        ->capture_default_str();
    report_->add_option("--capacity-limit", o_.analysis.capacity_limit, "loss at which a cell is replaced")
        ->check(Within(0.01, 0.9))
        ->capture_default_str();
    add_output(*report_, o_.output);
    return &c;
  }

  int run() override {
    if (run_->parsed()) return action_.run();
    return report_->parsed() ? run_report() : run_merge();
  }

 private:
  int run_report() {
    const fleet::Depot depot = fleet::read_depot(std::filesystem::absolute(o_.out).lexically_normal(), BMS_VERSION);
    const auto table = depot.folder / "fleet.sqlite";
    o_.output.set_own("");
    o_.output.protect({table.string(), (depot.folder / "fleet.csv").string(), depot.manifest().string()});
    if (depot.task != fleet::Task::diagnose)
      throw BadInput(depot.folder.string(), 1,
                     std::string("holds results of the task ") + name_of(depot.task) + ", expected those of diagnose");
    const fleet::History history = fleet::read_history(table);
    const fleet::Analysis analysis = analyse(history, o_.analysis);
    if (!o_.output.json.empty()) write_output(o_.output.json, reports::json_of(history, analysis, o_.analysis));
    if (!o_.output.report.empty()) {
      const auto from = std::filesystem::absolute(o_.output.report).lexically_normal().parent_path();
      write_output(o_.output.report, reports::fleet_report(history, analysis, o_.analysis,
                                                           depot.folder.lexically_relative(from).string()));
    }
    print_summary(o_.output, reports::summary(history, analysis, o_.analysis));
    return 0;
  }

  /// Exit code 1 if a recording has no result.
  int run_merge() {
    const fleet::Depot depot = fleet::read_depot(std::filesystem::absolute(o_.out).lexically_normal(), BMS_VERSION);
    const fleet::MergeCounts counts = merge(depot);
    const nlohmann::ordered_json json = {{"command", "fleet merge"},        {"out", depot.folder.string()},
                                         {"recordings", counts.recordings}, {"errors", counts.errors},
                                         {"missing", counts.missing},       {"rows", counts.rows}};
    if (!o_.output.json.empty()) write_output(o_.output.json, json.dump(1) + "\n");
    print_summary(o_.output, fmt::format("{} recordings, {} with an error, {} without a result.", counts.recordings,
                                         counts.errors, counts.missing));
    return counts.missing > 0 ? 1 : 0;
  }

  FleetOptions o_;
  RunAction action_{o_};
  CLI::App* run_ = nullptr;
  CLI::App* merge_ = nullptr;
  CLI::App* report_ = nullptr;
};

}  // namespace

std::unique_ptr<Command> fleet_command() { return std::make_unique<FleetCommand>(); }

}  // namespace bms::tool
