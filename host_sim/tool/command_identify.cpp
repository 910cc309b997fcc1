// bms identify: recordings in, a cell file with uncertainties out.
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "reports/identify_page.hpp"
#include "reports/identify_tables.hpp"
#include "reports/json_cell.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"
#include "tool/progress.hpp"
#include "workflow/identify_cell.hpp"
#include "workflow/learn_healthy.hpp"

namespace bms::tool {

namespace {

namespace id = identification;

/// Options as text; workflow::IdentifyOptions has them parsed.
struct IdentifyTexts {
  std::string model = "nlgr";
  std::string optimizer = "nls";
  std::string initial_soc;              ///< a number, "estimate", or empty: soc_ref if there is one, else estimate
  std::string window, validate_window;  ///< "HI:LO"; empty: all samples, as `window`
};

std::optional<id::LinearKind> linear_kind(const std::string& model) {
  for (const id::LinearKind kind :
       {id::LinearKind::transfer_function, id::LinearKind::output_error, id::LinearKind::hammerstein_wiener}) {
    if (model == workflow::name_of(kind)) return kind;
  }
  return std::nullopt;
}

id::Method method_of(const std::string& name) {
  for (const id::Method m :
       {id::Method::subspace_gauss_newton, id::Method::adaptive_subspace_gauss_newton, id::Method::levenberg_marquardt,
        id::Method::steepest_descent, id::Method::trust_region_reflective}) {
    if (name == id::name_of(m)) return m;
  }
  throw files::BadInput("--optimizer", 1, "no such optimiser '" + name + "', expected one of: gn, agn, lm, sd, nls");
}

/// Candidates with their errors on left-out parts, the chosen circuit, and the held-out recordings.
std::string joint_summary(const workflow::JointResult& joint) {
  const id::StructureChoice& choice = joint.choice;
  std::string text =
      fmt::format("Circuit over all recordings, RMSE in mV with each {} left out in turn:\n", choice.left_out);
  text +=
      fmt::format("  {:5} {:>8} {:>8} {:>8}  {}\n", "", "unknowns", "fit", "left out", fmt::join(choice.parts, ", "));
  for (const id::CandidateResult& c : choice.candidates) {
    text += fmt::format("  {:5} {:8} {:8.2f} {:8.2f} ", c.chosen ? "->" : "", c.unknowns, 1e3 * c.fitted_rmse_v,
                        1e3 * c.left_out_v);
    for (const double v : c.left_out_rmse_v) text += fmt::format(" {:.2f}", 1e3 * v);
    text += "  " + c.name + "\n";
  }
  for (std::size_t k = 0; k < choice.model.unknowns.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    text += fmt::format("  {:50} {:10.5g} +- {:.2g}{}\n", choice.model.unknowns[k].name(), choice.fit.value[i],
                        choice.fit.std[i], choice.fit.at_bound[i] != 0 ? "  at its bound" : "");
  }
  for (std::size_t k = 0; k < joint.recordings.size(); ++k) {
    text += fmt::format("  {}: {:.2f} mV, R0 {:+.0f} %\n", joint.recordings[k], 1e3 * choice.fit.rmse_v[k],
                        100 * choice.fit.states[k].r0_change);
  }
  for (std::size_t k = 0; k < joint.held_out.size(); ++k) {
    const id::LeftOutError& e = joint.held_out[k];
    text += fmt::format("Held out {}: {:.2f} mV RMS.\n", e.name, 1e3 * e.rmse_v);
    if (k < joint.coverage.size()) text += diagnosis::sentence_of(joint.coverage[k], e.name) + "\n";
  }
  return text;
}

std::string grey_box_summary(const id::Identification& found) {
  std::string text = fmt::format(
      "{} samples: {:.2f} mV RMS open loop, fit {:.1f} %, one step ahead with its last error {:.1f} %. {}\n",
      found.estimation.samples, 1e3 * found.estimation.rmse_v, found.estimation.fit_percent,
      found.estimation.corrected_one_step_fit_percent, found.optimum.reason);
  for (const id::Parameter& p : found.parameters) {
    text += fmt::format("  {:8} {:3.0f} %{}  {:10.5g} +- {:.2g}{}\n", p.name, 100 * p.soc,
                        p.temperature_c ? fmt::format(" {:5.1f} C", *p.temperature_c) : "", p.value, p.std,
                        p.at_bound ? "  at its bound" : "");
  }
  return text;
}

/// What the cell file knows of the healthy cell. learned_unasked: from the recordings that it was identified from.
std::string healthy_text(const files::CellFile& cell, bool learned_unasked) {
  if (!cell.healthy.known)
    return "No healthy data: bms diagnose names what this model lacks of a healthy cell as well (--healthy).\n";
  const std::string learned =
      cell.healthy.blocks.empty() ? "none that can be used" : workflow::healthy_summary(cell.healthy);
  return "Healthy data: " + learned +
         (learned_unasked ? ". The recordings were taken for those of a healthy cell; if not: --no-healthy.\n" : ".\n");
}

std::string summary(const workflow::IdentifyResult& result, bool learned_unasked) {
  std::string text = result.joint ? joint_summary(*result.joint) : grey_box_summary(result.identification);
  for (const auto& [path, fit] : result.validations)
    text += fmt::format("Validated on {}: {:.2f} mV RMS, fit {:.1f} %.\n", path, 1e3 * fit.rmse_v, fit.fit_percent);
  if (result.cell_file) text += healthy_text(*result.cell_file, learned_unasked);
  return text + (result.cell.empty() ? "No cell file was written." : "Cell file: " + result.out);
}

class IdentifyCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "identify", "Identify the parameters of a cell, with their standard deviations, from recordings");
    c.footer(
        "Example: bms identify --ocv slow_discharge.csv --ocv slow_charge.csv --recording pulses.csv --validate "
        "shift.csv --start table9 --out my_cell.toml");
    add_inputs(c);
    add_method(c);
    c.add_option("--name", o_.name, "name of the cell; that of the output file if not given");
    c.add_option("--out", o_.out, "cell file to write")->required()->type_name("C.toml");
    CLI::Option& each = *c.add_flag("--each-cell", each_cell_,
                                    "of a pack recording: identify every cell and write OUT_cell1 and so on; without "
                                    "it the mean cell is identified");
    add_reading(c, o_.reading);
    add_output(c, output_);
    CLI::Option& csv =
        *c.add_option("--csv", csv_, "folder for the tables as CSV: parameters, their correlations, pulse resistances")
             ->check(not_empty())
             ->type_name("FOLDER");
    each.excludes(&csv)->excludes("--report")->excludes("--extend")->excludes("--rc")->excludes("--healthy");
    return &c;
  }

  int run() override {
    output_.set_own(o_.out);
    std::vector<std::string> inputs = {o_.start};
    for (const auto* files : {&o_.recordings, &o_.ocv, &o_.validate, &o_.hold_out, &o_.healthy})
      inputs.insert(inputs.end(), files->begin(), files->end());
    output_.protect(inputs);
    complete_reading(o_.reading);
    parse();
    o_.progress = progress_on_stderr(0.2, [](double done, double, const std::string& what) {
      return fmt::format("{:3.0f} %: {:40}", 100 * done, what);
    });
    try {
      return each_cell_ ? identify_each_cell() : write(workflow::identify_cell(o_));
    } catch (const workflow::FailedFit& failed) {
      for (const measurement::Warning& w : failed.warnings) warn(w.text);
      fmt::print(stderr, "{}\n", files::printable(failed.what()));
      return 1;
    }
  }

 private:
  /// Identifies each cell of a pack as if it were alone. Returns the exit code: 1 if a cell has no cell file.
  int identify_each_cell() const {
    const measurement::Recording pack =
        files::read_recording(o_.recordings.front(), files::VoltageColumn::required, o_.reading);
    const std::size_t count = pack.cell_voltage_v.size();
    if (count == 0)
      throw files::BadInput(o_.recordings.front(), 1,
                            "no columns v_1, v_2 and so on, expected the recording of a pack");
    nlohmann::ordered_json cells = nlohmann::ordered_json::array();
    bool all = true;
    for (std::size_t k = 1; k <= count; ++k) {
      workflow::IdentifyOptions one = o_;
      one.reading.map.push_back(fmt::format("voltage_v=v_{}", k));
      const std::filesystem::path out = o_.out;
      one.out =
          (out.parent_path() / fmt::format("{}_cell{}{}", out.stem().string(), k, out.extension().string())).string();
      one.name = fmt::format("{}_cell{}", o_.name, k);
      const workflow::IdentifyResult result = workflow::identify_cell(one);
      all = all && result.cell_file;
      if (result.cell_file) write_output(one.out, files::cell_text(*result.cell_file));
      if (k == 1) {
        for (const measurement::Warning& w : result.warnings) warn(w.text);
      }
      print_summary(output_, cell_line(k, result, one.out));
      auto json = nlohmann::ordered_json::parse(reports::json_of(result));
      json["cell_number"] = k;
      json["out"] = one.out;
      cells.push_back(std::move(json));
    }
    if (!output_.json.empty())
      write_output(output_.json, nlohmann::ordered_json{{"command", "identify"}, {"cells", cells}}.dump(1) + "\n");
    return all ? 0 : 1;
  }

  static std::string cell_line(std::size_t number, const workflow::IdentifyResult& result, const std::string& out) {
    double r0_ohm = 0, r1_ohm = 0, nodes = 0;
    for (const id::Parameter& p : result.identification.parameters) {
      if (p.name == "r0_ohm") r0_ohm += p.value;
      if (p.name == "r1_ohm") r1_ohm += p.value;
      if (p.name == "r0_ohm") ++nodes;
    }
    return fmt::format("cell {:2}: {:.2f} mV RMS, mean R0 {:.4g} mOhm, R1 {:.4g} mOhm{}", number,
                       1e3 * result.identification.estimation.rmse_v, 1e3 * r0_ohm / nodes, 1e3 * r1_ohm / nodes,
                       result.cell_file ? ", " + out : ", no cell file");
  }

  /// Returns the exit code: 1 if there is no cell file.
  int write(const workflow::IdentifyResult& result) const {
    if (result.cell_file) write_output(o_.out, files::cell_text(*result.cell_file));
    for (const std::string& text : result.read_as) {
      if (!output_.quiet) fmt::print(stderr, "{}\n", files::printable(text));
    }
    for (const measurement::Warning& w : result.warnings) warn(w.text);
    const bool shown = !output_.json.empty() || !output_.report.empty() || !csv_.empty();  // else not read again
    const auto pulses = shown ? workflow::recorded_pulses(o_, result) : std::vector<workflow::RecordedPulses>();
    if (!output_.json.empty()) write_output(output_.json, reports::with_pulses(reports::json_of(result), pulses));
    if (!output_.report.empty()) write_output(output_.report, reports::identify_report(result, pulses));
    if (!csv_.empty()) write_csv(result, pulses);
    print_summary(output_, summary(result, learns_unasked_));
    return result.cell_file ? 0 : 1;
  }

  void write_csv(const workflow::IdentifyResult& result, const std::vector<workflow::RecordedPulses>& pulses) const {
    std::error_code error;
    std::filesystem::create_directories(csv_, error);
    if (error)
      throw files::BadInput(csv_, 1, "cannot be created (" + error.message() + "), expected a folder to write to");
    for (const reports::CsvFile& file : reports::identify_csv(result, pulses))
      write_output((std::filesystem::path(csv_) / file.name).string(), file.text);
  }

  void add_inputs(CLI::App& c) {
    c.add_option("--recording,recording", o_.recordings, "recordings to identify from")->required()->type_name("FILE");
    c.add_option("--ocv", o_.ocv, "slow charge and discharge (C/10 or slower) that give the OCV and the capacity")
        ->type_name("FILE");
    c.add_option("--start", o_.start,
                 "cell file to start from: limits, initial values, and everything that is not identified")
        ->capture_default_str();
    c.add_option("--initial-soc", texts_.initial_soc,
                 "state of charge at the start, or 'estimate'; if not given soc_ref, or else an estimate")
        ->type_name("X");
    c.add_option("--window", texts_.window, "range of the state of charge to use, for example 0.8:0.5")
        ->type_name("HI:LO");
    c.add_option("--validate", o_.validate, "recordings to validate on; nothing is identified from them")
        ->type_name("FILE");
    c.add_option("--validate-window", texts_.validate_window, "the same for --validate; as --window if not given")
        ->type_name("HI:LO");
    c.add_option("--filter-hz", o_.filter_hz,
                 "cut-off frequency of a second-order Butterworth low-pass on the current, applied forward and "
                 "backward; no filter if not given")
        ->check(Within(1e-4, 1e3));
    c.add_flag("--remove-offset", o_.remove_offset, "subtract the mean current of the rests");
    c.add_option("--reference-temperature", o_.reference_temperature_c,
                 "temperature in degrees C at which the tables of the cell file are valid; if not given that of "
                 "--start, or of the recordings if they are more than 5 K away from it")
        ->check(Within(model::accepted::reference_temperature_c.low, model::accepted::reference_temperature_c.high));
    c.add_option("--capacity-ah", o_.capacity_ah, "capacity in Ah; that of the OCV recordings if not given")
        ->check(Within(0.01, 1000.0));
    c.add_flag("--ocv-from-rests", o_.ocv_from_rests,
               "take the OCV from the rests of the recordings (ten minutes or more; a pulse test) instead of --ocv");
    c.add_flag("--ocv-from-load", o_.ocv_from_load,
               "take the OCV from discharges under load: the voltage plus the drop over the resistance that the steps "
               "of the current show; needs --initial-soc or soc_ref")
        ->excludes("--ocv-from-rests");
    add_limits(c);
  }

  void add_limits(CLI::App& c) {
    const std::string group = "Limits of use (those of --start for a cell of its size; otherwise derived and named)";
    c.add_option("--chemistry", o_.chemistry, "LFP, NMC, NCA or LTO; by the voltages if not given")
        ->check(CLI::IsMember({"LFP", "NMC", "NCA", "LTO"}))
        ->group(group);
    const auto add = [&](const char* name, std::optional<double>& value, const char* help, double low, double high) {
      c.add_option(name, value, help)->check(Within(low, high))->group(group);
    };
    add("--voltage-min-v", o_.limits.voltage_min_v, "in V", 0.5, 5);
    add("--voltage-max-v", o_.limits.voltage_max_v, "in V", 0.5, 5);
    add("--charge-current-max-a", o_.limits.charge_current_max_a, "continuous, in A", 1e-3, 2'000);
    add("--discharge-current-max-a", o_.limits.discharge_current_max_a, "continuous, in A", 1e-3, 2'000);
    add("--temperature-min-c", o_.limits.temperature_min_c, "in degrees C", -60, 100);
    add("--temperature-max-c", o_.limits.temperature_max_c, "in degrees C", -60, 150);
  }

  void add_method(CLI::App& c) {
    c.add_option("--model", texts_.model,
                 "nlgr: nonlinear grey box; tf: transfer function; oe: output error; hw: Hammerstein-Wiener")
        ->check(CLI::IsMember({"nlgr", "tf", "oe", "hw"}))
        ->capture_default_str();
    c.add_option("--optimizer", texts_.optimizer,
                 "gn, agn: (adaptive) subspace Gauss-Newton; lm: Levenberg-Marquardt; sd: steepest descent; nls: trust "
                 "region, reflective")
        ->capture_default_str();
    c.add_option("--nodes", o_.nodes,
                 "states of charge at which R0, R1, C1 are identified, for example 0.2,0.5,0.8; linear in between")
        ->delimiter(',')
        ->check(Within(0.0, 1.0));
    c.add_flag("--extend", o_.extend,
               "add what an estimator needs: hysteresis between slow charge and discharge, resistances that depend on "
               "the temperature, sensor and model errors as states of the filter");
    c.add_option("--rc", o_.rc_pairs,
                 "number of RC pairs, of --extend, which 2 turns on; the number that predicts better if not given")
        ->check(CLI::IsMember({1, 2}));
    c.add_option(
         "--healthy", o_.healthy,
         "recordings of the healthy cell, also those of --recording: what the model leaves unexplained of each, "
         "identified without it, goes into the cell file, and bms diagnose blames nothing for as much; with --extend "
         "those of --recording if not given")
        ->type_name("FILE");
    c.add_flag("--no-healthy", no_healthy_,
               "with --extend: do not learn from the recordings what it leaves unexplained")
        ->excludes("--healthy");
    c.add_option("--hold-out", o_.hold_out,
                 "with --extend: recordings whose prediction is reported; nothing is identified from them")
        ->needs("--extend")
        ->type_name("FILE");
    c.add_option("--branch-position,--lean", o_.ocv_branch,
                 "position of the OCV between slow discharge (-1) and slow charge (1); identified if not given")
        ->check(Within(-1.0, 1.0));
    c.add_option("--ocv-error-v", o_.ocv_error_v, "largest error in V of the straight pieces of the OCV")
        ->check(Within(0.0002, 0.05))
        ->capture_default_str();
  }

  void parse() {
    o_.method = method_of(texts_.optimizer);
    o_.extend = o_.extend || o_.rc_pairs == 2;
    o_.linear = linear_kind(texts_.model);
    o_.initial_soc = workflow::initial_soc_of(texts_.initial_soc);
    o_.window = workflow::window_of("--window", texts_.window);
    if (!texts_.validate_window.empty())
      o_.validate_window = workflow::window_of("--validate-window", texts_.validate_window);
    if (o_.name.empty()) o_.name = std::filesystem::path(o_.out).stem().string();
    // without --extend the file lacks physics that a diagnosis is there to name: nothing of it is taken for healthy
    learns_unasked_ = o_.extend && o_.healthy.empty() && !no_healthy_;
    if (learns_unasked_) o_.healthy = o_.recordings;
  }

  workflow::IdentifyOptions o_;
  IdentifyTexts texts_;
  bool each_cell_ = false, no_healthy_ = false;
  bool learns_unasked_ = false;  ///< [healthy] from the recordings themselves
  std::string csv_;
  Output output_;
};

}  // namespace

std::unique_ptr<Command> identify_command() { return std::make_unique<IdentifyCommand>(); }

}  // namespace bms::tool
