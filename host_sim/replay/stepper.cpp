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

}  // namespace

std::unique_ptr<Stepper> make_stepper(const files::CellFile& file,
                                      const std::optional<measurement::StartingPoint>& start) {
  const auto cell = model::prepare<float, model::max_intervals>(file.parameters);
  const auto mechanisms = files::on_board(file.mechanisms);
  const bool errors = file.parameters.noise.errors_are_states;
  if (mechanisms.empty() && !errors)
    return std::make_unique<SteppedEstimator<estimator::SocEstimator<float>, HostCell<float>>>(cell, start);
  const Extended with_laws{cell, model::chosen<float>(mechanisms, file.parameters.capacity_ah)};
  return replay_detail::with_estimator_for<float>(
      with_laws.laws, errors, [&]<class E>(std::type_identity<E>) -> std::unique_ptr<Stepper> {
        return std::make_unique<SteppedEstimator<E, Extended>>(with_laws, start);
      });
}

}  // namespace bms::replay
