#include "replay/lanes.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "replay/lane_run.hpp"
#include "replay/processor_time.hpp"

namespace bms::replay {

namespace {

constexpr std::size_t registers = 2;       ///< of each number: the second hides the latency of the first
constexpr std::size_t block_rows = 1'024;  ///< samples and estimates in between stay in the cache

using Base = model::ExtendedRc<0, 0>;
using Estimator = estimator::SocEstimator<float>;
using Run = LaneRun<registers, Base::Of>;

/// The estimators of a group.
class Estimators final : public SingleSteps<Base::Of> {
 public:
  void add(const LaneInput& in) {
    cells_.push_back(std::make_unique<LaneCell>(model::prepare<float, model::max_intervals>(in.cell.parameters)));
    estimators_.push_back(in.start ? Estimator(*in.start) : Estimator());
  }
  std::vector<const LaneCell*> cells() const {
    std::vector<const LaneCell*> all;
    for (const auto& cell : cells_) all.push_back(cell.get());
    return all;
  }

  estimator::EstimateWords step(std::size_t lane, const measurement::Sample& sample,
                                const LaneValues<Base::Of>* changed, LaneValues<Base::Of>& present) override {
    if (changed != nullptr) estimator::LaneAccess::write(*changed, estimators_[lane]);
    const auto estimate = estimators_[lane].step(*cells_[lane], sample);
    present = estimator::LaneAccess::read(estimators_[lane]);
    return estimator::words(estimate);
  }
  void set_temperature(std::size_t lane, std::int16_t cdegc, LaneValues<Base::Of>& present) override {
    estimator::LaneAccess::set_temperature(estimators_[lane], *cells_[lane], cdegc, present);
  }

 private:
  std::vector<std::unique_ptr<LaneCell>> cells_;
  std::vector<Estimator> estimators_;
};

bool computes_in_lanes(const files::CellFile& cell) {
  return files::on_board(cell.mechanisms).empty() && !cell.parameters.noise.errors_are_states;
}

/// Runs one group of inputs, adds its steps to the result. Returns the seconds without the making of the samples.
double run_group(std::span<const LaneInput> inputs, std::span<const std::size_t> group, LaneTracks& result) {
  Estimators single;
  std::vector<std::vector<estimator::EstimateWords>> words;
  std::size_t rows = 0;
  for (const std::size_t k : group) {
    single.add(inputs[k]);
    words.emplace_back(inputs[k].samples.size());
    rows = std::max(rows, words.back().size());
    result.steps += words.back().size();
  }
  const auto run = std::make_unique<Run>(single.cells(), single);
  std::vector<std::vector<measurement::Sample>> space(group.size());
  std::vector<LaneBlock> blocks(group.size());
  double seconds = 0;
  for (std::size_t row = 0; row < rows; row += block_rows) {
    for (std::size_t lane = 0; lane < group.size(); ++lane) {
      const std::size_t from = std::min(row, words[lane].size());
      blocks[lane] = {inputs[group[lane]].samples.part(from, block_rows, space[lane]), words[lane].data() + from};
    }
    const double begin_s = processor_time_s();
    run->run(blocks);
    seconds += processor_time_s() - begin_s;
  }
  result.alone += run->single_steps();
  for (std::size_t lane = 0; lane < group.size(); ++lane) {
    Track& track = result.tracks[group[lane]];
    track.rows = Estimates(std::move(words[lane]), ScalarKind::float32);
    name_states(track, inputs[group[lane]].cell);
  }
  return seconds;
}

}  // namespace

std::size_t lane_count() { return Run::lanes; }

LaneTracks run_in_lanes(std::span<const LaneInput> inputs) {
  LaneTracks result;
  result.tracks.resize(inputs.size());
  std::vector<std::size_t> in_lanes;
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    const LaneInput& in = inputs[k];
    if (computes_in_lanes(in.cell))
      in_lanes.push_back(k);
    else
      result.tracks[k] = run_on_host(in.cell, in.samples, in.start, ScalarKind::float32, Timing::none);
  }
  double seconds = 0;
  for (std::span<const std::size_t> rest = in_lanes; !rest.empty();) {
    const auto group = rest.first(std::min(Run::lanes, rest.size()));
    seconds += run_group(inputs, group, result);
    rest = rest.subspan(group.size());
  }
  if (seconds > 0) result.steps_per_second = static_cast<double>(result.steps) / seconds;
  for (std::size_t k : in_lanes) result.tracks[k].steps_per_second = result.steps_per_second;
  return result;
}

}  // namespace bms::replay
