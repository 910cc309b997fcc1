#include "replay/can_log.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "files/bad_input.hpp"
#include "files/logs/text_lines.hpp"
#include "measurement/recording_checks.hpp"
#include "monitor/frame_source.hpp"

namespace bms::replay {

namespace {

constexpr std::size_t fewest_samples = 10;  ///< of a run, as of any recording
/// The times of firmware and frames may differ by this: the frames' clock is set, or frames wait in an adapter.
constexpr double time_tolerance_s = 60, time_tolerance_factor = 1.5;

/// Assembles samples from their three frames. A frame that is invalid, or of another sample, starts again.
class Runs {
 public:
  explicit Runs(std::string path) : path_(std::move(path)) {}

  /// received_s: time of the frame in the log.
  void receive(const can::Frame& frame, double received_s) {
    if (is<can::SampleCurrent>(frame)) {
      const auto m = can::SampleCurrent::of(frame);
      counter_ = static_cast<std::uint16_t>(m.sample_counter);
      building_ = measurement::Sample{};
      building_.current_ua = m.current_ua;
      parts_ = 1;
    } else if (is<can::SampleVoltage>(frame) && parts_ == 1) {
      const auto m = can::SampleVoltage::of(frame);
      building_.voltage_uv = m.voltage_uv;
      building_.temperature_cdegc = static_cast<std::int16_t>(m.temperature_cdegc);
      parts_ = 2;
    } else if (is<can::SampleTime>(frame) && parts_ == 2) {
      const auto m = can::SampleTime::of(frame);
      building_.time_us = std::uint64_t{m.time_high} << 32 | m.time_low;
      add(received_s);
      parts_ = 3;
    } else if (is<can::EstimateHash>(frame) && parts_ == 3) {
      const auto m = can::EstimateHash::of(frame);
      if (m.sample_counter == counter_) runs_.back().hashes.back() = m.hash;
    } else {
      receive_start(frame);
    }
  }
  /// To be called after the last frame.
  std::vector<CanLog> finish() {
    drop_short();
    return std::move(runs_);
  }
  std::size_t samples() const { return count_; }
  std::size_t longest() const { return longest_; }  ///< samples of the longest run
  std::size_t dropped() const { return dropped_; }  ///< runs that cannot be replayed

 private:
  /// What the firmware sends before its first sample.
  struct StartFrames {
    bool received = false;
    std::optional<measurement::StartingPoint> point;
  };

  template <class Message>
  static bool is(const can::Frame& frame) {
    return frame.id == Message::id && can::intact(frame, Message::data_id);
  }

  void receive_start(const can::Frame& frame) {
    if (is<can::StartingSoc>(frame)) {
      const auto m = can::StartingSoc::of(frame);
      start_ = {true, std::nullopt};
      if (m.given != 0) start_.point = measurement::StartingPoint{m.soc_ppb, 0};
    } else if (is<can::StartingSigma>(frame) && start_.point) {
      start_.point->soc_sigma_ppb = can::StartingSigma::of(frame).sigma_ppb;
    } else if (is<can::Health>(frame) && capacity_wanted_) {
      receive_capacity(can::Health::of(frame));
    } else if (is<can::Identity>(frame)) {
      cell_hash_ = can::Identity::of(frame).cell_hash;
      if (!runs_.empty()) runs_.back().cell_hash = cell_hash_;
    }
  }

  /// The first one of a run has the capacity with which the firmware began: it takes minutes to learn another one.
  void receive_capacity(const can::Health& m) {
    capacity_wanted_ = false;
    if (m.capacity > 0 && m.capacity_sigma > 0)
      runs_.back().start.capacity = {static_cast<std::int32_t>(std::lround(1e4F * m.capacity)),
                                     static_cast<std::int32_t>(std::lround(1e4F * m.capacity_sigma))};
  }

  /// Samples between the last one and this one.
  std::uint16_t missing() const { return static_cast<std::uint16_t>(counter_ - last_counter_ - 1); }

  bool begins_a_run(double received_s) const {
    if (count_ == 1 || building_.time_us < last_time_us_) return true;
    const double step_s = 1e-6 * static_cast<double>(building_.time_us - last_time_us_);
    const double received_step_s = received_s - last_received_s_;
    const auto far_above = [](double a_s, double b_s) {
      return a_s > time_tolerance_factor * std::max(b_s, 0.0) + time_tolerance_s;
    };
    return far_above(step_s, received_step_s) || (missing() != 0 && far_above(received_step_s, step_s));
  }

  void add(double received_s) {
    if (++count_ > measurement::most_log_samples) {
      throw files::BadInput(
          path_, 1, fmt::format("more samples, expected at most {}: split the log", measurement::most_log_samples));
    }
    if (begins_a_run(received_s)) {
      drop_short();
      CanLog& run = runs_.emplace_back();
      run.from_the_start = start_.received && counter_ == 1;
      if (run.from_the_start) run.start = start_.point;
      capacity_wanted_ = run.from_the_start;
      run.cell_hash = cell_hash_;
    } else {
      runs_.back().lost += missing();
    }
    start_ = {};
    last_time_us_ = building_.time_us;
    last_counter_ = counter_;
    last_received_s_ = received_s;
    CanLog& run = runs_.back();
    run.samples.push_back(building_);
    run.hashes.emplace_back();
    if (run.lost == 0) run.unbroken = run.samples.size();
  }

  /// Leaves out the last run if it cannot be replayed.
  void drop_short() {
    if (runs_.empty()) return;
    const std::vector<measurement::Sample>& samples = runs_.back().samples;
    longest_ = std::max(longest_, samples.size());
    if (samples.size() >= fewest_samples && samples.back().time_us > samples.front().time_us) return;
    runs_.pop_back();
    ++dropped_;
  }

