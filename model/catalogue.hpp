// All mechanisms, each once. To add one: its file in model/mechanisms/ and its line here (model/README.md).
// Laws act in this order: sensors, then charge, then states, then tables, then the voltage reading.
#pragma once

#include <tuple>
#include <type_traits>
#include <utility>

#include "model/mechanisms/branch_temperature.hpp"
#include "model/mechanisms/capacity_change.hpp"
#include "model/mechanisms/channel_skew.hpp"
#include "model/mechanisms/charge_transfer.hpp"
#include "model/mechanisms/contact_intermittent.hpp"
#include "model/mechanisms/contact_step.hpp"
#include "model/mechanisms/coulombic_loss.hpp"
#include "model/mechanisms/current_clipping.hpp"
#include "model/mechanisms/current_gain.hpp"
#include "model/mechanisms/current_offset.hpp"
#include "model/mechanisms/direction_asymmetry.hpp"
#include "model/mechanisms/entropic_ocv.hpp"
#include "model/mechanisms/fast_polarisation.hpp"
#include "model/mechanisms/initial_soc.hpp"
#include "model/mechanisms/leakage.hpp"
#include "model/mechanisms/load_memory.hpp"
#include "model/mechanisms/ocv_hysteresis.hpp"
#include "model/mechanisms/ocv_shape.hpp"
#include "model/mechanisms/polarisation_growth.hpp"
#include "model/mechanisms/resistance_growth.hpp"
#include "model/mechanisms/self_heating.hpp"
#include "model/mechanisms/slow_polarisation.hpp"
#include "model/mechanisms/temperature_resistance.hpp"
#include "model/mechanisms/temperature_sensor.hpp"
#include "model/mechanisms/voltage_gain.hpp"
#include "model/mechanisms/voltage_offset.hpp"

namespace bms::model {

using Catalogue =
    std::tuple<ChannelSkew, CurrentOffset, CurrentGain, CurrentClipping, TemperatureSensor,       // readings
               InitialSoc, CapacityChange, CoulombicLoss, Leakage,                                // charge
               SlowPolarisation, FastPolarisation, LoadMemory, BranchTemperature, OcvHysteresis,  // states
               SelfHeating,                                                                       // a state
               ResistanceGrowth, PolarisationGrowth, DirectionAsymmetry, TemperatureResistance, ChargeTransfer,
               ContactStep, ContactIntermittent, OcvShape, EntropicOcv,  // tables
               VoltageOffset, VoltageGain>;                              // the reading of the voltage

inline constexpr std::size_t mechanism_count = std::tuple_size_v<Catalogue>;

/// Properties of a mechanism that do not need its type.
struct MechanismInfo {
  std::string_view id;
  Domain domain = Domain::physics;
  bool on_board = false, needs_fpu = false;
  std::array<Parameter, max_mechanism_parameters> parameter{};
  std::size_t parameters = 0;
  std::size_t states = 0;
  StateUnit state_unit{"v", 1};
  /// Returns false if fixed point rounds these values too much (capacity in Ah).
  bool (*fits_fixed_point)(const std::array<double, max_mechanism_parameters>& values, double capacity_ah) = nullptr;
};

namespace mechanism_detail {

template <class M>
constexpr bool fits_fixed_point(const std::array<double, max_mechanism_parameters>& values, double capacity_ah) {
  if constexpr (requires { M::fits_fixed_point(values, capacity_ah); })
    return M::fits_fixed_point(values, capacity_ah);
  else
    return true;
}

template <class M>
constexpr MechanismInfo info() {
  MechanismInfo i{M::id, M::domain, M::on_board, false, {}, M::parameters.size(), 0, {"v", 1}};
  for (std::size_t k = 0; k < M::parameters.size(); ++k) i.parameter[k] = M::parameters[k];
  i.fits_fixed_point = fits_fixed_point<M>;
  if constexpr (requires { M::needs_fpu; }) i.needs_fpu = M::needs_fpu;
  if constexpr (requires { M::template Law<double>::states; }) i.states = M::template Law<double>::states;
  if constexpr (requires { M::template Law<double>::state_unit; }) i.state_unit = M::template Law<double>::state_unit;
  return i;
}

template <class... M>
constexpr std::array<MechanismInfo, sizeof...(M)> infos(std::tuple<M...>*) {
  return {info<M>()...};
}

/// Place of a type in a tuple; its size if the type is not in it.
template <class M, class Tuple>
inline constexpr std::size_t place_in = 0;
template <class M, class... Others>
inline constexpr std::size_t place_in<M, std::tuple<M, Others...>> = 0;
template <class M, class First, class... Others>
inline constexpr std::size_t place_in<M, std::tuple<First, Others...>> = 1 + place_in<M, std::tuple<Others...>>;

}  // namespace mechanism_detail

inline constexpr std::array<MechanismInfo, mechanism_count> catalogue =
    mechanism_detail::infos(static_cast<Catalogue*>(nullptr));

/// Index in the catalogue; mechanism_count if the id is unknown.
constexpr std::size_t mechanism_index(std::string_view id) {
  std::size_t k = 0;
  while (k < mechanism_count && catalogue[k].id != id) ++k;
  return k;
}

/// The same for its type. By the types alone: g++ 14 does not compare texts while it instantiates templates at the end
/// of a source.
template <class M>
inline constexpr std::size_t mechanism_index_of = mechanism_detail::place_in<M, Catalogue>;

/// Calls f(std::type_identity<M>{}) for the mechanism M with this index; does nothing for an index beyond the
/// catalogue.
template <class F>
constexpr void visit_mechanism(std::size_t index, F&& f) {
  [&]<std::size_t... K>(std::index_sequence<K...>) {
    const auto visit = [&]<std::size_t k>() {
      if (index == k) f(std::type_identity<std::tuple_element_t<k, Catalogue>>{});
    };
    (visit.template operator()<K>(), ...);
  }
  (std::make_index_sequence<mechanism_count>{});
}

}  // namespace bms::model
