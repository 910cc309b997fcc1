// The chip as a measuring chain: detects it, configures it, reads it once per sample, and detects it again after a
// failure.
//
//   absent      tried after rests of 100 ms, doubled up to 1.6 s. Detected: it answers with or without CRC, the device
//               number is right, and it is not sealed.
//   compare     if the data memory has the right content and the chip was not reset (only this core restarted), it
//               measures at once
//   enter       CONFIG_UPDATE mode: no measurement, no protections of the chip
//   write       8 settings per sample; then all are read back. A setting that differs leads to absent.
//   leave       waits for the end of CONFIG_UPDATE mode and switches the CRC on
//   measure
//
// One state per sample. Only fresh values become readings: cells only if the chip has measured all of them since the
// last sample; stack, DC link and temperatures only if it has measured all inputs in the last two samples (94.5 ms);
// the current like the cells, and only while the seconds of the charge counter advance. If a transfer fails twice, its
// readings and all later ones of the sample are measurement::no_reading. A reset of the chip or two failed samples in a
// row lead to absent, and the next sample tries again.
//
// Time: 10 transfers, 8.9 ms; 14 while balancing is sent and read back (README.md). Memory: 200 bytes.
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
    std::uint32_t lost = 0;    ///< times that measuring ended
    std::uint32_t resets = 0;  ///< of the chip, detected while measuring
    std::uint32_t wrong_device = 0, sealed = 0;
    std::uint32_t wrong_setting = 0;  ///< settings that read back differently
    std::uint32_t not_fresh = 0;      ///< samples for which the chip had only old values
    std::uint32_t bleed_wrong = 0;    ///< times that the chip bled other cells than requested
    std::uint32_t trips = 0;          ///< samples in which one of the chip's own protections had tripped
  };

  /// settings: in the order of addresses; must outlive this object. configuration.hpp computes them at compile time.
  explicit constexpr FrontEnd(std::span<const Setting> settings) : settings_(settings) {}

  /// Call once per sample, with into.time_us set. Writes the fresh readings; all other fields are no_reading.
  void read(measurement::PackSample<cell_inputs>& into);

  /// cells: one bit per cell to bleed from the next read() on. Refreshed every 5 s, because the chip stops after 20 s.
  void bleed(std::uint32_t cells) { bleed_ = static_cast<std::uint16_t>(cells); }

  /// DC link of the last read() [uV], or no_reading.
  std::int32_t dc_link_uv() const { return dc_link_uv_; }
  State state() const { return state_; }
  const Counters& counters() const { return counters_; }
  const WireCounters& wire() const { return wire_.counters(); }
  std::uint32_t charge_restarts() const { return mean_current_.restarts(); }

 private:
  bool detect();
  bool compare();
  bool enter();
  bool write();
  bool leave();
  bool measure(measurement::PackSample<cell_inputs>& into);
  bool advance();
  bool compare_memory(bool& matches);
  bool no_reset();
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
  std::uint8_t scan_age_ = 0;  ///< samples since all inputs were measured
  std::uint32_t charge_time_s_ = 0;
  std::uint8_t charge_still_ = 0;  ///< samples since the charge counter's time advanced
  std::uint16_t bleed_ = 0, sent_bleed_ = 0;
  std::uint64_t sent_bleed_us_ = 0;
};

}  // namespace bms::hal::bq76952
