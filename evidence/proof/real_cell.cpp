#include "proof/real_cell.hpp"

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "workflow/diagnose_recordings.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::proof {

namespace {

using measurement::Recording;

/// Rows of a recording from `first` on.
Recording part(const Recording& r, std::size_t first, std::size_t count) {
  Recording p = r;
  for (auto column : {&Recording::time_s, &Recording::current_a, &Recording::voltage_v, &Recording::temperature_c,
                      &Recording::soc_ref, &Recording::current_ref_a, &Recording::voltage_ref_v}) {
    if (!(r.*column).empty()) p.*column = (r.*column).part(first, count);
  }
  return p;
}

std::string csv_of(const Recording& r) {
  std::string text = "time_s,current_a,voltage_v";
  if (!r.temperature_c.empty()) text += ",temperature_c";
  if (!r.soc_ref.empty()) text += ",soc_ref";
  text += "\n";
  for (std::size_t k = 0; k < r.rows(); ++k) {
    text += fmt::format("{},{},{}", r.time_s[k], r.current_a[k], r.voltage_v[k]);
    if (!r.temperature_c.empty()) text += fmt::format(",{}", r.temperature_c[k]);
    if (!r.soc_ref.empty()) text += fmt::format(",{}", r.soc_ref[k]);
    text += "\n";
  }
  return text;
}

}  // namespace

std::vector<RealSet> read_sets(files::TomlTable& list) {
  std::vector<RealSet> sets;
  for (files::TomlTable& t : list.tables("set")) {
    RealSet s;
    s.name = t.text("name");
    s.cell = t.text("cell");
    s.start = t.text("start");
    s.calibration = t.texts("calibration");
    s.held_out = t.flag("held_out");
    if (t.has("healthy")) s.healthy = t.texts("healthy");
    if (t.has("ocv")) s.ocv = t.texts("ocv");
    if (t.has("ocv_from_rests")) s.ocv_from_rests = t.flag("ocv_from_rests");
    if (t.has("ocv_from_load")) s.ocv_from_load = t.flag("ocv_from_load");
    if (t.has("initial_soc")) s.initial_soc = t.number("initial_soc");
    if (t.has("chemistry")) s.chemistry = t.text("chemistry");
    if (t.has("capacity_ah")) s.capacity_ah = t.number("capacity_ah");
    if (t.has("calibration_current")) s.calibration_current = t.text("calibration_current");
    if (t.has("calibration_from_s")) s.calibration_from_s = t.number("calibration_from_s");
    if (t.has("cells_in_parallel")) s.cells_in_parallel = t.number("cells_in_parallel");
    if (t.has("test")) s.test = t.text("test");
    if (t.has("test_initial_soc")) s.test_initial_soc = t.number("test_initial_soc");
    t.finish();
    sets.push_back(std::move(s));
  }
  return sets;
}

std::vector<std::string> files_of(const RealSet& set) {
  std::vector<std::string> files = set.calibration;
  files.insert(files.end(), set.healthy.begin(), set.healthy.end());
  files.insert(files.end(), set.ocv.begin(), set.ocv.end());
  if (!set.test.empty()) files.push_back(set.test);
  return files;
}

Present::Present(std::string data_folder) : folder_(std::move(data_folder)) {
  if (!std::filesystem::is_directory(folder_))
    throw files::BadInput(folder_, 1, "no such folder, expected one with recordings");
}

bool Present::has(const std::string& entry, const std::vector<std::string>& files) {
  const auto missing = std::find_if(files.begin(), files.end(), [&](const std::string& name) {
    return !std::filesystem::exists(std::filesystem::path(folder_) / name);
  });
  if (missing == files.end()) return true;
  if (skipped_.empty()) first_missing_ = *missing;
  if (std::find(skipped_.begin(), skipped_.end(), entry) == skipped_.end()) skipped_.push_back(entry);
  return false;
}

std::string Present::skipped_text(const std::string& what) const {
  if (skipped_.empty()) return "";
  return files::printable(fmt::format("skipped {} {}: recordings are not in {} (first '{}': {})", skipped_.size(), what,
                                      folder_, skipped_.front(), first_missing_)) +
         "\n";
}

Prepared prepare(const std::string& data_folder, const RealSet& set, bool learn_healthy) {
  const auto path = [&](const std::string& name) { return (std::filesystem::path(data_folder) / name).string(); };
  workflow::IdentifyOptions options;
  options.start = set.start;
  for (const std::string& slow : set.ocv) options.ocv.push_back(path(slow));
  options.chemistry = set.chemistry;
  options.capacity_ah = set.capacity_ah;
  options.ocv_from_rests = set.ocv_from_rests;
  options.ocv_from_load = set.ocv_from_load;
  if (set.initial_soc) options.initial_soc = {set.initial_soc, false};
  Prepared p;
  const files::TemporaryFolder folder;  // for parts of a recording
  const auto save = [&](const std::string& name, const Recording& whole, std::size_t first, std::size_t end) {
    files::write_file(folder.path() / name, csv_of(part(whole, first, end)));
    return (folder.path() / name).string();
  };
  std::string test = path(set.test);
  if (set.test.empty()) {
    const Recording whole = files::read_recording(path(set.calibration.front()));
    options.recordings = {save("calibration.csv", whole, 0, whole.rows() / 2)};
    test = save("test.csv", whole, whole.rows() / 2, whole.rows());
  } else {
    for (const std::string& name : set.calibration) options.recordings.push_back(path(name));
    if (!set.calibration_current.empty()) {
      files::ReadOptions reading;
      reading.map = {"current_a=" + set.calibration_current};
      const Recording whole =
          files::read_recording(options.recordings.front(), files::VoltageColumn::required, reading);
      const auto first = std::lower_bound(whole.time_s.begin(), whole.time_s.end(), set.calibration_from_s);
      options.recordings = {
          save("calibration.csv", whole, static_cast<std::size_t>(first - whole.time_s.begin()), whole.rows())};
    }
  }
  for (const std::string& name : set.healthy) options.healthy.push_back(path(name));
  if (set.healthy.empty()) options.healthy = options.recordings;
  if (!learn_healthy) options.healthy.clear();
  options.name = "calibrated";
  p.cell = *workflow::identify_cell(options).cell_file;
  if (set.cells_in_parallel > 1) workflow::scale_to(set.cells_in_parallel * p.cell.parameters.capacity_ah, p.cell);
  p.test = workflow::read_for_diagnosis(test, {}, p.cell);
  if (set.test_initial_soc && !p.test.soc_ref.empty()) p.test.soc_ref.edit().front() = *set.test_initial_soc;
  return p;
}

}  // namespace bms::proof
