#include "workflow/learn_healthy.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include <fmt/format.h>

#include "diagnosis/healthy_block.hpp"
#include "diagnosis/predicted_band.hpp"
#include "diagnosis/prepare.hpp"
#include "diagnosis/recording_check.hpp"
#include "files/bad_input.hpp"
#include "workflow/diagnose_recordings.hpp"
#include "workflow/residual_regimes.hpp"

namespace bms::workflow {

namespace {

using healthy_data::HealthyBlock;
using measurement::Recording;

constexpr double blocks_wanted = 10;  ///< of all recordings together; a recording that is short enough is one block
constexpr double shortest_block_s = 600;

double in_short(double value) { return std::isfinite(value) ? std::stod(fmt::format("{:.4g}", value)) : value; }

bool same_file(const std::string& a, const std::string& b) {
  std::error_code error;
  return a == b || std::filesystem::equivalent(a, b, error);
}

/// Some rows of a recording.
struct Rows {
  std::size_t first = 0, count = 0;
};

/// Returns true if the load changes, as a diagnosis needs it.
bool is_loaded(const Recording& r, const Rows& rows, double capacity_ah) {
  constexpr double span_c = 0.02, loaded_c = 0.02;
  constexpr std::size_t loaded_rows = 10;
  healthy_data::HealthyRange current_a;
  std::size_t loaded = 0;
  for (std::size_t k = rows.first; k < rows.first + rows.count; ++k) {
    current_a.add(r.current_a[k]);
    loaded += std::abs(r.current_a[k]) > loaded_c * capacity_ah ? 1 : 0;
  }
  return loaded >= loaded_rows && current_a.high - current_a.low > span_c * capacity_ah;
}

/// Parts of about block_s. One in which the load does not change belongs to the next one, at the end to the one before.
std::vector<Rows> blocks_of(const Recording& r, double block_s, double capacity_ah) {
  const double parts = std::max(1.0, std::round(r.duration_s() / block_s));
  std::vector<Rows> blocks;
  std::size_t first = 0;
  for (double part = 1; part <= parts; ++part) {
    const double end_s = r.time_s.front() + r.duration_s() * part / parts;
    std::size_t end = first;
    while (end < r.rows() && (r.time_s[end] < end_s || part == parts)) ++end;
    const Rows rows{first, end - first};
    const bool last = part == parts;
    if (is_loaded(r, rows, capacity_ah) || (last && blocks.empty())) {
      blocks.push_back(rows);
      first = end;
    } else if (last) {
      blocks.back().count = end - blocks.back().first;
    }
  }
  return blocks;
}

Recording part_of(const Recording& r, const Rows& rows) {
  Recording part = r;
  for (auto column : {&Recording::time_s, &Recording::current_a, &Recording::voltage_v, &Recording::temperature_c,
                      &Recording::soc_ref, &Recording::current_ref_a, &Recording::voltage_ref_v}) {
    if (!(r.*column).empty()) part.*column = (r.*column).part(rows.first, rows.count);
  }
  return part;
}

/// The start of a block as a diagnosis of it alone would have it.
StartSoc start_of_block(const IdentifyOptions& options, const Recording& whole, const Recording& block,
                        const files::CellFile& cell) {
  if (!options.initial_soc.value) return start_of(block, cell);
  double soc = *options.initial_soc.value;
  for (std::size_t k = 1; k < whole.rows() && whole.time_s[k] <= block.time_s.front(); ++k) {
    if (std::isfinite(whole.current_a[k]))
      soc += whole.current_a[k] * (whole.time_s[k] - whole.time_s[k - 1]) / (3'600 * cell.parameters.capacity_ah);
  }
  return given_start(cell, soc);
}

/// The learning in progress.
class Learning {
 public:
  Learning(const IdentifyOptions& options, const files::CellFile& cell, const std::optional<JointResult>& circuit,
           std::vector<measurement::Warning>& warnings)
      : options_(options), cell_(cell), circuit_(circuit), warnings_(warnings) {
    for (const std::string& path : options.healthy)
      recordings_.push_back(read_for_diagnosis(path, options.reading, cell));
  }

  healthy_data::HealthyData run() {
    double total_s = 0;
    for (const Recording& r : recordings_) total_s += r.duration_s();
    const double block_s = std::max(shortest_block_s, total_s / blocks_wanted);
    for (std::size_t n = 0; n < recordings_.size(); ++n) {
      report(0.3, 0.6, n, recordings_.size(), "identified without", recordings_[n]);
      add_blocks(n, block_s);
    }
    std::vector<char> usable;
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      report(0.6, 1, b, blocks_.size(), "diagnosed", recordings_[blocks_[b].recording]);
      usable.push_back(diagnose(b) ? 1 : 0);
    }
    data_.known = true;
    if (!data_.blocks.empty()) {
      data_.regimes = regimes_.regimes(usable);
      data_.beyond_tolerance_v = in_short(regimes_.beyond_tolerance_v(usable));
    }
    for (healthy_data::HealthyRegime& r : data_.regimes) {
      for (double* v : {&r.hours, &r.bias_v, &r.rms_v, &r.spread_v}) *v = in_short(*v);
    }
    return std::move(data_);
  }

 private:
  /// A part of a recording, and a cell that was identified without it.
  struct Block {
    std::size_t recording = 0;
    diagnosis::PreparedRecording record;
    files::CellFile cell;
  };

  /// The k-th of `of` pieces between two shares of the whole identification.
  void report(double from, double to, std::size_t k, std::size_t of, const char* what, const Recording& r) const {
    workflow::report(options_.progress, from + (to - from) * static_cast<double>(k) / static_cast<double>(of),
                     fmt::format("{} {}", what, std::filesystem::path(r.path).filename().string()));
  }

  void add_blocks(std::size_t n, double block_s) {
    const Recording& whole = recordings_[n];
    const std::string& path = options_.healthy[n];
    IdentifyOptions without = options_;
    without.progress = {};
    without.healthy.clear();
    without.circuit = circuit_;
    without.validate.clear();
    without.hold_out.clear();
    std::erase_if(without.recordings, [&](const std::string& other) { return same_file(path, other); });
    const bool seen = without.recordings.size() < options_.recordings.size(), only = without.recordings.empty();
    std::optional<files::CellFile> again;
    if (seen && !only && !used(whole, [&] { again = identified(without); })) return;
    for (const Rows& rows : blocks_of(whole, block_s, cell_.parameters.capacity_ah)) {
      used(whole, [&] {  // another block may be what this one is not
        if (only) {
          without.recordings = {path};
          without.left_out = {whole.time_s[rows.first], whole.time_s[rows.first + rows.count - 1]};
          again = identified(without);
        }
        add_block(n, rows, again ? *again : cell_);
      });
    }
  }

  /// Returns false, with a warning, if no cell file follows from what is left, or if a block cannot be read.
  template <class Use>
  bool used(const Recording& whole, const Use& use) {
    try {
      use();
      return true;
    } catch (const FailedFit& failed) {
      warn(whole, failed.what());
    } catch (const files::BadInput& bad) {
      warn(whole, bad.what());
    }
    return false;
  }

  static files::CellFile identified(const IdentifyOptions& options) {
    IdentifyResult result = identify_cell(options);
    if (!result.cell_file) throw FailedFit("no cell file without a part of the recordings", {});
    return *std::move(result.cell_file);
  }

  void warn(const Recording& r, const std::string& why) {
    warnings_.push_back({"healthy", fmt::format("{}: not used as healthy data: {}", r.path, why)});
  }

  void add_block(std::size_t n, const Rows& rows, const files::CellFile& cell) {
    const Recording& whole = recordings_[n];
    Recording recording = part_of(whole, rows);
    const std::string name = std::filesystem::path(whole.path).filename().string();
    const StartSoc start = start_of_block(options_, whole, recording, cell);
    Block block{n, prepared(std::move(recording), name, cell, start).record, cell};
    diagnosis::PreparedRecording checked = block.record;
    diagnosis::check_recording(checked, cell.parameters);  // removes bad readings
    const auto likelihood = diagnosis::likelihood_model_of(cell.parameters, cell.mechanisms, {checked});
    regimes_.add_block(n, checked, diagnosis::predict(cell.parameters, cell.mechanisms, checked),
                       diagnosis::predicted_sigma_v(likelihood, 0), cell.parameters.capacity_ah);
    blocks_.push_back(std::move(block));
  }

  /// The errors of a block are judged by those of the other recordings or, of a single one, of its other blocks.
  bool diagnose(std::size_t b) {
    const auto& [n, record, cell] = blocks_[b];
    std::vector<char> others;
    for (std::size_t k = 0; k < blocks_.size(); ++k)
      others.push_back((recordings_.size() > 1 ? blocks_[k].recording != n : k != b) ? 1 : 0);
    diagnosis::Options options;
    options.learns = true;
    options.healthy.regimes = regimes_.regimes(others);
    const diagnosis::Diagnosis d = diagnosis::diagnose(cell.parameters, cell.mechanisms, {record}, options);
    if (!diagnosis::is_usable_as_healthy(d)) {
      warnings_.push_back(
          {"healthy", fmt::format("{}: {:.0f} to {:.0f} s not used as healthy data: {}", recordings_[n].path,
                                  record.time_s.front(), record.time_s.back(), d.statement)});
      return false;
    }
    data_.blocks.push_back(diagnosis::healthy_block(record, d));
    return true;
  }

  const IdentifyOptions& options_;
  const files::CellFile& cell_;
  const std::optional<JointResult>& circuit_;
  std::vector<measurement::Warning>& warnings_;
  std::vector<Recording> recordings_;
  healthy_data::HealthyData data_;
  std::vector<Block> blocks_;
  ResidualRegimes regimes_;  ///< of all blocks
};

}  // namespace

healthy_data::HealthyData learn_healthy(const IdentifyOptions& options, const files::CellFile& cell,
                                        const std::optional<JointResult>& circuit,
                                        std::vector<measurement::Warning>& warnings) {
  return Learning(options, cell, circuit, warnings).run();
}

std::string healthy_summary(const healthy_data::HealthyData& healthy) {
  std::map<std::string, std::size_t> blocks;
  for (const HealthyBlock& b : healthy.blocks) ++blocks[b.recording];
  std::string text;
  for (const auto& [name, count] : blocks)
    text += fmt::format("{}{} block{} of {}", text.empty() ? "" : ", ", count, count == 1 ? "" : "s", name);
  return text + fmt::format(", {:.2g} h", healthy.hours());
}

}  // namespace bms::workflow
