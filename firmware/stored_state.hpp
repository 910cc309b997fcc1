// Converts estimate and condition into the integers that are stored (firmware/storage/persistence.hpp), and stored
// integers back into starting values.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "estimator/condition.hpp"
#include "estimator/pack_estimator.hpp"
#include "firmware/commands.hpp"
#include "firmware/messages.hpp"
#include "hal/calibration.hpp"
#include "storage/persistence.hpp"

namespace bms::firmware {

// Keys of the stored settings and codes of the stored faults.
inline constexpr std::uint16_t latched_faults_key = 1;       ///< bits 0 to 31 of protection::Decision::latched
inline constexpr std::uint16_t more_latched_faults_key = 3;  ///< its bits 32 to 63
inline constexpr std::uint16_t cell_file_key = 2;            ///< hash of the cell file that the stored data belong to
/// Four keys for hal::SensorCalibration: gain [ppm] and offset [uV] of the voltage, gain [ppm] and offset [uA] of the
/// current.
inline constexpr std::uint16_t first_calibration_key = 16;
inline constexpr std::uint16_t first_fault_code = 1;  ///< code of protection::Fault 0

/// Returns value * factor as an integer, clamped to +-2,147,000,000. Not-a-number becomes 0.
constexpr std::int32_t scaled_to_integer(float value, float factor) {
  const float scaled = value * factor;
  constexpr float most = 2'147'000'000.0F;
  if (!(scaled > -most)) return scaled <= -most ? -2'147'000'000 : 0;
  return scaled < most ? static_cast<std::int32_t>(scaled) : 2'147'000'000;
}

/// The stored part of estimate, condition and cells.
template <class S, std::size_t Cells>
class StateToStoreOf {
 public:
  template <class Estimate, class Condition>
  constexpr StateToStoreOf(const Estimate& e, const Condition& condition, const estimator::PackCells<S, Cells>& cells) {
    using messages::number;
    constexpr float ppm = 1e6F;
    const bool known = (e.flags & estimator::not_started) == 0 && number(e.soc_sigma) > 0;
    if (known) values_.pack = estimator::StoredEstimate{messages::ppb(e.soc), messages::ppb(e.soc_sigma)};
    const auto capacity = condition.capacity(), resistance = condition.resistance();
    values_.health = {scaled_to_integer(number(capacity.ratio), ppm), scaled_to_integer(number(capacity.sigma), ppm),
                      scaled_to_integer(number(resistance.ratio), ppm),
                      scaled_to_integer(number(resistance.sigma), ppm)};
    if constexpr (Cells > 1) {
      for (std::size_t k = 0; k < Cells; ++k) {
        const std::int32_t soc = messages::ppb(cells[k].soc()) / per_unit,
                           sigma = messages::ppb(cells[k].soc_sigma()) / per_unit;
        cells_[k] = {static_cast<std::int16_t>(std::clamp<std::int32_t>(soc, -most, most)),
                     static_cast<std::uint16_t>(std::clamp<std::int32_t>(sigma, 0, 65'535))};
      }
    }
  }

  constexpr storage::EstimatorSnapshot values() const {
    storage::EstimatorSnapshot v = values_;
    if constexpr (Cells > 1) v.cells = cells_;
    return v;
  }

 private:
  static constexpr std::int32_t per_unit = 10'000, most = 32'000;  // ppb per unit of CellsRecord; units

  storage::EstimatorSnapshot values_;
  std::array<storage::CellsRecord::Cell, Cells> cells_{};
};

/// Range of the readings of a sample. Readings that the sensors cannot give are omitted.
inline storage::ReadingRange reading_range(std::span<const std::int32_t> cell_uv, std::span<const std::int16_t> cdegc,
                                           std::int32_t current_ua, const model::PlausibleRange& plausible) {
  using storage::ReadingRange;
  ReadingRange r;
  for (const std::int32_t uv : cell_uv) {
    if (uv >= plausible.voltage_min_uv && uv <= plausible.voltage_max_uv)
      r.add(ReadingRange::voltage, static_cast<std::int16_t>(uv / 1'000));
  }
  for (const std::int16_t t : cdegc) {
    if (measurement::temperature_possible(t)) r.add(ReadingRange::temperature, static_cast<std::int16_t>(t / 100 + 60));
  }
  if (current_ua != measurement::no_reading)
    r.add(ReadingRange::current,
          static_cast<std::int16_t>(std::clamp<std::int32_t>(current_ua / 250'000, -8'191, 8'191)));
  return r;
}

/// Calibration of the measuring chain from the stored settings, with `change` in place of the stored value; 0 where
/// nothing is stored.
inline hal::SensorCalibration stored_calibration(
    const storage::Persistence& persistence, const std::optional<Requested::CalibrationChange>& change = std::nullopt) {
  const auto value = [&](std::uint16_t k) {
    if (change && change->which == k) return change->value;
    return persistence.settings().get(static_cast<std::uint16_t>(first_calibration_key + k)).value_or(0);
  };
  return {value(0), value(1), value(2), value(3)};
}

/// Returns true if the stored estimates were made with another cell file. They are not valid with this one.
inline bool stored_for_another_cell_file(const storage::Persistence& persistence, std::uint32_t cell_hash) {
  const auto stored = persistence.settings().get(cell_file_key);
  return stored && static_cast<std::uint32_t>(*stored) != cell_hash;
}

/// Returns the stored state of charge, or nothing if none is valid.
inline std::optional<measurement::StartingPoint> stored_starting_point(const storage::Persistence& persistence,
                                                                       std::uint32_t cell_hash) {
  if (stored_for_another_cell_file(persistence, cell_hash)) return std::nullopt;
  return persistence.starting_point();
}

/// Restores capacity and resistance. What no measurement can have given is ignored.
template <class Estimator, class Condition>
constexpr void restore_health(Estimator& estimator, Condition& condition,
                              const std::optional<storage::HealthRecord>& stored) {
  constexpr std::int32_t least_ppm = 100'000, most_ppm = 4'000'000, whole_ppm = 1'000'000;
  const auto possible = [](std::int32_t ratio_ppm, std::int32_t sigma_ppm) {
    return ratio_ppm >= least_ppm && ratio_ppm <= most_ppm && sigma_ppm > 0 && sigma_ppm <= whole_ppm;
  };
  if (!stored || !possible(stored->capacity_ppm, stored->capacity_sigma_ppm) ||
      !possible(stored->resistance_ppm, stored->resistance_sigma_ppm))
    return;
  estimator.restore_capacity({stored->capacity_ppm, stored->capacity_sigma_ppm});
  condition.restore(estimator.capacity(), stored->resistance_ppm, stored->resistance_sigma_ppm);
}

/// Restores the differences of the cells. Ignored if the number of cells differs.
template <class S, std::size_t Cells>
constexpr void restore_cells(estimator::PackCells<S, Cells>& cells, const storage::CellsRecord& stored) {
  if (stored.count != Cells) return;
  for (std::size_t k = 0; k < Cells; ++k) {
    if (stored.cell[k].sigma > 0)
      cells.begin(k, arithmetic::from_micro<arithmetic::Voltage<S>>(stored.cell[k].soc * 10),
                  arithmetic::from_micro<arithmetic::Voltage<S>>(stored.cell[k].sigma * 10));
  }
}

}  // namespace bms::firmware
