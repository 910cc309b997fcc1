// Everything that the firmware knows after a sample: the input of every message that it publishes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "estimator/condition.hpp"
#include "estimator/pack_estimator.hpp"
#include "hal/board_state.hpp"
#include "hal/insulation.hpp"
#include "hal/truck_inputs.hpp"
#include "measurement/pack_sample.hpp"
#include "protection/protection.hpp"
#include "storage/persistence.hpp"

namespace bms::firmware {

/// Self-diagnosis of the board.
struct BoardStatus {
  hal::BoardState state;
  bool cell_file_changed = false;  ///< the stored data belong to another cell file
  bool parameters_lost = false;    ///< the stored parameters cannot be read (firmware/parameters/)
  hal::TruckInputs truck;
  hal::Insulation insulation;
  std::uint32_t truck_outputs = 0;  ///< bits of hal::TruckOutput
  std::uint32_t wrong_current_sensor = can::TruckInputs::wrong_current_sensor_none;
  std::uint32_t longest_sample_us = 0;  ///< longest processing time of a sample so far; 0: not known yet

  constexpr bool unfit() const { return state.unfit() || cell_file_changed; }
  constexpr bool alarming() const { return unfit() || state.supply_low; }
};

/// References to the parts of the application. Valid while the sample is processed.
template <class Estimator, std::size_t Cells>
struct Snapshot {
  const measurement::PackSample<Cells>& pack;
  const measurement::Sample& mean;  ///< mean of the cells: the estimator's input
  const typename Estimator::Result& estimate;
  const estimator::Condition<Estimator>& condition;
  const estimator::PackCells<typename Estimator::Scalar, Cells>& cells;
  const protection::Decision& decision;
  const protection::ProtectionPlan& plan;
  const storage::Persistence& persistence;
  const BoardStatus& board;
  float capacity_ah;                        ///< of the cell file
  bool log_samples;                         ///< SampleCurrent to EstimateHash are sent, too
  std::optional<std::uint8_t> stored_part;  ///< part of the stored data to be sent (firmware/stored_data.hpp)
  std::optional<can::RequestChallenge> request_challenge{};  ///< if requests for power need a key

  constexpr bool soc_known() const { return (estimate.flags & estimator::not_started) == 0; }
};

}  // namespace bms::firmware