  std::string path_;
  std::vector<CanLog> runs_;
  measurement::Sample building_;
  int parts_ = 0;
  std::uint16_t counter_ = 0, last_counter_ = 0;
  double last_received_s_ = 0;
  std::uint64_t last_time_us_ = 0;
  std::size_t count_ = 0, longest_ = 0, dropped_ = 0;
  StartFrames start_;
  bool capacity_wanted_ = false;
  std::optional<std::uint32_t> cell_hash_;
};

double number(std::int64_t value, std::int64_t none, double scale) {
  return value == none ? std::numeric_limits<double>::quiet_NaN() : scale * static_cast<double>(value);
}

/// Reads the whole log. Returns the number of lines that are not frames.
std::uint64_t read_frames(const std::string& path, Runs& runs) {
  try {
    const auto source = monitor::open_dump(path);
    std::vector<monitor::BusFrame> room(4'096);
    while (!source->ended()) {
      const std::size_t n = source->read(room, 0);
      for (std::size_t k = 0; k < n; ++k) {
        if (room[k].kind == monitor::FrameKind::standard)
          runs.receive(monitor::to_can_frame(room[k]), 1e-6 * static_cast<double>(room[k].time_us));
      }
    }
    return source->malformed();
  } catch (const monitor::SourceError& refused) {
    throw files::BadInput(path, refused.line == 0 ? 1 : refused.line, refused.what());
  }
}

[[noreturn]] void refuse_without_run(const std::string& path, const Runs& runs) {
  if (runs.samples() == 0) {
    throw files::BadInput(
        path, 1,
        "no samples, expected the frames SampleCurrent, SampleVoltage and SampleTime (0x199 to 0x19B): "
        "switch on the log of samples with a command");
  }
  if (runs.longest() < fewest_samples) {
    throw files::BadInput(path, 1,
                          fmt::format("{} samples in the longest run of the firmware, expected {} or more",
                                      runs.longest(), fewest_samples));
  }
  throw files::BadInput(path, 1, "all samples have the same time, expected times that increase");
}

void fill_recording(const std::string& path, CanLog& log) {
  measurement::Recording& r = log.recording;
  r.path = path;
  const std::uint64_t begin_us = log.samples.front().time_us;
  for (const measurement::Sample& s : log.samples) {
    r.time_s.edit().push_back(1e-6 * static_cast<double>(s.time_us - begin_us));
    r.current_a.edit().push_back(number(s.current_ua, measurement::no_reading, 1e-6));
    r.voltage_v.edit().push_back(number(s.voltage_uv, measurement::no_reading, 1e-6));
    r.temperature_c.edit().push_back(number(s.temperature_cdegc, measurement::no_temperature, 1e-2));
  }
  if (!log.from_the_start)
    r.warnings.push_back(
        {"log_from_later",
         "the log does not begin with the first sample of the firmware: the estimates cannot be compared"});
  if (log.lost > 0)
    r.warnings.push_back({"samples_lost", fmt::format("samples missing in the log: {}, the first after sample {}",
                                                      log.lost, log.unbroken)});
}

bool begins_with_frames(const std::string& path) {
  try {
    const auto source = monitor::open_dump(path);
    std::vector<monitor::BusFrame> room(1);
    while (!source->ended()) {
      if (source->read(room, 0) > 0) return true;
    }
  } catch (const monitor::SourceError&) {
  }
  return false;
}

}  // namespace

bool is_can_log(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return false;  // opening a pipe would take its first bytes
  std::ifstream in(path, std::ios::binary);
  std::array<char, 2> first{};
  in.read(first.data(), 2);
  const bool compressed = first[0] == '\x1f' && first[1] == '\x8b';
  if (!in || !compressed) return in && first[0] == '(';
  try {
    files::TextLines lines(path);
    std::string_view line;
    return !lines.next(line) || line.starts_with('(');
  } catch (const files::BadInput&) {
    return begins_with_frames(path);  // damaged: read_can_log() reads what is left of a log
  }
}

std::vector<CanLog> read_can_log(const std::string& path) {
  Runs runs(path);
  const std::uint64_t malformed = read_frames(path, runs);
  std::vector<CanLog> logs = runs.finish();
  if (logs.empty()) refuse_without_run(path, runs);
  for (CanLog& log : logs) {
    fill_recording(path, log);
    std::vector<measurement::Warning>& warnings = log.recording.warnings;
    if (runs.dropped() > 0) {
      warnings.push_back({"short_runs", fmt::format("runs of less than {} samples, or without increasing time, that "
                                                    "are left out: {}",
                                                    fewest_samples, runs.dropped())});
    }
    if (malformed > 0) warnings.push_back({"not_a_frame", fmt::format("lines that are not frames: {}", malformed)});
    measurement::check_recording(log.recording);
  }
  return logs;
}

std::optional<std::string> difference_to_log(const CanLog& log, const Track& track, std::size_t& compared) {
  compared = 0;
  if (!log.from_the_start) return std::nullopt;
  estimator::EstimateHash hash;
  const std::size_t states = track.state_names.size();
  for (std::size_t k = 0; k < log.unbroken; ++k) {
    hash.add(track.rows.words()[k]);
    for (std::size_t s = 0; s < states; ++s) hash.add(std::array{track.state_words[k * states + s]});
    if (!log.hashes[k]) continue;
    if (*log.hashes[k] != hash.value())
      return fmt::format("estimates differ from the firmware's at sample {} (time {:g} s) or since {}", k + 1,
                         log.recording.time_s[k],
                         compared == 0 ? std::string("the start") : fmt::format("sample {}", compared));
    compared = k + 1;
  }
  return std::nullopt;
}

}  // namespace bms::replay
