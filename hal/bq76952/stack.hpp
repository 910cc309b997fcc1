// Two chips in series as one measuring chain, for a pack of 17 to 32 cells. The lower one has the lower cells (one more
// of an odd number), the shunt and hal/i2c.hpp; the upper one the other cells and hal/isolated_i2c.hpp. Both run the
// same driver (FrontEnd).
//
//   cells          of each half, if the chip is in its place and its clock is right; otherwise no_reading
//   pack voltage   sum of both stack voltages; no_reading if one is missing
//   current        of the lower chip. SRP and SRN of the upper one are at its VSS
//   temperatures   TS1 and TS3 of the lower chip, then of the upper one; the other thermistor inputs are off
//
// The place of a chip is wired to its PACK pin: VSS on the lower chip, the top of its cells on the upper one (10 kohm).
// Both answer to the same address, so nothing else would distinguish them if the two buses were exchanged. A half has
// readings only after a full scan has shown its place; a strap that is broken or exchanged takes them away.
//
// Time: both are read one after the other, the lower one first, and their scans are not synchronous
// (longest_skew_us()). If neither chip measures, each sample advances only one of them, so that no sample configures
// two.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake
#include "hal/bq76952/chip_clock.hpp"
#include "hal/bq76952/front_end.hpp"
#include "hal/calibration.hpp"
#include "hal/second_line.hpp"
#include "measurement/pack_sample.hpp"

namespace bms::hal::bq76952 {

class Stack {
 public:
  static constexpr std::uint32_t scan_us = 31'500;          ///< of all cells of a chip, with FASTADC
  static constexpr std::int32_t strap_high_uv = 5'000'000;  ///< of PACK: nine cells have more at any charge

  /// Configures both buses. Call once, before the first read().
  void start();
  struct Inputs {
    std::uint64_t time_us;
    std::array<measurement::PackSample<cell_inputs>, 2> of_half;
  };
  /// Call once per sample, with inputs.time_us set.
  void read(Inputs& inputs, const SensorCalibration& by, measurement::PackSample<pack_cells>& into);
  bool silent() const;
  /// SecondLineTrip bits of both chips.
  std::uint32_t trips() const { return trips_; }
  void clear_latch();
  FrontEndHealth health() const;
  /// The higher one of both chips' LD; measurement::no_reading if one is unknown.
  std::int32_t dc_link_uv() const;
  void shut_down();
  /// held_on: at least one of the chips; restarted: at least one, and none is held on.
  FrontEnd::AfterShutdown after_shut_down();
  /// cells: one bit per cell of the pack. A chip that is not in its place gets none.
  void bleed(std::uint32_t cells);

  /// Largest age between a lower and an upper cell of one sample since boot [us]: time between the two readings, and a
  /// scan.
  std::uint32_t longest_skew_us() const { return longest_skew_us_; }

 private:
  enum class Place : std::uint8_t { unknown, right, wrong };
  struct Half {
    FrontEnd chip;
    ChipClock clock;
    Place place = Place::unknown;
    bool stale = false;
    std::uint32_t wanted = 0;  ///< cells to bleed, from bit 0 on
    bool usable() const { return place == Place::right && !clock.wrong(); }
  };

  const Configuration& configuration(std::size_t half) const {
    return half == 0 ? board_configuration : upper_configuration;
  }
  void read_half(std::size_t half, measurement::PackSample<cell_inputs>& inputs);
  FrontEndState problem_of(std::size_t half) const;

  std::array<Half, 2> halves_;
  std::uint32_t trips_ = 0, longest_skew_us_ = 0;
  std::size_t turn_ = 0;  ///< the half that advances if neither measures
};

}  // namespace bms::hal::bq76952
