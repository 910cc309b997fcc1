// Reads cell constants of an update for an application, with the checks that its build makes of its own cell file.
//
// What protects does not travel: limits and capacity, from which the protection plan of the build follows and for which
// it is proved, must be those of the build, bit for bit. So a wrong or malicious update moves no threshold. It can make
// an estimate wrong, and with it the allowed currents, which follow the model below the continuous limits. Another
// cell, or other limits, needs another application.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>

#include "boot/refusal.hpp"
#include "cell_update/format.hpp"
#include "model/cell.hpp"
#include "model/extended.hpp"
#include "model/extended_rc.hpp"

namespace bms::cell_update {

namespace contents_detail {

/// The mechanism of a law.
template <class S, class Law, class Mechanisms>
struct MechanismOf;
template <class S, class Law, class First, class... Others>
struct MechanismOf<S, Law, std::tuple<First, Others...>> : MechanismOf<S, Law, std::tuple<Others...>> {};
template <class S, class Law, class First, class... Others>
requires std::same_as<typename First::template Law<S>, Law>
struct MechanismOf<S, Law, std::tuple<First, Others...>> {
  using type = First;
};

template <class S, class Law>
using Mechanism = typename MechanismOf<S, Law, model::Catalogue>::type;

constexpr bool same(const model::Limits& a, const model::Limits& b) {
  static_assert(sizeof(model::Limits) == 6 * sizeof(double), "compare every limit");
  return a.voltage_min_v == b.voltage_min_v && a.voltage_max_v == b.voltage_max_v &&
         a.charge_current_max_a == b.charge_current_max_a && a.discharge_current_max_a == b.discharge_current_max_a &&
         a.temperature_min_c == b.temperature_min_c && a.temperature_max_c == b.temperature_max_c;
}

}  // namespace contents_detail

/// What an update cannot change about the application's build.
struct OfBuild {
  model::Limits limits;
  double capacity_ah = 0;
  bool errors_are_states = false;
};
constexpr OfBuild of_build(const model::CellParameters<double>& p) {
  return {p.limits, p.capacity_ah, p.noise.errors_are_states};
}

/// Values of the mechanisms of a model that is known to the compiler.
template <class S, class Laws>
class MechanismValues;
template <class S, class... Law>
class MechanismValues<S, model::LawSet<S, Law...>> {
 public:
  using Laws = model::LawSet<S, Law...>;
  static constexpr std::size_t mechanisms = sizeof...(Law);

  boot::Refusal read(Reader& reader, double capacity_ah) {
    boot::Refusal refusal = boot::Refusal::none;
    each([&]<class M>(std::type_identity<M>, auto& values) {
      if (refusal == boot::Refusal::none) refusal = read_one<M>(reader, values, capacity_ah);
    });
    return refusal;
  }
  Laws laws(double capacity_ah) const {
    if constexpr (mechanisms == 0)
      return {};
    else
      return [&]<std::size_t... K>(std::index_sequence<K...>) {
        return Laws(Law(std::get<K>(values_), capacity_ah)...);
      }
    (std::index_sequence_for<Law...>{});
  }

 private:
  template <class M, std::size_t N>
  static boot::Refusal read_one(Reader& reader, std::array<double, N>& values, double capacity_ah) {
    if (reader.take<std::uint32_t>() != id_hash(M::id) || reader.take<std::uint8_t>() != N)
      return boot::Refusal::other_model;
    bool possible = true;
    for (std::size_t k = 0; k < N; ++k) {
      const double v = values[k] = reader.number();
      // a comparison with NaN is false
      possible = possible && v >= M::parameters[k].lower(capacity_ah) && v <= M::parameters[k].upper(capacity_ah);
    }
    return possible ? boot::Refusal::none : boot::Refusal::cell_out_of_range;
  }
  template <class F>
  void each(F&& f) {
    [&]<std::size_t... K>(std::index_sequence<K...>) {
      (f(std::type_identity<contents_detail::Mechanism<S, Law>>{}, std::get<K>(values_)), ...);
    }
    (std::index_sequence_for<Law...>{});
  }

  std::tuple<std::array<double, contents_detail::Mechanism<S, Law>::parameters.size()>...> values_{};
};

/// S, Laws: scalar and laws of the application's model. Most: intervals that its tables have room for. 6 KB.
template <class S, std::size_t Most, class Laws>
class Contents {
  static_assert(!std::same_as<S, model::FixedPoint>,
                "fixed point holds fewer cells than a cell file may describe (model::fits_fixed_point)");

 public:
  using Values = MechanismValues<S, Laws>;
  using Tables = std::conditional_t<Values::mechanisms == 0, model::Cell<S, Most>, model::ExtendedCell<S, Most, Laws>>;

  /// The first reason in the order format, limits, model, range.
  boot::Refusal read(std::span<const std::uint8_t> bytes, const OfBuild& built) {
    using boot::Refusal;
    if (bytes.size() < fields_at || hal::get_bytes<std::uint32_t>(bytes, 0) != magic ||
        hal::get_bytes<std::uint16_t>(bytes, 4) != format)
      return Refusal::unknown_cell_format;
    Reader reader(bytes.subspan(fields_at));
    parameters_ = {};
    model::visit_cell(reader, parameters_);
    if (!reader.good()) return Refusal::unknown_cell_format;
    if (!contents_detail::same(parameters_.limits, built.limits) || parameters_.capacity_ah != built.capacity_ah)
      return Refusal::other_limits;
    if (parameters_.noise.errors_are_states != built.errors_are_states || bytes[6] != Values::mechanisms)
      return Refusal::other_model;
    if (model::first_fault(parameters_).what != nullptr) return Refusal::cell_out_of_range;
    if (model::interval_count(parameters_) > Most) return Refusal::other_model;
    if (const Refusal r = values_.read(reader, parameters_.capacity_ah); r != Refusal::none) return r;
    return reader.good() && reader.at_end() ? Refusal::none : Refusal::unknown_cell_format;
  }

  /// What read() has accepted. The same operations as in a build, so the same bits.
  Tables tables() const {
    if constexpr (Values::mechanisms == 0)
      return model::prepare<S, Most>(parameters_);
    else
      return {{model::prepare<S, Most>(parameters_)}, values_.laws(parameters_.capacity_ah)};
  }

 private:
  model::CellParameters<double> parameters_;
  Values values_;
};

}  // namespace bms::cell_update
