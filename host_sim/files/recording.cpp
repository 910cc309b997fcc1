#include "files/recording.hpp"

#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <string_view>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/frame_log.hpp"
#include "files/logs/long_table.hpp"
#include "files/logs/table_reader.hpp"
#include "measurement/recording_checks.hpp"
#include "measurement/statistics.hpp"

namespace bms::files {

using measurement::Recording;

namespace {

constexpr double largest_cell_v = 5.5;      ///< of a lithium cell, with a margin
constexpr double usual_cell_v = 3.3;        ///< to estimate the number of cells
constexpr double least_millivolts = 1'000;  ///< a median voltage that only makes sense in millivolts
constexpr double hottest_c = 150;

/// What no recording of a cell can be, and the likely cause. Nothing if the readings are possible.
std::string impossible(const Recording& r) {
  double soc = 0;
  for (const double s : r.soc_ref) soc = s > soc ? s : soc;
  if (soc > 1.5) {
    const bool fine = soc > 10'000;  // LeafSpy has ten thousandths of a percent
    return fmt::format("soc_ref reaches {:g}: it looks like {}, expected a fraction from 0 to 1: --unit soc_ref={}",
                       soc, fine ? "ten thousandths of a percent" : "percent", fine ? "ppm" : "%");
  }
  if (soc > largest_soc_ref) {
    return fmt::format(
        "soc_ref reaches {:g}: the capacity or the start of its counting is wrong, expected a fraction "
        "from 0 to 1",
        soc);
  }
  const double usual_v = r.voltage_v.empty() ? 0 : measurement::upper_median(r.voltage_v.copy());
  if (usual_v > least_millivolts) {
    return fmt::format("voltages around {:g} look like millivolts, expected volts: --unit voltage_v=mV", usual_v);
  }
  if (usual_v > largest_cell_v) {
    return fmt::format(
        "voltages around {:g} V look like those of a pack of about {:.0f} cells in series, expected one "
        "cell: --map pack_voltage_v=COLUMN --series N, or the columns of the cells as v_1, v_2 and so on",
        usual_v, usual_v / usual_cell_v);
  }
  const double usual_c = r.temperature_c.empty() ? 0 : measurement::upper_median(r.temperature_c.copy());
  if (usual_c > hottest_c) {
    return fmt::format("temperatures around {:g} look like kelvin, expected degrees C: --unit temperature_c=K",
                       usual_c);
  }
  return {};
}

void check(Recording& recording, const ReadOptions& options) {
  measurement::check_recording(recording);
  if (!options.refuse_doubtful) return;
  if (const std::string what = impossible(recording); !what.empty()) throw BadInput(recording.path, 1, what);
  for (const measurement::Warning& w : recording.warnings) {
    if (w.id != "current_inverted" || options.sign != CurrentSign::detected) continue;
    throw BadInput(recording.path, 1,
                   w.text + "; use --discharge-positive to invert it, or --charge-positive if it is right");
  }
  if (options.sign != CurrentSign::detected)  // confirmed by the user
    std::erase_if(recording.warnings, [](const measurement::Warning& w) { return w.id == "current_inverted"; });
}

Recording read(TextLines& lines, const std::string& path, VoltageColumn voltage, const ReadOptions& options) {
  Recording recording = read_table(lines, path, voltage, options);
  check(recording, options);
  return recording;
}

}  // namespace

Recording parse_recording(const std::string& text, const std::string& path, VoltageColumn voltage,
                          const ReadOptions& options) {
  TextLines lines(text, path);
  return read(lines, path, voltage, options);
}

Recording read_recording(const std::string& path, VoltageColumn voltage, const ReadOptions& options) {
  if (const auto given = options.in_memory.find(path); given != options.in_memory.end()) {
    Recording recording = given->second;
    check(recording, options);
    return recording;
  }
  const auto begin = std::chrono::steady_clock::now();
  std::size_t bytes = 0;
  Recording recording;
  const bool frames = frame_format_of(path, options).has_value();
  if (frames && !(options.steps + options.cycles).empty())
    throw BadInput(path, 1, "a log of CAN frames has no steps and cycles, expected neither --steps nor --cycles");
  if (frames) {
    recording = read_frame_log(path, options, bytes);
    check(recording, options);
  } else if (options.format.empty() && is_console(path)) {
    recording = read_console(path, options, bytes);
    check(recording, options);
  } else {
    TextLines lines(path);
    recording = read(lines, path, voltage, options);
    bytes = lines.bytes();
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  recording.read_mb_per_second = static_cast<double>(bytes) / 1e6 / seconds;
  return recording;
}

}  // namespace bms::files
