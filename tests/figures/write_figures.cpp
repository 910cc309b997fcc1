// Measures what the READMEs quote and writes it there: `./bms figures`. With "step": only prints what a step costs on the board.
//
// Figures of recordings that are not there are left as they stand. Speeds are those of the machine that ran this.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string_view>

#include <fmt/format.h>

#include "host_sim/cell_file.hpp"
#include "host_sim/emulator.hpp"
#include "host_sim/firmware_image.hpp"
#include "host_sim/recording.hpp"
#include "host_sim/replay.hpp"
#include "tests/figures/committed_figures.hpp"
#include "tests/firmware/step_cost.hpp"

namespace bms {
namespace {

const std::filesystem::path source = BMS_SOURCE_DIR, data = BMS_DATA_DIR;
const std::string shift = (source / "recordings/forklift_shift.csv").string();

struct Case {
  std::string title, recording, cell;
  std::optional<Belief> belief;
};

std::string percent(const std::optional<double>& fraction) { return fraction ? fmt::format("{:.2f} %", 100 * *fraction) : "-"; }

ReplayResult replayed(const Case& c) {
  ReplayResult r;
  r.cell = read_cell(c.cell);
  r.recording = read_recording(c.recording);
  r.target = "host";
  r.track = run_on_host(r.cell, samples(r.recording), starting_point(c.belief), r.scalar);
  evaluate(r);
  return r;
}

std::string accuracy_row(const Case& c) {
  const ReplayResult r = replayed(c);
  return fmt::format("| {} | {} | {} | {} | {} | {:.2f} mV |\n", c.title, percent(r.soc.rmse), percent(r.soc.max_error), percent(r.soc.rmse_after_30min),
                     percent(r.soc.within_2_sigma), 1e3 * r.voltage.prediction_rmse_v.value_or(0));
}

const std::string accuracy_heading =
    "| recording and start | SOC RMSE | largest error | RMSE after 30 min | inside two sigma | one-step voltage RMSE |\n|---|---|---|---|---|---|\n";

std::string shift_accuracy() {
  std::string table = accuracy_heading;
  table += accuracy_row({"started by itself (98 %)", shift, "table9", std::nullopt});
  table += accuracy_row({"told 98 %, which is right", shift, "table9", Belief{0.98, 0.02}});
  table += accuracy_row({"told 78 %, believed to 2 %", shift, "table9", Belief{0.78, 0.02}});
  table += accuracy_row({"told 78 %, believed to 20 %", shift, "table9", Belief{0.78, 0.2}});
  return table;
}

std::string real_accuracy() {
  std::string table = accuracy_heading;
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(data / "a123_26650")) {
    if (entry.path().extension() == ".csv") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  for (const auto& file : files) {
    const Recording r = read_recording(file.string());
    if (r.soc_ref.empty()) continue;
    table += accuracy_row({file.stem().string(), file.string(), "a123_26650", std::nullopt});
    if (file.stem() == "udds_P25_A002") table += accuracy_row({"the same, told 20 % less than it has, believed to 20 %", file.string(), "a123_26650", Belief{r.soc_ref.front() - 0.2, 0.2}});
  }
  return table;
}

std::string step_cost() {
  std::string table = "| what | figure |\n|---|---|\n";
  for (const auto& [what, value] : step_figures(emulated_boards().front(), read_cell("table9"), samples(read_recording(shift)))) {
    table += fmt::format("| {} | {:.0f} |\n", what, value);
  }
  return table;
}

std::string speed() {
  std::string table = "| what | figure |\n|---|---|\n";
  const CellFile cell = read_cell("table9");
  const Recording recording = read_recording(shift);
  const auto all = samples(recording);
  for (const ScalarKind scalar : {ScalarKind::single, ScalarKind::twice, ScalarKind::fixed}) {
    table += fmt::format("| replay on the host, {} | {:.1f} million steps/s |\n", name_of(scalar), run_on_host(cell, all, std::nullopt, scalar).steps_per_second / 1e6);
  }
  const EmulatedBoard& board = emulated_boards().front();
  const auto image = firmware_image(board.name, cell, Image::replay);
  double fastest = 0;
  for (int k = 0; k < 3; ++k) fastest = std::max(fastest, run_on_board(board, image, all, std::nullopt).steps_per_second);
  table += fmt::format("| replay on the emulated {} | {:.2f} million steps/s |\n", board.name, fastest / 1e6);
  table += fmt::format("| reading the shift's CSV | {:.0f} MB/s |\n", recording.read_mb_per_second);
  return table;
}

void run() {
  const auto estimator = source / "estimator/README.md";
  replace_figures(estimator, "netduinoplus2", step_cost());
  replace_figures(estimator, "shift", shift_accuracy());
  if (std::filesystem::exists(data)) replace_figures(estimator, "real", real_accuracy());
  else fmt::print(stderr, "{} is not there: the figures of real recordings stay\n", data.string());
  replace_figures(source / "host_sim/README.md", "speed", speed());
}

}  // namespace
}  // namespace bms

int main(int argc, char** argv) {
  try {
    if (argc > 1 && std::string_view(argv[1]) == "step") fmt::print("{}", bms::step_cost());
    else bms::run();
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "figures: {}\n", e.what());
    return 3;
  }
}
