#include "tests/figures/fixed_point.hpp"

#include <algorithm>
#include <cmath>

#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "images/emulator.hpp"

namespace bms {

std::vector<FixedPointRun> fixed_point_runs(const std::filesystem::path& shift, const std::filesystem::path& data) {
  std::vector<FixedPointRun> runs = {{shift.string(), "table9"}};
  const auto all_in = [&](const char* folder, const char* cell, bool slow_ones) {
    if (!std::filesystem::exists(data / folder)) return;
    const std::size_t before = runs.size();
    for (const auto& entry : std::filesystem::directory_iterator(data / folder)) {
      const bool slow = entry.path().filename().string().starts_with("ocv_");
      if (entry.path().extension() == ".csv" && (slow_ones || !slow)) runs.push_back({entry.path().string(), cell});
    }
    std::sort(runs.begin() + static_cast<std::ptrdiff_t>(before), runs.end(),
              [](const auto& a, const auto& b) { return a.recording < b.recording; });
  };
  all_in("a123_26650", "a123_26650", true);
  all_in("a123_esctoolbox", "a123_esctoolbox_extended", true);
  all_in("a123_26650", "a123_26650_extended", false);
  return runs;
}

Deviation deviation(const FixedPointRun& run) {
  const files::CellFile cell = files::read_cell(run.cell);
  const auto all = measurement::samples(files::read_recording(run.recording));
  const auto rows = [&](replay::ScalarKind scalar) {
    return replay::run_on_host(cell, all, std::nullopt, scalar).rows;
  };
  const auto fixed = rows(replay::ScalarKind::fixed), float32 = rows(replay::ScalarKind::float32),
             float64 = rows(replay::ScalarKind::float64);
  Deviation d{all.size()};
  for (std::size_t k = 0; k < all.size(); ++k) {
    d.of_fixed = std::max(d.of_fixed, std::abs(fixed[k].soc - float64[k].soc));
    d.of_float = std::max(d.of_float, std::abs(float32[k].soc - float64[k].soc));
  }
  return d;
}

std::optional<replay::Difference> difference_on_microbit(const FixedPointRun& run) {
  const files::CellFile cell = files::read_cell(run.cell);
  const auto all = measurement::samples(files::read_recording(run.recording));
  const replay::Track host = replay::run_on_host(cell, all, std::nullopt, replay::ScalarKind::fixed),
                      board = images::run_on_board(images::emulated_boards().back(), cell, all, std::nullopt);
  return replay::first_difference(host, board, replay::ScalarKind::fixed);
}

}  // namespace bms
