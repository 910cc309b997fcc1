// Binds the application to this board: scalar type, number of cells, cell file and vehicle profile. Only this header
// and its .cpp files include the generated headers of the board and of the cell.
#pragma once

#include <cstdint>
#include <type_traits>

#include "board_config.hpp"    // generated from boards/<board>/board.cmake and the build options
#include "cell_constants.hpp"  // generated from the cell file
#include "estimator/pack_estimator.hpp"
#include "estimator/soc_estimator.hpp"
#include "firmware/application.hpp"
#include "firmware/board_parameters.hpp"
#include "firmware/cia418_profile.hpp"
#include "firmware/elcon_profile.hpp"
#include "firmware/j1939_profile.hpp"
#include "firmware/messages.hpp"
#include "firmware/pulse_currents.hpp"
#include "firmware/pulses_of.hpp"
#include "firmware/update_service.hpp"
#include "hal/samples.hpp"
#include "protection/protection.hpp"
namespace bms::firmware {

using BoardScalar = std::conditional_t<hal::fixed_point, arithmetic::FixedPoint, float>;
using BoardEstimator = estimator::SocEstimator<BoardScalar, generated::Model>;

/// Runs one estimator step. It is a separate function so that its cost can be counted.
BoardEstimator::Result estimator_step(BoardEstimator& estimator, const measurement::Sample& sample);

/// Cell file and firmware version of this image.
messages::Identity identity();
/// Capacity according to the cell file.
float capacity_ah();

template <hal::VehicleProfile>
struct ProfileOf {
  using Type = WithoutVehicleProfile;
};
template <>
struct ProfileOf<hal::VehicleProfile::cia418> {
  using Type = Cia418Profile;
};
template <>
struct ProfileOf<hal::VehicleProfile::j1939> {
  using Type = J1939Profile;
};
template <>
struct ProfileOf<hal::VehicleProfile::elcon> {
  using Type = ElconProfile;
};
using BoardVehicleProfile = ProfileOf<hal::vehicle_profile>::Type;

/// The application's Board (firmware/application.hpp).
struct BoardCell : ParametersOfBoard<hal::has_parameters>, UpdateOfBoard<BMS_IN_SLOT> {
  using Estimator = BoardEstimator;
  static constexpr std::size_t cells = hal::pack_cells;
  static constexpr bool may_stop = BMS_MAY_STOP;  ///< between samples, while the battery is parked (hal/sleep.hpp)
  static constexpr bool switches_off = BMS_SWITCHES_OFF;  ///< by itself and by a command (firmware/shelf.hpp)

  using Pulses = std::conditional_t<(cells > 1 && generated::pulses.stated()), PulsePublisher, NoPulses>;

  static Estimator::Result step(Estimator& estimator, const measurement::Sample& sample) {
    return estimator_step(estimator, sample);
  }
  static std::uint64_t estimated_us(const Estimator& estimator) { return estimator.time_us(); }
  static void update_condition(estimator::Condition<Estimator>& condition, const Estimator& estimator,
                               const measurement::Sample& sample, const Estimator::Result& estimate,
                               bool limits_wanted);
  static void update_cells(estimator::PackCells<BoardScalar, cells>& differences,
                           const measurement::PackSample<cells>& pack, const Estimator::Result& estimate);
  /// Of the whole battery [uV]; measurement::no_reading while it is not known. For images of a group only.
  static std::int32_t open_circuit_uv(const Estimator& estimator, const measurement::Sample& mean,
                                      const Estimator::Result& estimate);
  static PulseModel pulse_model(const Estimator& estimator, const Snapshot<Estimator, cells>& now);
  static const model::PlausibleRange& plausible();
  static const protection::ProtectionPlan& plan();
};

}  // namespace bms::firmware
