// The measuring part of the BQ76952 model: the scan of the voltages in slots and the three filters of the current.
//
// Sources: schedule SLUSE13B, 8.3 ("measurement loop") and SLUAB27, 2; filters SLUAAQ5 and SLUUBY2B, 4.3 to 4.6; range
// of a cell SLUUCW9, 4.1; gains SLUUBY2B, 4.12; layout of DASTATUS5 by two published drivers.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <span>
#include <utility>

#include "tests/hal/bq76952_circuit.hpp"
#include "tests/hal/bq76952_memory.hpp"

namespace bms::bq {

/// Faults of the measuring part that a test can inject.
struct MeasurementFaults {
  bool frozen = false;            ///< no conversion ends
  bool only_cells = false;        ///< the slots of stack, PACK, LD and temperatures are skipped
  double cc3_loses = 0;           ///< fraction of the current that CC3 does not contain
  std::uint16_t zero_cells = 0;   ///< cells whose register reads 0 (E2E 1344061: cells 5 to 10 above the OCD1 current)
  std::uint16_t stale_cells = 0;  ///< cells whose register keeps its value
};

class Measurement {
 public:
  Measurement(const Memory& memory, const ChipVariant& variant) : memory_(memory), variant_(variant) {}

  void reset();                   ///< all registers 0
  void restart();                 ///< the scan begins again; registers keep their values
  void restart_charge();          ///< RESET_PASSQ
  std::uint64_t next_us() const;  ///< until the next conversion ends
  /// Advances by at most next_us(). `measures`: the chip is in NORMAL mode.
  void step(std::uint64_t us, const Bq76952Inputs& in, const MeasurementFaults& faults, bool measures,
            std::uint16_t balancing);

  std::uint8_t direct(std::uint8_t at) const { return direct_[at & 0x7F]; }
  int cell_mv(std::size_t k) const { return static_cast<std::int16_t>(word(0x14 + 2 * k)); }
  std::int16_t cc2() const { return cc2_; }
  double cc1_ma() const { return cc1_ma_; }
  double user_ma() const;             ///< size of userA [mA]
  bool has_cell_temperature() const;  ///< a thermistor is configured as cell temperature and was measured
  int max_cell_dk() const, min_cell_dk() const, fet_dk() const, internal_dk() const;  ///< [0.1 K]
  bool full_scan_done() const { return full_scans_ > 0; }
  unsigned quarter_seconds() const { return quarter_seconds_; }

  void fill_dastatus5(std::span<std::uint8_t> to) const;
  void fill_dastatus6(std::span<std::uint8_t> to) const;
  void fill_raw_cells(std::span<std::uint8_t> to, std::size_t first_cell) const;  ///< DASTATUS1 to 4

  /// True once after a scan (ADSCAN) or a full set of three (FULLSCAN).
  bool take_scan() { return std::exchange(scan_, false); }
  bool take_full_scan() { return std::exchange(full_scan_, false); }

 private:
  std::uint64_t slot_us() const;
  int slots() const;
  void slot_ends(const Bq76952Inputs& in, const MeasurementFaults& faults, std::uint16_t balancing);
  void current_ends(const MeasurementFaults& faults);
  void quarter_ends();
  void scan_ends(bool only_cells, std::uint16_t balancing);
  void store_cell(std::size_t k, const Bq76952Inputs& in, const MeasurementFaults& faults);
  void store_divider(const Bq76952Inputs& in);
  void store_thermistor(int of_scan, const Bq76952Inputs& in);
  std::uint8_t pin_config(std::size_t pin) const {
    return static_cast<std::uint8_t>(memory_.read(static_cast<std::uint16_t>(first_pin_config + pin), 1));
  }
  int enabled_thermistors() const;
  double counts_of(double shunt_v) const;  ///< 32-bit counts of the coulomb counter
  std::int16_t to_user_current(double counts) const;
  std::uint16_t word(std::size_t at) const { return static_cast<std::uint16_t>(direct_[at] | direct_[at + 1] << 8); }

  const Memory& memory_;
  const ChipVariant& variant_;
  std::array<std::uint8_t, 128> direct_{};
  std::array<std::int32_t, 16> cell_counts_{}, cell_current_counts_{};
  std::uint64_t slot_left_us_ = 3'000, quarter_left_us_ = 250'000;
  double slot_vs_ = 0, quarter_vs_ = 0;  ///< integrals of the shunt voltage
  double cc2_counts_ = 0, cc3_sum_ = 0, cc3_counts_ = 0, cc1_ma_ = 0;
  int cc3_count_ = 0, slot_ = 0, loop_ = 0;
  std::deque<double> cc3_last_;
  std::int16_t cc1_ = 0, cc2_ = 0, cc3_ = 0;
  std::int64_t charge_ =
      0x7FFF'FFFF;  ///< [userAh / 2^32]; starts at half a userAh, so that the integer part is rounded
  unsigned quarter_seconds_ = 0, full_scans_ = 0;
  bool scan_ = false, full_scan_ = false;
};

}  // namespace bms::bq
