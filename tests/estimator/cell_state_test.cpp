#include "estimator/cell_state.hpp"

#include <gtest/gtest.h>

#include "model/extended_rc.hpp"
#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

TEST(CellState, ACorrectionMovesEachStateInItsPlace) {
  using State = CellState<double, model::ExtendedRc<1, 2, true>::Of>;
  using Model = State::Model;
  const auto scale = tests::prepared<double>().charge;
  State state;
  state.charge.set(0.5, scale);
  State::Correction correction{};
  for (std::size_t i = 0; i < Model::states; ++i) correction[i] = 0.01 * static_cast<double>(i + 1);
  state.apply(correction, scale);
  EXPECT_DOUBLE_EQ(state.model_state[0], correction[0]);
  EXPECT_DOUBLE_EQ(state.model_state[Model::voltage_error], correction[1]);
  EXPECT_DOUBLE_EQ(state.model_state[Model::current_offset], correction[Model::last]);
  EXPECT_DOUBLE_EQ(state.model_state[Model::first_mechanism_state], correction[Model::first_voltage]);
  EXPECT_EQ(state.model_state[Model::values - 1], 0) << "a state that the filter does not correct";
  EXPECT_NEAR(state.charge.soc(scale), 0.5 + correction[Model::soc], 1e-8);
}

TEST(CellState, ReportsTheVarianceOfTheSoc) {
  CellState<float, model::ExtendedRc<0, 0>::Of> state;
  state.covariance.set_diagonal({1e-4F, 4e-4F});
  EXPECT_EQ(state.soc_variance(), 4e-4F);
}

}  // namespace
}  // namespace bms::estimator
