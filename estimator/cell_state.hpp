// The state of one cell: charge, covariance and the other states of the model. This is all that an estimator stores for
// each cell from sample to sample.
//
// Memory: 24 bytes in float for the 1RC model.
#pragma once

#include <array>
#include <cstddef>

#include "estimator/charge.hpp"
#include "estimator/ud_covariance.hpp"

namespace bms::estimator {

template <class S, template <class> class ModelOf>
struct CellState {
  using Model = ModelOf<S>;
  /// Correction of each state, in the order of the covariance: [V], SOC at Model::soc.
  using Correction = std::array<arithmetic::Voltage<S>, Model::states>;

  constexpr arithmetic::Variance<S> soc_variance() const { return covariance.template variance<Model::soc>(); }

  constexpr void apply(const Correction& correction, const model::ChargeScale<S>& scale) {
#pragma GCC unroll 8
    for (std::size_t i = 0; i < Model::states; ++i) {
      if (i != Model::soc) model_state[Model::value_index(i)] += correction[i];
    }
    charge.correct(correction[Model::soc], scale);
  }

  Charge<S> charge;
  UdCovariance<S, Model::states> covariance;
  typename Model::State model_state{};
};

}  // namespace bms::estimator
