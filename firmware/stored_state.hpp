// What of an estimate and of a condition is stored (storage/persistence.hpp), as integers; and what is taken up again.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "estimator/condition.hpp"
#include "estimator/pack_estimator.hpp"
#include "firmware/messages.hpp"
#include "hal/calibration.hpp"
#include "storage/persistence.hpp"

namespace bms::firmware {

// Keys of the settings, and codes of the faults, that this firmware stores.
inline constexpr std::uint16_t latched_faults_key = 1;  ///< protection::Decision::kept
inline constexpr std::uint16_t cell_file_key =
    2;  ///< messages::Identity::cell_hash of the cell file that what is stored belongs to
inline constexpr std::uint16_t first_calibration_key =
    16;  ///< voltage's gain [ppm] and offset [uV], current's gain [ppm] and offset [uA]: hal::Calibration
inline constexpr std::uint16_t first_fault_code = 1;  ///< of protection::Fault 0

/// Not a number, or beyond what fits: the nearest that does, 0 for NaN.
constexpr std::int32_t scaled_to_integer(float value, float by) {
  const float scaled_to_integer = value * by;
  constexpr float most = 2'147'000'000.0F;
  if (!(scaled_to_integer > -most)) return scaled_to_integer <= -most ? -2'147'000'000 : 0;
  return scaled_to_integer < most ? static_cast<std::int32_t>(scaled_to_integer) : 2'147'000'000;
}

template <class S, std::size_t Cells>
class SnapshotOf {
 public:
  template <class Estimate, class Condition>
  constexpr SnapshotOf(const Estimate& e, const Condition& condition, const estimator::PackCells<S, Cells>& cells) {
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
        cells_[k] = {static_cast<std::int16_t>(soc > most    ? most
                                               : soc < -most ? -most
                                                             : soc),
                     static_cast<std::uint16_t>(sigma > 0 ? sigma < 65'535 ? sigma : 65'535 : 0)};
      }
    }
  }

  constexpr storage::EstimatorSnapshot values() const {
    storage::EstimatorSnapshot v = values_;
    if constexpr (Cells > 1) v.cells = cells_;
    return v;
  }

 private:
  static constexpr std::int32_t per_unit = 10'000, most = 32'000;  // ppb in a unit of CellsRecord

  storage::EstimatorSnapshot values_;
  std::array<storage::CellsRecord::Cell, Cells> cells_{};
};

inline hal::SensorCalibration stored_calibration(const storage::Persistence& persistence) {
  const auto value = [&](std::uint16_t k) {
    return persistence.settings().get(static_cast<std::uint16_t>(first_calibration_key + k)).value_or(0);
  };
  return {value(0), value(1), value(2), value(3)};
}

/// State of charge, cells and health that are stored were estimated with another cell file: they mean nothing with this
/// one.
inline bool stored_for_another_cell_file(const storage::Persistence& persistence, std::uint32_t cell_hash) {
  const auto stored = persistence.settings().get(cell_file_key);
  return stored && static_cast<std::uint32_t>(*stored) != cell_hash;
}

/// Where to begin, as far as it is remembered.
inline std::optional<measurement::StartingPoint> stored_starting_point(const storage::Persistence& persistence,
                                                                       std::uint32_t cell_hash) {
  if (stored_for_another_cell_file(persistence, cell_hash)) return std::nullopt;
  return persistence.starting_point();
}

/// A pack of another number of cells is another pack.
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
