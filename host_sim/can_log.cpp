#include "host_sim/can_log.hpp"

#include <array>
#include <cmath>
#include <fstream>
#include <limits>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from can/greybox_bms.dbc
#include "files/bad_input.hpp"
#include "monitor/frame_source.hpp"

namespace bms::host_sim {

namespace {

/// Assembles samples from their three frames. A frame that is invalid, or of another sample, starts again.
class Samples {
 public:
  explicit Samples(CanLog& log) : log_(log) {}

  void receive(const can::Frame& frame) {
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
      add();
      parts_ = 3;
    } else if (is<can::EstimateHash>(frame) && parts_ == 3) {
      const auto m = can::EstimateHash::of(frame);
      if (m.sample_counter == counter_) log_.hashes.back() = m.hash;
    } else if (is<can::StartingSoc>(frame) && log_.samples.empty()) {
      const auto m = can::StartingSoc::of(frame);
      starts_ = true;
      if (m.given != 0) log_.start = measurement::StartingPoint{m.soc_ppb, 0};
    } else if (is<can::StartingSigma>(frame) && log_.samples.empty() && log_.start) {
      log_.start->soc_sigma_ppb = can::StartingSigma::of(frame).sigma_ppb;
    } else if (is<can::Identity>(frame)) {
      log_.cell_hash = can::Identity::of(frame).cell_hash;
    }
  }
  std::uint64_t lost() const { return lost_; }

 private:
  template <class Message>
  static bool is(const can::Frame& frame) {
    return frame.id == Message::id && can::intact(frame, Message::data_id);
  }

  void add() {
    if (log_.samples.empty())
      log_.from_the_start = starts_ && counter_ == 1;
    else if (const std::uint16_t missing = static_cast<std::uint16_t>(counter_ - last_ - 1); missing != 0)
      note_lost(missing);
    last_ = counter_;
    log_.samples.push_back(building_);
    log_.hashes.emplace_back();
    if (!broken_) log_.unbroken = log_.samples.size();
  }

  void note_lost(std::uint16_t missing) {
    lost_ += missing;
    broken_ = true;
  }

  CanLog& log_;
  measurement::Sample building_;
  int parts_ = 0;
  std::uint16_t counter_ = 0, last_ = 0;
  std::uint64_t lost_ = 0;
  bool starts_ = false, broken_ = false;
};

double number(std::int64_t value, std::int64_t none, double scale) {
  return value == none ? std::numeric_limits<double>::quiet_NaN() : scale * static_cast<double>(value);
}

}  // namespace

bool is_can_log(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::array<char, 2> first{};
  in.read(first.data(), 2);
  return in && (first[0] == '(' || (first[0] == '\x1f' && first[1] == '\x8b'));
}

CanLog read_can_log(const std::string& path) {
  CanLog log;
  log.recording.path = path;
  Samples samples(log);
  std::uint64_t malformed = 0;
  try {
    const auto source = monitor::open_dump(path);
    std::vector<monitor::BusFrame> room(4'096);
    while (!source->ended()) {
      const std::size_t n = source->read(room, 0);
      for (std::size_t k = 0; k < n; ++k) {
        if (room[k].kind == monitor::FrameKind::standard) samples.receive(monitor::to_can_frame(room[k]));
      }
    }
    malformed = source->malformed();
  } catch (const monitor::SourceError& refused) {
    throw files::BadInput(path, refused.line == 0 ? 1 : refused.line, refused.what());
  }
  if (log.samples.size() < 2)
    throw files::BadInput(
        path, 1,
        "no samples, expected the frames SampleCurrent, SampleVoltage and SampleTime (0x199 to 0x19B): "
        "switch on the log of samples with a command");
  measurement::Recording& r = log.recording;
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
  if (samples.lost() > 0)
    r.warnings.push_back({"samples_lost", fmt::format("samples missing in the log: {}, the first after sample {}",
                                                      samples.lost(), log.unbroken)});
  if (malformed > 0) r.warnings.push_back({"not_a_frame", fmt::format("lines that are not frames: {}", malformed)});
  return log;
}

std::optional<std::string> difference_to_log(const CanLog& log, const Track& track, std::size_t& compared) {
  compared = 0;
  if (!log.from_the_start) return std::nullopt;
  estimator::EstimateHash hash;
  const std::size_t states = track.state_names.size();
  for (std::size_t k = 0; k < log.unbroken; ++k) {
    hash.add(track.words[k]);
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

}  // namespace bms::host_sim
