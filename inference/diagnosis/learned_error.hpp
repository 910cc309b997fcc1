// How wrong a model was on healthy recordings that it had not seen, by state of charge.
//
// A cell file's tolerance is one number for all states of charge. Where its OCV comes from a discharge under load, that
// number is the error of the resistance whose drop was added: 20 to 40 mV, while the voltage of another discharge at
// the same current is predicted within 2 mV in the middle, and within 80 mV near empty. Where healthy recordings were,
// their error takes the place of the tolerance.
#pragma once

#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "healthy_data/healthy_data.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

class LearnedError {
 public:
  /// Not known: the cell file's tolerance holds.
  LearnedError() = default;
  /// Not known either if the records go to states of charge, currents or temperatures where no healthy recording was,
  /// or if the cell file promises more than healthy recordings keep.
  LearnedError(const std::vector<healthy_data::HealthyRegime>& regimes, const model::CellParameters<>& cell,
               const std::vector<PreparedRecording>& records);

  bool known() const { return !points_.empty(); }
  /// Not known only because the records go elsewhere.
  bool is_elsewhere() const { return elsewhere_; }
  /// Standard deviation [V].
  double at(double soc) const;
  /// Its square less that of the least one, which the tolerance contains [V^2].
  double more_at(double soc) const;
  /// The cell with the least error as its tolerance of the OCV, and with resistances that are
  /// wrong by the error at their state of charge.
  model::CellParameters<> applied(model::CellParameters<> cell) const;

 private:
  struct Point {
    double soc, error_v;
  };
  std::vector<Point> points_;  ///< by soc
  bool elsewhere_ = false;
  double least_v_ = 0, usual_v_ = 0, largest_a_ = 0;
};

}  // namespace bms::diagnosis
