// The published figures of the grey box (Tables 5 to 8 and Appendix A), and the same figures of a simulated cell that
// goes through the paper's procedure.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "study/paper_procedure.hpp"

namespace bms::study {

/// Groups of figures. Within one, the figures depend on each other: those of a table share experiments.
enum class FigureGroup { table7, table8, table6, table5, appendix_a };
inline constexpr std::array<const char*, 5> figure_group_names = {"7", "8", "6", "5", "A"};
/// How many independent figures each group counts as: rows and columns of Table 7, parameters and output of Table 8 for
/// each experiment, and each figure of the others.
inline constexpr std::array<double, 5> independent_figures = {14, 14, 3, 2, 3};

/// RMS difference that is expected between two such experiments, of the logarithms, by group.
inline constexpr std::array<double, 5> expected_difference = {0.3, 0.6, 0.5, 0.3, 0.5};

struct Figure {
  FigureGroup group;
  std::string name;
  double value = 0;
  bool is_fit = false;  ///< percent; compared as the logarithm of 100 - fit, the relative error
  /// Compared only up to a factor that all figures of this number share: number and rate of samples are not published.
  int scale = 0;  ///< 0: compared as it is
};

/// In the same order as figures_of().
std::vector<Figure> published_figures();

/// Currents of the six pulse designs, which the paper does not publish. The sizes of the voltage in Tables 7 and 8
/// (paper_consistency.hpp) are those of a current with two levels, which is the same step in all six.
struct PulseDesigns {
  double pulse_s = 20;  ///< of the designs with rests
  double pulse_c_rate = 0.7;
  double high_c_rate = 0.7;  ///< discharge
  double swing = 1.2;        ///< LOW is HIGH (1 - swing): above 1 it charges
  double duration_s = 1'200;
};

/// A bench and the OCV that the models are given.
struct PaperCandidate {
  PulseDesigns pulses;
  Bench bench;
  /// The models of Tables 7 and 8 know the OCV over the whole range; otherwise only b0 and b1 of 40 %, as a line.
  bool whole_ocv = false;
  bool other_ocv = false;  ///< the models use Table 1 although the cell has Table 9
  /// Tables 7 and 8 use this part of the OCV test on either side of 40 %. The paper does not state it.
  double ocv_half_window = 0.1;
  std::uint64_t seed = 1;  ///< of the noise
};
std::vector<Figure> figures_of(const model::CellParameters<>& cell, const PaperCandidate& candidate, PaperRuns& runs);

/// Differences as the fit sees them: logarithm of simulated over published, limited to +-2. Figures that share a factor
/// are shifted to mean 0 first.
std::vector<double> differences(const std::vector<Figure>& simulated, const std::vector<Figure>& published);

}  // namespace bms::study
