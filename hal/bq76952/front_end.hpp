// The chip as a measuring chain: detects it, configures it, reads it once per sample, and detects it again after a
// failure.
//
//   absent      tried after rests of 100 ms, doubled up to 1.6 s. Detected: it answers with or without CRC, the device
//               number is right, and it is not sealed.
//   compare     if the data memory has the right content and the chip was not reset (only this core restarted), it
//               measures at once
//   enter       CONFIG_UPDATE mode: no measurement, no protections of the chip
//   write       11 settings per sample; then all are read back. A setting that differs leads to absent.
//   leave       waits for the end of CONFIG_UPDATE mode, switches the CRC on, finds out how much a read returns
//   measure
//
// One state per sample. Only fresh values become readings: cells only if the chip has measured all of them since the
// last sample; stack, DC link and temperatures only if it has measured all inputs in the last two samples (94.5 ms);
// the current like the cells, and only while the seconds of the charge counter advance. If a transfer fails twice, its
// readings and all later ones of the sample are measurement::no_reading. A reset of the chip or two failed samples in a
// row lead to absent, and the next sample tries again.
//
// A current beyond the range reads as the end of the range with its sign. The current comes from CC3's 32-bit counts,
// which do not wrap; it must agree with the 16 bits of CC3, or it is no_reading.
//
// Time: 11 transfers, 8.9 ms; 15 while balancing is sent and read back (README.md). Memory: 270 bytes.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "hal/bq76952/configuration.hpp"
#include "hal/bq76952/mean_current.hpp"
#include "hal/bq76952/registers.hpp"
#include "hal/bq76952/wire.hpp"
#include "hal/bytes.hpp"
#include "measurement/pack_sample.hpp"

namespace bms::hal::bq76952 {

class FrontEnd {
 public:
  enum class State : std::uint8_t { absent, compare, enter, write, leave, measure };

  struct Counters {  // since boot; they wrap
    std::uint32_t found = 0, configured = 0;
    std::uint32_t lost = 0;    ///< times that measuring ended
    std::uint32_t resets = 0;  ///< of the chip, detected while measuring
    std::uint32_t wrong_device = 0, sealed = 0;
    std::uint32_t wrong_setting = 0;    ///< settings that read back differently
    std::uint32_t not_fresh = 0;        ///< samples for which the chip had only old values
    std::uint32_t bleed_wrong = 0;      ///< times that the chip bled other cells than requested
    std::uint32_t trips = 0;            ///< samples in which one of the chip's own protections had tripped
    std::uint32_t current_differs = 0;  ///< samples in which the two forms of the current contradicted each other
  };

  /// All zero, so that it needs no space in flash; use() it before the first read().
  constexpr FrontEnd() = default;
  explicit constexpr FrontEnd(const Configuration& configuration) { use(configuration); }

  /// configuration: must outlive this object.
  constexpr void use(const Configuration& configuration) { configuration_ = &configuration; }
  constexpr void use(const Configuration& configuration, const Bus& bus) {
    use(configuration);
    wire_.bus = bus;
  }

  /// Call once per sample, with into.time_us set. Writes the fresh readings, cells at the place of their input; all
  /// other fields are no_reading.
  void read(measurement::PackSample<cell_inputs>& into);

  /// inputs: one bit per input whose cell is to be bled from the next read() on. Refreshed every 5 s, because the chip
  /// stops after 20 s.
  void bleed(std::uint32_t inputs) { bleed_ = static_cast<std::uint16_t>(inputs); }

  /// SHUTDOWN: its outputs and REG1 go off, until TS2 is pulled low or LD rises. Sealed it has to be sent twice.
  void shut_down() {
    for (int k = 0; k < 2; ++k) static_cast<void>(wire_.select(shutdown));
  }
  /// off: no answer. held_on: TS2 is low or LD high; it has received RESET. restarted: by TS2, or by that reset.
  enum class AfterShutdown : std::uint8_t { off, held_on, restarted };
  /// Call after shut_down(), as long as this core has a supply.
  AfterShutdown after_shut_down();

  /// SecondLineTrip bits of the last read().
  std::uint32_t trips() const { return trips_; }
  /// Ends a latched short circuit with the next read(). Has no effect unless the chip is measuring.
  void clear_latch() { clear_latch_ = state_ == State::measure; }
  /// Returns true if the chip has received nothing for so long that its host watchdog may have acted. The next transfer
  /// ends that, so the contactors must be open before it.
  bool silent() const;

  /// DC link of the last read() [uV], or no_reading.
  std::int32_t dc_link_uv() const { return dc_link_uv_; }
  /// Temperature of the chip's die in the last read() [0.01 degrees C], or no_temperature; measured with the DC link.
  std::int16_t die_cdegc() const { return die_cdegc_; }
  /// PACK pin of the last read() against VSS [uV], or no_reading; measured with the DC link.
  std::int32_t strap_uv() const {
    if (dc_link_uv_ == measurement::no_reading) return measurement::no_reading;
    return get_bytes<std::int16_t>(voltages_, pack_voltage - first_cell) * voltage_step_uv;
  }
  /// Returns true if the chip has measured its cells between the last two calls of read().
  bool fresh() const { return fresh_; }
  /// Seconds of the chip's charge counter.
  std::uint32_t charge_time_s() const { return charge_time_s_; }
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
  bool read_scan(measurement::PackSample<cell_inputs>& into);
  bool read_words(std::uint8_t command, std::span<std::uint8_t> into, std::span<std::uint8_t> last, std::size_t from);
  bool read_current(measurement::PackSample<cell_inputs>& into);
  std::int32_t current_ua(std::int32_t counts, std::int16_t steps);
  bool read_second_line();
  bool pins_follow(std::uint8_t safety_a, std::uint8_t safety_b, std::uint8_t safety_c, std::uint8_t fets);
  bool refresh_balancing();
  void rest();
  void reset_measurement();

  const Configuration* configuration_ = nullptr;
  Wire wire_;
  MeanCurrent mean_current_;
  Counters counters_;
  State state_ = State::absent;
  std::uint64_t next_try_us_ = 0;
  std::uint32_t rest_us_ = 0;
  std::size_t next_setting_ = 0;
  std::uint8_t waited_ = 0, failures_ = 0;
  bool swapped_ = false, fresh_ = false;
  std::int16_t die_cdegc_ = measurement::no_temperature;
  std::int32_t dc_link_uv_ = 0;
  std::uint8_t scan_age_ = 0;  ///< samples since all inputs were measured
  std::uint32_t charge_time_s_ = 0;
  std::uint8_t charge_still_ = 0;  ///< samples since the charge counter's time advanced
  std::uint16_t bleed_ = 0, sent_bleed_ = 0;
  std::uint64_t sent_bleed_us_ = 0;
  std::array<std::uint8_t, ld_voltage + 2 - first_cell> voltages_{};
  std::array<std::uint8_t, hdq_temperature + 2 - alarm_status> temperatures_{};  ///< alarm_status first

  // second line
  std::uint32_t trips_ = 0;
  std::uint64_t answered_us_ = 0;              ///< time of the last complete exchange
  std::uint16_t alarm_ = 0;                    ///< Alarm Status of this sample, and trips not yet reported
  std::uint8_t safety_a_ = 0, safety_bc_ = 0;  ///< of the last sample
  std::uint8_t pins_wrong_ = 0;                ///< samples in a row
  bool failed_permanently_ = false, latched_ = false, clear_latch_ = false;
  bool ran_ = false;          ///< has measured since boot
  bool interrupted_ = false;  ///< since the last complete sample the chip had no host or no settings
};

}  // namespace bms::hal::bq76952
