// How the simulation of one recording is set up: the laws that act, and what acts before the first row or on the
// readings themselves. Each mechanism adds its part (Knowledge::set_up).
#pragma once

#include <cstddef>
#include <span>

#include "diagnosis/prepared_recording.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

/// S: double or a dual number.
template <class S>
struct SimulationSetup {
  const PreparedRecording& recording;
  std::size_t record = 0;  ///< place among the recordings, which are in order of time
  double capacity_ah = 1;
  std::span<const model::Span> bursts;  ///< of a loose contact, in this recording
  bool own = false;                     ///< the setting that is set up is the cell file's own, not a finding
  double start_soc = 0;                 ///< as given, with the shift of the cell file's own mechanisms
  S initial_soc;
  S branch_shift;          ///< of the branch position at the start of this recording
  S capacity_loss;         ///< share of the cell file's capacity that is gone
  S gain_error;            ///< of the current sensor
  S current_delay_s{0};    ///< by which the current is read behind the voltage
  S temperature_lag_s{0};  ///< time constant of the temperature sensor
  model::ChosenLaws<S> laws{};

  template <class M>
  void choose(const model::MechanismValues<S>& value) {
    model::choose<S>(laws, model::mechanism_index_of<M>, value, capacity_ah);
  }
  template <class M>
  auto& law() {
    return *laws.template slot<model::mechanism_index_of<M>>();
  }
};

}  // namespace bms::diagnosis
