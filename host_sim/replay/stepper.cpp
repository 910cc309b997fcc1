#include "replay/stepper.hpp"

#include "replay/replay_run.hpp"
#include "replay/simulation.hpp"

namespace bms::replay {

namespace {

using Extended = model::ExtendedCell<float, model::max_intervals, model::ChosenLaws<float>>;

template <class Estimator, class Cell>
class SteppedEstimator final : public Stepper {
 public:
  SteppedEstimator(const Cell& cell, const std::optional<measurement::StartingPoint>& start)
      : cell_(cell), estimator_(start ? Estimator(*start) : Estimator()) {}

  EstimateRow step(const measurement::Sample& sample) override {
    return replay_detail::row_of<float>(estimator_.step(cell_, sample));
  }

 private:
  Cell cell_;
  Estimator estimator_;
};

using Laws = model::ChosenLaws<float>;
/// Evaluated here: within the template below, g++ 14 has not yet instantiated the functions that it needs.
constexpr std::size_t most_voltages = Laws::most_voltage_states;

/// As replay_detail::run_extended().
template <bool Errors, std::size_t Voltages = replay_detail::usual_voltages>
std::unique_ptr<Stepper> extended(const Extended& cell, const std::optional<measurement::StartingPoint>& start) {
  if constexpr (Voltages < most_voltages) {
    if (cell.laws.voltage_states() > Voltages) return extended<Errors, most_voltages>(cell, start);
  }
  using Estimator = estimator::SocEstimator<float, model::ExtendedRc<Voltages, Laws::most_states, Errors>::template Of>;
  return std::make_unique<SteppedEstimator<Estimator, Extended>>(cell, start);
}

}  // namespace

std::unique_ptr<Stepper> make_stepper(const files::CellFile& file,
                                      const std::optional<measurement::StartingPoint>& start) {
  const auto cell = model::prepare<float, model::max_intervals>(file.parameters);
  const auto mechanisms = files::on_board(file.mechanisms);
  const bool errors = file.parameters.noise.errors_are_states;
  if (mechanisms.empty() && !errors)
    return std::make_unique<SteppedEstimator<estimator::SocEstimator<float>, HostCell<float>>>(cell, start);
  const Extended with_laws{cell, model::chosen<float>(mechanisms, file.parameters.capacity_ah)};
  return errors ? extended<true>(with_laws, start) : extended<false>(with_laws, start);
}

}  // namespace bms::replay
