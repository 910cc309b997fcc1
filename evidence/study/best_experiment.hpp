// The experiment that determines a cell's parameters in the shortest time, next to the paper's seven.
//
// Fisher information: the derivatives of the simulated voltage by R0, R1, C1, half gap and slow resistance, with white
// noise of 1 mV. Its inverse gives the standard deviations that an efficient estimator can reach. The search changes
// the currents and durations of a periodic profile within the limits of the cell; a validation then identifies the
// parameters from noisy data of the plant.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "study/study.hpp"
#include "study/study_data.hpp"

namespace bms::study {

/// The cell that is to be determined: Table 9 at 45 %, with the effects that the paper leaves out.
struct LocalCell {
  double r0_ohm = 0.01326, r1_ohm = 0.00864, c1_f = 1'324;
  LeftOut left_out = {.half_gap_v = 0.010, .decay = 40, .slow_ohm = 0.008, .slow_s = 600};
};

/// Voltage without OCV over a current sampled every second, and its derivatives by R0, R1, C1, half gap and slow
/// resistance, then by level and slope of the OCV. Exact for a current that is constant in each second.
struct LocalResponse {
  Eigen::VectorXd voltage_v;
  Eigen::MatrixXd by;
};
LocalResponse local_response(const LocalCell& cell, const std::vector<double>& current_a);

/// A period of current levels, repeated; the mean current is 0, so that the state of charge stays.
struct Period {
  std::vector<double> c_rate, duration_s;
};

/// Adds the table; nothing is drawn at random.
void add_best_experiment(StudyResult& result);

}  // namespace bms::study
