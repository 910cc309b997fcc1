// The chip as a measuring chain: found, configured, read once a sample; lost and found again.
//
//   absent      asked at rests of 100 ms, doubled to 1.6 s; found: in either way of talking, the device number right,
//   not sealed compare     what the data memory holds is what it should, and the chip was not reset: measure at once
//   (this core alone was restarted) enter       CONFIG_UPDATE mode: no measuring, no protections; 8 settings a sample,
//   write       then all read back; a setting that is not what was written: absent
//   leave       and whether it talks with CRC now
//   measure
//
// One state a sample. What is not fresh is not given: cells only when the chip has measured all of them since the last
// sample, stack, link and temperatures when it has measured everything in the last two (94.5 ms), the current as cells,
// and when the seconds of the charge counter go on. What a transfer that failed, and failed again, would have brought
// is measurement::no_reading, and so is all behind it. A chip that was reset, or two samples in a row with a failure:
// absent, and asked again with the next sample.
//
// Time: 10 transfers, 8.9 ms; 14 while bleeding is told and looked at; README.md. Memory: 200 bytes.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "hal/bq76952/configuration.hpp"
#include "hal/bq76952/mean_current.hpp"
#include "hal/bq76952/wire.hpp"
#include "measurement/pack_sample.hpp"

namespace bms::hal::bq76952 {

inline constexpr std::size_t cell_inputs = 16;

class FrontEnd {
 public:
  enum class State : std::uint8_t { absent, compare, enter, write, leave, measure };

  struct Counters {  // since boot; they wrap
    std::uint32_t found = 0, configured = 0;
    std::uint32_t lost = 0;    ///< from measuring
    std::uint32_t resets = 0;  ///< of the chip, seen while measuring
    std::uint32_t wrong_device = 0, sealed = 0;
    std::uint32_t wrong_setting = 0;  ///< read back other than written
    std::uint32_t not_fresh = 0;      ///< samples that were answered with old values
    std::uint32_t bleed_wrong = 0;    ///< times that the chip bled other cells than it was told
    std::uint32_t trips = 0;          ///< samples with one of the chip's own protections tripped
  };

  /// settings: by address, kept by the caller; configuration.hpp makes them in the compiler.
  explicit constexpr FrontEnd(std::span<const Setting> settings) : settings_(settings) {}

  /// Once a sample: into cells, pack, current and temperatures goes what could be read, of now.
  void read(measurement::PackSample<cell_inputs>& into);

  /// Cells to bleed from the next read() on, a bit each; told again every 5 s, for the chip lets go after 20.
  void bleed(std::uint32_t cells) { bleed_ = static_cast<std::uint16_t>(cells); }

  /// With the last read().
  std::int32_t dc_link_uv() const { return dc_link_uv_; }
  State state() const { return state_; }
  const Counters& counters() const { return counters_; }
  const WireCounters& wire() const { return wire_.counters(); }
  std::uint32_t charge_restarts() const { return mean_current_.restarts(); }

 private:
  bool find();
  bool compare();
  bool enter();
  bool write();
  bool leave();
  bool measure(measurement::PackSample<cell_inputs>& into);
  bool memory_is_right(bool& right);
  bool still_the_same();
  bool read_current(measurement::PackSample<cell_inputs>& into);
  bool read_scan(measurement::PackSample<cell_inputs>& into);
  bool refresh_balancing();
  void rest();
  void reset_measurement();

  std::span<const Setting> settings_;
  Wire wire_;
  MeanCurrent mean_current_;
  Counters counters_;
  State state_ = State::absent;
  std::uint64_t next_try_us_ = 0;
  std::uint32_t rest_us_ = 0;
  std::size_t next_setting_ = 0;
  std::uint8_t waited_ = 0, failures_ = 0;
  bool swapped_ = false, fresh_ = false;
  std::int32_t dc_link_uv_ = measurement::no_reading;
  std::uint8_t scans_ago_ = 0;  ///< samples since everything was measured
  std::uint32_t charge_time_s_ = 0;
  std::uint8_t charge_stands_ = 0;  ///< samples since the charge counter's time moved
  std::uint16_t bleed_ = 0, sent_bleed_ = 0;
  std::uint64_t sent_bleed_us_ = 0;
};

}  // namespace bms::hal::bq76952
