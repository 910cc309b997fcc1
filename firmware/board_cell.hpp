// The application's parts with this board's cell: the one place where what is generated comes in, the model's type
// here, its tables in the .cpp files.
#pragma once

#include <cstdint>

#include "cell_constants.hpp"  // generated from the cell file
#include "estimator/pack_estimator.hpp"
#include "estimator/soc_estimator.hpp"
#include "firmware/application.hpp"
#include "firmware/messages.hpp"
#include "hal/samples.hpp"
#include "protection/protection.hpp"
#if defined(BMS_VEHICLE_PROFILE_CIA418)
#include "firmware/cia418_profile.hpp"
#elif defined(BMS_VEHICLE_PROFILE_J1939)
#include "firmware/j1939_profile.hpp"
#endif

namespace bms::firmware {

#if defined(BMS_FIXED_POINT)
using BoardScalar = arithmetic::FixedPoint;  // a core without an FPU
#else
using BoardScalar = float;
#endif

using BoardEstimator = estimator::SocEstimator<BoardScalar, generated::Model>;

/// One step. A function of its own so that its cost can be counted.
BoardEstimator::Result estimator_step(BoardEstimator& estimator, const measurement::Sample& sample);

messages::Identity identity();
float capacity_ah();

#if defined(BMS_VEHICLE_PROFILE_CIA418)
using BoardVehicleProfile = Cia418Profile;
#elif defined(BMS_VEHICLE_PROFILE_J1939)
using BoardVehicleProfile = J1939Profile;
#else
using BoardVehicleProfile = WithoutVehicleProfile;
#endif

struct BoardCell {
  using Estimator = BoardEstimator;
  static constexpr std::size_t cells = hal::pack_cells;

  static Estimator::Result step(Estimator& estimator, const measurement::Sample& sample) {
    return estimator_step(estimator, sample);
  }
  static std::uint64_t estimated_us(const Estimator& estimator) { return estimator.time_us(); }
  static void update_condition(estimator::Condition<Estimator>& condition, const Estimator& estimator,
                               const measurement::Sample& sample, const Estimator::Result& estimate,
                               bool limits_wanted);
  static void update_cells(estimator::PackCells<BoardScalar, cells>& of, const measurement::PackSample<cells>& pack,
                           const Estimator::Result& estimate);
  static const model::PlausibleRange& plausible();
  static const protection::ProtectionPlan& plan();
};

}  // namespace bms::firmware
