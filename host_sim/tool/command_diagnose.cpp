// bms diagnose: where a calibrated cell and its recordings disagree, and which physics or instrument fault causes it.
#include <cmath>
#include <csignal>
#include <string_view>

#include <fmt/format.h>

#include "diagnosis/pack/pack_texts.hpp"
#include "diagnosis/texts.hpp"
#include "files/bad_input.hpp"
#include "reports/diagnosis_charts.hpp"
#include "reports/diagnosis_page.hpp"
#include "reports/json_cell.hpp"
#include "reports/pack_results.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"
#include "workflow/diagnose_recordings.hpp"
#include "workflow/holdout_judgement.hpp"
#include "workflow/next_steps.hpp"
#include "workflow/pack_diagnosis.hpp"

namespace bms::tool {

namespace {

constexpr int exit_interrupted = 130;  ///< as a shell reports a program that Ctrl-C ended
volatile std::sig_atomic_t interrupts = 0;

/// The first Ctrl-C ends the search and says what was tried, the second one ends the program.
void on_interrupt(int) {
  interrupts = 1;
  static_cast<void>(std::signal(SIGINT, SIG_DFL));
}

std::string progress_line(double done, double left_s, const std::string& what) {
  return std::isfinite(left_s) ? fmt::format("{:3.0f} %, about {:.0f} s left: {:40}", 100 * done, left_s, what) : "";
}

/// A finding with its parameters, one line each.
std::string finding_text(const diagnosis::Diagnosis& d, const diagnosis::Finding& f) {
  const model::MechanismInfo& info = model::catalogue[f.setting.index];
  std::string text;
  for (std::size_t k = 0; k < info.parameters; ++k) {
    text +=
        fmt::format("  {:24} {:24} {:10.5g}{} {}\n", k == 0 ? info.id : "", info.parameter[k].name, f.setting.value[k],
                    f.setting.deviation[k] > 0 ? fmt::format(" +- {:.2g}", f.setting.deviation[k]) : "",
                    info.parameter[k].unit == "1" ? "" : info.parameter[k].unit);
  }
  for (const std::string& at : at_temperature_text(d, f.resistances)) text += fmt::format("  {:24} {}\n", "", at);
  if (!f.because.empty()) text += "  " + f.because + "\n";
  return text;
}

std::string comparison_text(const workflow::DiagnoseResult& r) {
  std::string text;
  if (r.diagnosis.interrupted) return text;
  if (r.baseline && r.extended && r.named()) {
    const std::string after = diagnosis::millivolts(r.extended->rmse_v),
                      adjusted = diagnosis::millivolts(r.diagnosis.unexplained_rmse_v);
    text += fmt::format("Open-loop error: {:.2f} mV RMS before, {:.2f} mV with the findings", 1e3 * r.baseline->rmse_v,
                        1e3 * r.extended->rmse_v);
    if (after != adjusted)
      text += fmt::format(
          "; {} remain where also the start and the current sensor's zero of these recordings are adjusted within "
          "their tolerance",
          adjusted);
    text += ".\n";
  }
  if (r.baseline_holdout && r.extended_holdout) {
    text += fmt::format(
        "On the hold-out recordings: {:.2f} mV RMS before, {:.2f} mV after; the noise floor is "
        "{:.2f} mV.\n",
        1e3 * r.baseline_holdout->rmse_v, 1e3 * r.extended_holdout->rmse_v, 1e3 * r.diagnosis.noise_floor_v);
  }
  for (const std::string& line : reports::interval_texts(r)) text += line + "\n";
  if (r.soc) {
    text += fmt::format("Error of their estimated state of charge: {:.2f} % RMS before, {:.2f} % after.\n",
                        100 * r.soc->baseline_rmse, 100 * r.soc->extended_rmse);
  }
  return text;
}

/// What the log's own state of charge is, if it is not a count; empty otherwise.
std::string soc_column_line(const std::vector<measurement::Warning>& warnings) {
  for (const measurement::Warning& w : warnings) {
    if (w.id == "soc_column") return w.text + "\n";
  }
  return {};
}

std::string summary(const workflow::DiagnoseResult& r) {
  std::string text = fmt::format("{}: {}\n", name_of(r.diagnosis.verdict), r.diagnosis.statement);
  text += soc_column_line(r.warnings);
  if (r.named()) {
    for (const diagnosis::Finding& f : r.diagnosis.findings) text += finding_text(r.diagnosis, f);
  }
  if (r.diagnosis.resistances) {
    for (const std::string& at : at_temperature_text(r.diagnosis, r.diagnosis.resistances->cell))
      text += diagnosis::capitalised(at) + ".\n";
  }
  std::string_view indent;
  for (const std::string& step : workflow::next_steps(r)) {
    text += fmt::format("{}{}\n", indent, step);
    indent = "  ";
  }
  text += comparison_text(r);
  if (!r.out.empty()) text += "Cell file: " + r.out + "\n";
  text.pop_back();
  return text;
}

/// The findings of a pack, a few lines each.
std::string pack_summary(const workflow::PackResult& r) {
  namespace dp = diagnosis::pack;
  std::string text = fmt::format("{}: ", name_of(r.diagnosis.verdict));
  if (r.diagnosis.findings.empty()) text += r.diagnosis.statement;
  for (const dp::PackFinding& f : r.diagnosis.findings) {
    text += "\n" + dp::sentence_of(f) + "\n";
    if (f.cause != dp::Cause::shared && !f.because.empty()) text += "  " + f.because + "\n";
    if (!f.rivals.empty()) text += "  " + dp::rivals_text(f) + "\n";
    if (f.after_s) text += "  " + dp::time_text(f) + "\n";
    if (const std::string_view action = dp::text_of(f.cause).action; !action.empty())
      text += fmt::format("  {}\n", action);
  }
  if (text.back() != '\n') text += '\n';
  if (!r.diagnosis.findings.empty() && !r.diagnosis.unexplained.empty()) text += r.diagnosis.statement + '\n';
  text += soc_column_line(r.warnings);
  return text + "All cells together: " + r.shared + "\n" + dp::limits_text(r.diagnosis);
}

class DiagnoseCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "diagnose",
        "Find where a calibrated cell model and its recordings disagree, and which physics or instrument fault causes "
        "it");
    c.footer(
        "Example: bms diagnose --cell my_cell.toml --recording monday.csv --holdout tuesday.csv --initial-soc 0.95 "
        "--out extended.toml --report monday.html");
    CLI::Option_group& which = *c.add_option_group("cell or pack");
    which.add_option("--cell", o_.cell, cell_help("the calibrated cell"));
    which.add_option(
        "--pack", pack_,
        "the calibrated cell of a pack in series, as --cell: compares the cells v_1 to v_N of one recording "
        "with each other and names the cell, channel, connection or sensor that is at fault");
    which.require_option(1);
    c.add_option("--recording,recording", o_.recordings, "recordings to diagnose, the earliest first")
        ->required()
        ->type_name("FILE");
    c.add_option("--holdout", o_.holdouts,
                 "later recordings of the same cell and instruments; they are only compared with the result")
        ->type_name("FILE");
    c.add_option(
         "--initial-soc", o_.initial_soc,
         "state of charge at the start: one for all recordings, or one for each recording and then for each "
         "hold-out; a start that is not given is the first value of soc_ref, or else an estimate from the first "
         "voltage")
        ->check(Within(0.0, 1.0));
    c.add_option("--out", out_, "cell file to write, with the findings")->type_name("EXTENDED.toml");
    c.add_option("--false-alarm-rate", false_alarm_rate_,
                 "how often a healthy recording may be blamed where the [healthy] of the cell file decides (bms "
                 "identify --healthy)")
        ->check(Within(1e-4, 0.5))
        ->capture_default_str();
    add_reading(c, o_.reading);
    o_.reading.refuse_doubtful = false;  // a fault of the data is an answer of the diagnosis
    add_output(c, output_);
    return &c;
  }

  int run() override { return pack_.empty() ? run_cell() : run_pack(); }

 private:
  int run_pack() {
    if (o_.recordings.size() != 1 || !o_.holdouts.empty() || !out_.empty() || o_.initial_soc.size() > 1)
      throw files::BadInput("--pack", 1, "one recording with at most one --initial-soc, without --holdout and --out");
    output_.protect({pack_, o_.recordings.front()});
    complete_reading(o_.reading);
    workflow::PackOptions options;
    options.reading = o_.reading;
    options.cell = pack_;
    options.recording = o_.recordings.front();
    if (!o_.initial_soc.empty()) options.initial_soc = o_.initial_soc.front();
    options.progress = progress_on_stderr(0.1, progress_line);
    const workflow::PackResult result = workflow::diagnose_pack(options);
    print_read_as(output_, result.recording);
    for (const measurement::Warning& w : result.warnings) warn(w.text);
    if (!output_.json.empty()) write_output(output_.json, reports::json_of(result));
    if (!output_.report.empty()) write_output(output_.report, reports::pack_report(result));
    print_summary(output_, pack_summary(result));
    return 0;
  }

  int run_cell() {
    output_.set_own(out_);
    std::vector<std::string> inputs = {o_.cell};
    inputs.insert(inputs.end(), o_.recordings.begin(), o_.recordings.end());
    inputs.insert(inputs.end(), o_.holdouts.begin(), o_.holdouts.end());
    output_.protect(inputs);
    complete_reading(o_.reading);
    diagnosis::Options options;
    options.progress = progress_on_stderr(0.1, progress_line);
    options.false_alarm_rate = false_alarm_rate_;
    options.stopped = [] { return interrupts != 0; };
    static_cast<void>(std::signal(SIGINT, on_interrupt));
    workflow::DiagnoseInput input = workflow::read_diagnose_input(o_);
    for (const workflow::RecordingComparison& of : input.recordings) print_read_as(output_, of.recording);
    for (const measurement::Warning& w : input.notes) print_note(output_, w.text);
    for (const measurement::Warning& w : input.warnings) warn(w.text);  // before the search: it may be in vain
    const std::size_t said = input.warnings.size();
    workflow::DiagnoseResult result = workflow::diagnose_recordings(std::move(input), options);
    const bool unfinished = result.diagnosis.interrupted;
    if (unfinished) {
      result.warnings.push_back({"interrupted", "stopped by Ctrl-C: no cell file was written"});
    } else {
      workflow::add_next_experiment(o_, result);
      workflow::judge_holdouts(o_, options, result);
      result.out = out_;
    }
    for (std::size_t k = said; k < result.warnings.size(); ++k) warn(result.warnings[k].text);
    if (!out_.empty() && !unfinished) write_output(out_, files::cell_text(result.extended_cell));
    if (!output_.json.empty()) write_output(output_.json, reports::json_of(result));
    if (!output_.report.empty()) write_output(output_.report, reports::diagnosis_report(result));
    print_summary(output_, summary(result));
    return unfinished ? exit_interrupted : 0;
  }

  workflow::DiagnoseOptions o_;
  std::string out_, pack_;
  double false_alarm_rate_ = 0.01;
  Output output_;
};

}  // namespace

std::unique_ptr<Command> diagnose_command() { return std::make_unique<DiagnoseCommand>(); }

}  // namespace bms::tool
