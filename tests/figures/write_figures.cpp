// Measures the figures in the READMEs and in docs/figures/ and writes them there: `./bms figures`.
//
//   argument      measures and writes
//   (none)        all figures
//   step          instructions of a step on the boards, printed only
//   filter        instructions of the filter with each form of the covariance
//   board         figures that depend on the code alone, not on recordings or the machine
//   protection    instructions of the protection
//   accuracy      state of charge of simulated cells: the shift and a thousand hours
//   budgets       flash, RAM and stack of the boards
//   sizes         costs of a pack of 8 to 32 cells
//   trials        state of charge on real recordings
//   fixed         fixed point against double, and the microbit against the host
//   identification  speed; coverage of the bands of the Hammerstein-Wiener model
//
// Figures of recordings that are missing stay unchanged. Speeds are those of this machine.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/cell_file.hpp"
#include "files/committed_figures.hpp"
#include "files/recording.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "identification/identify.hpp"
#include "images/child_process.hpp"
#include "images/emulator.hpp"
#include "images/firmware_image.hpp"
#include "replay/lanes.hpp"
#include "replay/replay.hpp"
#include "replay/simulation.hpp"
#include "study/study.hpp"
#include "tests/estimator/duty.hpp"
#include "tests/figures/fixed_point.hpp"
#include "tests/figures/hammerstein_wiener_bands.hpp"
#include "tests/figures/soc_trials.hpp"
#include "tests/firmware/board_budget.hpp"
#include "tests/firmware/step_cost.hpp"
#include "tests/firmware/world/size_budgets.hpp"

