// Table 9 in one fit: R0, R1, C1 at ten states of charge and the OCV pieces, from one experiment at each of them.
#pragma once

#include <vector>

#include "study/fitter.hpp"

namespace bms::study {

struct Table9Row {
  double soc = 0;
  id::Parameter r0, r1, c1;
  double b0_v = 0, b1_v = 0, b0_std_v = 0, b1_std_v = 0;  ///< of the piece that ends at soc
};

struct Table9Fit {
  std::vector<Table9Row> rows;
  std::vector<double> corner_v;  ///< OCV at 0, 10 .. 100 %; the pieces meet there, so the OCV is continuous
  double rmse_v = 0;
  bool converged = false;
};

/// parts: one data set near each tenth of SOC, with known SOC. cell: its OCV is the start of the corners, its circuit
/// is not used.
Table9Fit fit_table9(const model::CellParameters<>& cell, const std::vector<StudyData>& parts);

}  // namespace bms::study
