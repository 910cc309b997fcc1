// The published figures of the grey box (Tables 5 to 8 and Appendix A), and the same figures of a simulated cell that
// goes through the paper's procedure.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "study/observations.hpp"

namespace bms::study {

/// Groups of figures. Within one, the figures depend on each other: those of a table share experiments.
enum class FigureGroup { table7, table8, table6, table5, appendix_a };
inline constexpr std::array<const char*, 5> figure_group_names = {"7", "8", "6", "5", "A"};
/// How many independent figures each group counts as: rows and columns of Table 7, parameters and output of Table 8 for
/// each experiment, and each figure of the others.
inline constexpr std::array<double, 5> independent_figures = {14, 14, 3, 2, 3};

struct Figure {
  FigureGroup group;
  std::string name;
  double value = 0;
  bool is_fit = false;  ///< percent; compared as the logarithm of 100 - fit, the relative error
  bool scaled = false;  ///< compared only up to a common factor
};

/// In the same order as figures_of().
std::vector<Figure> published_figures();

/// A bench and the OCV that the models are given.
struct PaperCandidate {
  Bench bench;
  bool other_ocv = false;  ///< the models use Table 1 although the cell has Table 9
};
std::vector<Figure> figures_of(const model::CellParameters<>& cell, const PaperCandidate& candidate);

/// Differences as the fit sees them: logarithm of simulated over published, limited to +-2. Figures that are compared
/// up to a factor are shifted to mean 0 first.
std::vector<double> differences(const std::vector<Figure>& simulated, const std::vector<Figure>& published);

}  // namespace bms::study