namespace bms {
namespace {

const std::filesystem::path source = BMS_SOURCE_DIR, data = BMS_DATA_DIR;
const std::string shift = (source / "evidence/recordings/forklift_shift.csv").string();

struct Case {
  std::string title, recording, cell;
  std::optional<replay::SocPrior> prior;
};

std::string percent(const std::optional<double>& fraction) {
  return fraction ? fmt::format("{:.2f} %", 100 * *fraction) : "-";
}

replay::ReplayResult replayed(const Case& c) {
  replay::ReplayResult r;
  r.cell = files::read_cell(c.cell);
  r.recording = files::read_recording(c.recording);
  r.target = "host";
  r.track = replay::run_on_host(r.cell, measurement::samples(r.recording), replay::starting_point(c.prior), r.scalar);
  replay::evaluate(r);
  return r;
}

const std::string accuracy_heading =
    "| recording and start | SOC RMSE | largest error | RMSE after 30 min | inside two sigma | one-step voltage RMSE |";

/// One row without its end.
std::string accuracy_cells(const Case& c) {
  const replay::ReplayResult r = replayed(c);
  return fmt::format("| {} | {} | {} | {} | {} | {:.2f} mV |", c.title, percent(r.soc.rmse), percent(r.soc.max_error),
                     percent(r.soc.rmse_after_30min), percent(r.soc.within_2_sigma),
                     1e3 * r.voltage.prediction_rmse_v.value_or(0));
}

std::string accuracy_row(const Case& c) { return accuracy_cells(c) + "\n"; }

std::string shift_accuracy() {
  std::string table = accuracy_heading + "\n|---|---|---|---|---|---|\n";
  table += accuracy_row({"no initial SOC given (98 %)", shift, "table9", std::nullopt});
  table += accuracy_row({"initial SOC 98 %, correct", shift, "table9", replay::SocPrior{0.98, 0.02}});
  table += accuracy_row({"initial SOC 78 %, sigma 2 %", shift, "table9", replay::SocPrior{0.78, 0.02}});
  table += accuracy_row({"initial SOC 78 %, sigma 20 %", shift, "table9", replay::SocPrior{0.78, 0.2}});
  return table;
}

/// The simulated shift, and a real drive that its cell file has not seen.
std::string headline() {
  const std::string drive = (source / "evidence/recordings/a123_26650/udds_P25_A002.csv.gz").string();
  const char* extended = "a123_26650_extended";
  std::string table = accuracy_heading + "\n|---|---|---|---|---|---|\n";
  table += accuracy_row({"**simulated**: forklift shift of eight hours", shift, "table9", std::nullopt});
  table += accuracy_row({"**measured**: drive of an A123 cell (UDDS)", drive, extended, std::nullopt});
  return table;
}

/// With the cell file of 25 degrees C, and next to it with the extended one.
std::string real_row(const std::string& title, const std::string& recording,
                     const std::optional<replay::SocPrior>& prior) {
  const replay::ReplayResult extended = replayed({title, recording, "a123_26650_extended", prior});
  return accuracy_cells({title, recording, "a123_26650", prior}) +
         fmt::format(" {} | {} |\n", percent(extended.soc.rmse), percent(extended.soc.within_2_sigma));
}

std::string real_accuracy() {
  std::string table =
      accuracy_heading + " extended: SOC RMSE | inside two sigma |\n|---|---|---|---|---|---|---|---|\n";
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(data / "a123_26650")) {
    if (entry.path().extension() == ".csv") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  for (const auto& file : files) {
    const measurement::Recording r = files::read_recording(file.string());
    if (r.soc_ref.empty()) continue;
    table += real_row(file.stem().string(), file.string(), std::nullopt);
    if (file.stem() == "udds_P25_A002")
      table += real_row("the same, initial SOC 20 % too low, sigma 20 %", file.string(),
                        replay::SocPrior{r.soc_ref.front() - 0.2, 0.2});
  }
  return table;
}

std::string thousand_hours() {
  std::string table =
      "| estimator and sensors | SOC RMSE, first to last hundred hours | largest error | inside two sigma | mean sigma "
      "| subnormal numbers | time of a step, last over first |\n|---|---|---|---|---|---|---|\n";
  const auto row = [&](const char* what, const DutyFigures& f) {
    table += fmt::format("| {} | {:.2f} % ({:.2f} to {:.2f} %) | {:.2f} % | {:.1f} % | {:.2f} % | {} | {:.2f} |\n",
                         what, 100 * f.rmse, 100 * f.rmse_first, 100 * f.rmse_last, 100 * f.largest, 100 * f.inside,
                         100 * f.mean_sigma, f.subnormal, f.slower);
  };
  row("as in the cell file: 20 mA over an hour, 0.5 mV over ten", duty_as_in_the_file());
  row("errors as states, 30 mA and 2 mV over ten hours", duty_with_errors());
  row("the same, -30 to 45 °C by season, resistances identified at four temperatures", duty_over_a_year());
  row("-30 to 45 °C by season, cell file without temperature", duty_as_in_the_file(seasons));
  return table;
}

std::string step_cost() {
  std::string table = "| what | figure |\n|---|---|\n";
  for (const auto& [what, value] : firmware::step_figures(images::emulated_boards().front(), files::read_cell("table9"),
                                                          measurement::samples(files::read_recording(shift)))) {
    table += fmt::format("| {} | {:.0f} |\n", what, value);
  }
  return table;
}

/// The same filter with its covariance in three forms.
std::string filter_forms() {
  std::string table =
      "| covariance of the filter, two states | step, mean [instructions] | step, longest |\n|---|---|---|\n";
  for (const auto& [what, cost] :
       firmware::filter_form_costs(images::emulated_boards().front(), files::read_cell("table9")))
    table += fmt::format("| {} | {:.0f} | {} |\n", what, cost.mean, cost.most);
  return table;
}

std::string microbit_cost() {
  std::string table = "| what | figure |\n|---|---|\n";
  for (const auto& [what, value] : firmware::core_figures(images::emulated_boards().back(), files::read_cell("table9"),
                                                          measurement::samples(files::read_recording(shift)))) {
    table += fmt::format("| {} | {:.0f} |\n", what, value);
  }
  return table;
}

/// Difference of fixed point and float from double over whole recordings, and of the microbit from the host.
std::string fixed_point() {
  std::string table =
      "| recording | cell | estimates | fixed point less double | float less double | words on the microbit "
      "|\n|---|---|---|---|---|---|\n";
  for (const FixedPointRun& run : fixed_point_runs(shift, data)) {
    const Deviation d = deviation(run);
    const auto difference = difference_on_microbit(run);
    table += fmt::format("| {} | {} | {} | {:.4f} % | {:.4f} % | {} |\n",
                         std::filesystem::path(run.recording).stem().string(), run.cell, d.estimates, 100 * d.of_fixed,
                         100 * d.of_float,
                         difference ? fmt::format("differ from sample {}", difference->sample) : "all equal");
  }
  return table;
}

/// table9 with mechanisms.
files::CellFile table9_with(const std::vector<std::pair<const char*, std::vector<double>>>& mechanisms, bool errors) {
  files::CellFile cell = files::read_cell("table9");
  cell.parameters.noise.errors_are_states = errors;
  for (const auto& [id, values] : mechanisms) {
    model::MechanismSetting m = model::default_setting(model::mechanism_index(id), cell.parameters);
    std::copy(values.begin(), values.end(), m.value.begin());
    files::put_mechanism(cell, m);
  }
  return files::parse_cell(files::cell_text(cell), "table9 with mechanisms");
}

std::string mechanism_cost() {
  const std::pair<const char*, std::vector<double>> hysteresis{"ocv_hysteresis", {0.006}},
      slow{"slow_polarisation", {0.004}}, fast{"fast_polarisation", {0.002}},
      warm{"temperature_resistance", {15'000, 30'000}}, heat{"self_heating", {1}}, shape{"ocv_shape", {0.02, -0.01}},
      entropic{"entropic_ocv", {1e-4, 2e-4, -1e-4, 1e-4}}, transfer{"charge_transfer", {0.3, 0.5}},
      offset{"current_offset", {0.02}}, gain{"voltage_gain", {0.001}},
      branches{"branch_temperature", {0.1, 0.1, 0.15, 0.2, 1e-3, 1e-3, 5e-4, -2e-3, 7e4, 5e4, 4e4, 4e4}},
      cold{"temperature_resistance", {45'000, 30'000, 25, 0.3, 0.9, 0.6, -0.3, 0.8}};
  const auto all = measurement::samples(files::read_recording(shift));
  const images::EmulatedBoard& board = images::emulated_boards().front();
  std::string table = "| table9 with | step, mean [instructions] | step, longest |\n|---|---|---|\n";
  using Set = std::vector<std::pair<const char*, std::vector<double>>>;
  const auto row = [&](const Set& set, bool errors) {
    const files::CellFile cell = table9_with(set, errors);
    const firmware::StepCost cost = firmware::count_instructions(
        board, images::firmware_image(board.name, cell, images::Image::replay), all, replay::state_count(cell));
    std::string names = errors ? "`noise.errors_are_states`" : "";
    for (const auto& [id, values] : set) names += fmt::format("{}`{}`", names.empty() ? "" : ", ", id);
    table += fmt::format("| {} | {:.0f} | {} |\n", names.empty() ? "nothing" : names, cost.mean, cost.most);
  };
  for (const Set& set : std::vector<Set>{{},
                                         {offset},
                                         {warm},
                                         {transfer},
                                         {entropic},
                                         {shape},
                                         {gain},
                                         {heat},
                                         {hysteresis},
                                         {fast},
                                         {slow},
                                         {branches},
                                         {hysteresis, slow},
                                         {hysteresis, slow, warm, offset}})
    row(set, false);
  for (const Set& set : std::vector<Set>{{}, {hysteresis, warm}, {slow, branches, hysteresis, cold, entropic}})
    row(set, true);
  return table;
}

/// Keys of the tables of mechanisms in a cell file.
std::string mechanism_tables() {
  std::string table = "| table | key | unit | bounds | what |\n|---|---|---|---|---|\n";
  for (const model::MechanismInfo& info : model::catalogue) {
    for (std::size_t k = 0; k < info.parameters; ++k) {
      const model::Parameter& p = info.parameter[k];
      const char* per = "";
      if (p.per == model::Per::ah) per = " per Ah";
      if (p.per == model::Per::siemens) per = ", over Ah";
      table += fmt::format("| {} | `{}` | {} | {:g} .. {:g}{} | {} |\n",
                           k > 0 ? "" : "`[" + files::table_of(info) + "]`" + (info.on_board ? "" : " *host*"), p.name,
                           p.unit == "1" ? "" : p.unit, p.low, p.high, per, p.meaning);
    }
  }
  return table;
}

/// The best of several runs, as run_on_host() measures one cell. The cells of a pack differ by 0.2 mV.
double steps_per_second_in_lanes(const files::CellFile& cell, const measurement::Recording& recording) {
  constexpr int runs = 10;
  std::vector<measurement::Recording> cells(2 * replay::lane_count(), recording);
  std::vector<replay::LaneInput> inputs;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    std::vector<double> voltage_v = recording.voltage_v.copy();
    for (double& v : voltage_v) v += 2e-4 * static_cast<double>(k);
    cells[k].voltage_v = measurement::Column(std::move(voltage_v));
    inputs.push_back({cell, measurement::SampleList(cells[k])});
  }
  double best = 0;
  for (int k = 0; k < runs; ++k) best = std::max(best, replay::run_in_lanes(inputs).steps_per_second);
  return best;
}

std::string speed() {
  std::string table = "| what | figure |\n|---|---|\n";
  const files::CellFile cell = files::read_cell("table9");
  const measurement::Recording recording = files::read_recording(shift);
  const auto all = measurement::samples(recording);
  for (const replay::ScalarKind scalar :
       {replay::ScalarKind::float32, replay::ScalarKind::float64, replay::ScalarKind::fixed}) {
    table += fmt::format("| replay on the host, {} | {:.1f} million steps/s |\n", replay::name_of(scalar),
                         replay::run_on_host(cell, all, std::nullopt, scalar).steps_per_second / 1e6);
  }
  table += fmt::format("| replay on the host, float, {} cells in lanes | {:.1f} million steps/s |\n",
                       2 * replay::lane_count(), steps_per_second_in_lanes(cell, recording) / 1e6);
  const images::EmulatedBoard& board = images::emulated_boards().front();
  const auto image = images::firmware_image(board.name, cell, images::Image::replay);
  double fastest = 0;
  for (int k = 0; k < 3; ++k)
    fastest = std::max(fastest, images::run_on_board(board, image, all, std::nullopt).steps_per_second);
  table += fmt::format("| replay on the emulated {} | {:.2f} million steps/s |\n", board.name, fastest / 1e6);
  table += fmt::format("| reading the shift's CSV | {:.0f} MB/s |\n", recording.read_mb_per_second);
  return table;
}

/// Identification and validation by the command line, from its JSON.
std::string identified_row(const std::vector<std::string>& from, const std::vector<std::string>& judges,
                           const std::string& more) {
  const files::TemporaryFolder folder;
  const auto real = [](const std::string& name) { return (data / "a123_26650" / (name + ".csv")).string(); };
  std::vector<std::string> command = {BMS_TOOL,
                                      "identify",
                                      "--ocv",
                                      real("ocv_P25_dis"),
                                      real("ocv_P25_chg"),
                                      "--start",
                                      "a123_26650",
                                      "--window",
                                      "0.95:0.10",
                                      "--quiet",
                                      "--out",
                                      (folder.path() / "c.toml").string(),
                                      "--json",
                                      (folder.path() / "r.json").string()};
  if (!more.empty()) command.insert(command.end(), {"--nodes", more});
  command.push_back("--recording");
  for (const std::string& name : from) command.push_back(real(name));
  command.push_back("--validate");
  for (const std::string& name : judges) command.push_back(real(name));
  images::output_of(command);
  const nlohmann::json r = nlohmann::json::parse(files::read_file(folder.path() / "r.json"));
  std::string row, names;
  for (const std::string& name : from) names += (names.empty() ? "" : " + ") + name;
  for (const nlohmann::json& v : r["validations"]) {
    row += fmt::format("| {} | {} | {:.2f} mV, {:.1f} % | {} | {:.2f} mV, {:.1f} % |\n", names,
                       more.empty() ? "tenths" : more, 1e3 * r["estimation"]["rmse_v"].get<double>(),
                       r["estimation"]["fit_percent"].get<double>(),
                       std::filesystem::path(v["recording"].get<std::string>()).stem().string(),
                       1e3 * v["rmse_v"].get<double>(), v["fit_percent"].get<double>());
  }
  return row;
}

std::string real_identification() {
  std::string table =
      "| identified from | nodes | RMSE, fit there | judged on | RMSE, fit there |\n|---|---|---|---|---|\n";
  const std::string udds = "udds_P25_A002", dyn = "dyn20_P25_A002", pulse = "pulse_P25_A002",
                    charge = "cccv2C_P25_A002";
  table += identified_row({udds}, {dyn, pulse}, "");
  table += identified_row({dyn}, {udds, pulse}, "");
  table += identified_row({dyn}, {udds}, "0.5");
  table += identified_row({charge, dyn}, {udds}, "");
  table += identified_row({pulse}, {udds, dyn}, "");
  return table;
}

std::string identification_speed() {
  namespace id = identification;
  constexpr std::size_t samples_used = 20'000;
  const files::CellFile cell = files::read_cell("table9");
  const measurement::Recording recording = files::read_recording(shift);
  id::DataSet r;
  r.data = {recording.time_s.part(0, samples_used), recording.current_a.part(0, samples_used),
            recording.voltage_v.part(0, samples_used), 6};
  r.initial_soc = 0.98;
  r.estimate_initial_soc = true;
  r.initial_soc_sigma = 0.01;
  const auto fastest_s = [](const auto& work) {
    double best_s = 1e9;
    for (int k = 0; k < 5; ++k) {
      const auto begin = std::chrono::steady_clock::now();
      work();
      best_s = std::min(best_s, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    }
    return best_s;
  };
  const auto tables = model::prepare<double, model::max_intervals>(cell.parameters);
  const double simulation_s = fastest_s([&] {
    replay::simulate({.cell = tables,
                      .capacity_ah = 6,
                      .time_s = r.data.time_s,
                      .current_a = r.data.current_a,
                      .initial_soc = 0.98});
  });
  std::string table = fmt::format(
      "| 20,000 samples | time | as many simulations |\n|---|---|---|\n| simulation, open loop | {:.2f} ms | 1 |\n",
      1e3 * simulation_s);
  for (const auto& [name, nodes] :
       {std::pair{"grey box, R0, R1, C1 and both initial states, from three starts", std::vector{0.6}},
        std::pair{"grey box, the same at nine nodes", id::nodes_for(0.22, 0.98)}}) {
    id::GreyBoxOptions options;
    options.soc_nodes = nodes;
    const double s =
        fastest_s([&] { id::identify_grey_box(cell.parameters, {r}, options, id::Method::trust_region_reflective); });
    table += fmt::format("| {} | {:.0f} ms | {:.0f} |\n", name, 1e3 * s, s / simulation_s);
  }
  const double study_s = study::study_plant(cell.parameters, {}, {}).seconds;
  table += fmt::format("| `bms study`, all of it (20 cells of each kind, other lengths) | {:.1f} s | |\n", study_s);
  return table;
}

std::string protection_cost() {
  std::string table = "| what | figure |\n|---|---|\n";
  for (const auto& [what, value] :
       firmware::protection_figures(images::emulated_boards().front(), files::read_cell("table9")))
    table += fmt::format("| {} | {:.0f} |\n", what, value);
  return table;
}

/// The rooms by floor, as checks/arrows.py draws them.
std::string floors() {
  return "```\n" + images::output_of({"python3", (source / "checks/arrows.py").string(), "--draw"}) + "```\n";
}

/// A picture of the report of the shift, by the browser that also tests the pages.
void draw_report(const std::filesystem::path& picture) {
  const files::TemporaryFolder folder;
  const std::string page = (folder.path() / "shift.html").string();
  images::output_of({BMS_TOOL, "replay", shift, "--initial-soc", "0.98", "--quiet", "--report", page});
  images::output_of({"chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
                     "--disable-background-networking", "--disable-component-update", "--disable-sync",
                     "--hide-scrollbars", "--user-data-dir=" + (folder.path() / "browser").string(),
                     "--virtual-time-budget=10000", "--window-size=1280,900", "--screenshot=" + picture.string(),
                     "file://" + page});
}

/// Picture and tables of the project's README, from the same code.
void write_front_page() {
  files::replace_figures(source / "README.md", "headline", headline());
  files::replace_figures(source / "docs/tour.md", "floors", floors());
  draw_report(source / "docs/figures/forklift_shift.png");
}

/// Figures that depend on the code alone.
void write_board() {
  files::replace_figures(source / "firmware/protection/README.md", "netduinoplus2", protection_cost());
  files::replace_figures(source / "estimator/README.md", "netduinoplus2", step_cost());
  files::replace_figures(source / "estimator/README.md", "microbit", microbit_cost());
  files::replace_figures(source / "estimator/README.md", "mechanisms", mechanism_cost());
  files::replace_figures(source / "estimator/README.md", "filter forms", filter_forms());
  files::replace_figures(source / "model/cells/README.md", "mechanisms", mechanism_tables());
  files::replace_figures(source / "boards/README.md", "budgets", firmware::board_table());
}

void write_sizes() {
  files::replace_figures(source / "boards/stm32f405_80v/README.md", "sizes", world::size_budget_table());
}

/// State of charge on real recordings; unchanged if they are missing.
void write_trials() {
  if (!std::filesystem::exists(data)) return;
  const auto trials = source / "docs/figures/soc_trials.md";
  files::replace_figures(trials, "real", real_accuracy());
  files::replace_figures(trials, "trials", soc_trials(data));
}

void write_accuracy() {
  files::replace_figures(source / "estimator/README.md", "shift", shift_accuracy());
  files::replace_figures(source / "estimator/README.md", "duty", thousand_hours());
}

/// On recordings that are not part of the project.
void write_real_identification() {
  files::replace_figures(source / "inference/identification/README.md", "real", real_identification());
}

void write_identification() {
  constexpr std::uint64_t bands_seed = 901;
  const auto readme = source / "inference/identification/README.md";
  files::replace_figures(readme, "bands", hammerstein_wiener_bands(bands_seed));
  files::replace_figures(readme, "speed", identification_speed());
}

void run() {
  write_board();
  write_sizes();
  write_front_page();
  write_accuracy();
  if (std::filesystem::exists(data)) {
    write_trials();
    files::replace_figures(source / "boards/microbit/README.md", "fixed", fixed_point());
  } else {
    fmt::print(stderr, "{} does not exist: the figures of real recordings stay unchanged\n", data.string());
  }
  files::replace_figures(source / "host_sim/replay/README.md", "speed", speed());
  if (std::filesystem::exists(data)) write_real_identification();
  write_identification();
}

/// What an argument of the program writes; without one, everything is written.
const std::map<std::string_view, std::function<void()>> parts = {
    {"step", [] { fmt::print("{}\n{}\n{}", step_cost(), microbit_cost(), filter_forms()); }},  // prints it
    {"filter", [] { files::replace_figures(source / "estimator/README.md", "filter forms", filter_forms()); }},
    {"readme", write_front_page},
    {"accuracy", write_accuracy},
    {"board", write_board},
    {"budgets", [] { files::replace_figures(source / "boards/README.md", "budgets", firmware::board_table()); }},
    {"sizes", write_sizes},
    {"protection",
     [] { files::replace_figures(source / "firmware/protection/README.md", "netduinoplus2", protection_cost()); }},
    {"trials", write_trials},
    {"fixed", [] { files::replace_figures(source / "boards/microbit/README.md", "fixed", fixed_point()); }},
    {"identification", write_identification},
    {"real", write_real_identification},
};

}  // namespace
}  // namespace bms

int main(int argc, char** argv) {
  try {
    if (argc < 2) {
      bms::run();
      return 0;
    }
    const auto part = bms::parts.find(argv[1]);
    if (argc > 2 || part == bms::parts.end()) {
      fmt::print(stderr, "figures: expected nothing or one of");
      for (const auto& [name, write] : bms::parts) fmt::print(stderr, " {}", name);
      fmt::print(stderr, "\n");
      return 2;
    }
    part->second();
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "figures: {}\n", e.what());
    return 3;
  }
}
