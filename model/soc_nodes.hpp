// A value over SOC that is given at nodes: linear in between, constant outside.
#pragma once

#include <array>
#include <cstddef>

#include "arithmetic/scalar.hpp"

namespace bms::model {

using namespace arithmetic;  // the physics uses these number types and functions

/// Value: a quantity of scalar S, at N nodes that ascend by at least 0.1.
template <class S, class Value, std::size_t N>
class SocNodes {
 public:
  struct Point {
    Value value;
    Coupling<S> slope;  ///< per unit of SOC; 0 outside the nodes
  };

  constexpr SocNodes() = default;
  template <class Real>
  constexpr SocNodes(const std::array<double, N>& soc, const std::array<Real, N>& value) {
    for (std::size_t k = 0; k < N; ++k) {
      soc_[k] = Soc<S>(soc[k]);
      value_[k] = Value(value[k]);
      if (k == 0) continue;
      delta_[k - 1] = Value(value[k] - value[k - 1]);
      per_width_[k - 1] = Coupling<S>(1 / (soc[k] - soc[k - 1]));
    }
  }

  constexpr Point at(const Soc<S>& soc) const {
    if (soc < soc_[0]) return {value_[0], Coupling<S>(0)};
    for (std::size_t k = 0; k + 1 < N; ++k) {
      if (!(soc < soc_[k + 1])) continue;
      const Fraction<S> t = Soc<S>(soc - soc_[k]) * per_width_[k];
      return {Value(value_[k] + t * delta_[k]), Coupling<S>(delta_[k] * per_width_[k])};
    }
    return {value_[N - 1], Coupling<S>(0)};
  }

 private:
  std::array<Soc<S>, N> soc_{};
  std::array<Value, N> value_{};
  std::array<Value, N - 1> delta_{};
  std::array<Coupling<S>, N - 1> per_width_{};
};

}  // namespace bms::model
