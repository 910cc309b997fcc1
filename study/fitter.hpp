// Identifications of the study, counted for the progress.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "identification/linear_models.hpp"
#include "model/cell_parameters.hpp"
#include "study/study.hpp"
#include "study/study_data.hpp"

namespace bms::study {

namespace id = identification;

/// The models of the paper, in the order of its tables.
inline constexpr std::size_t linear_models = 3, grey_box_model = 3, models = 4;
inline constexpr std::array<const char*, models> model_names = {"transfer function", "output error",
                                                                "Hammerstein-Wiener", "nonlinear grey box"};

/// The optimisers of the paper, in the order of its tables.
inline constexpr std::array methods = {id::Method::subspace_gauss_newton, id::Method::adaptive_subspace_gauss_newton,
                                       id::Method::levenberg_marquardt, id::Method::steepest_descent,
                                       id::Method::trust_region_reflective};
inline constexpr std::array<const char*, methods.size()> method_names = {
    "subspace Gauss-Newton", "adaptive subspace Gauss-Newton", "Levenberg-Marquardt", "steepest descent",
    "nonlinear least squares (trust region)"};

/// Result of one model with one optimiser.
struct ModelFit {
  id::FitStatistics estimation, validation;
  std::vector<id::Parameter> parameters;
  id::Optimum optimum;
  std::vector<std::string> warnings;
  bool usable = false;
};

class Fitter {
 public:
  /// all: number of identifications that the study will make.
  Fitter(const model::CellParameters<>& cell, std::size_t all, const StudyProgress& progress)
      : cell_(cell), all_(all), progress_(progress) {}

  /// A model (place in model_names), identified from one data set and validated with another.
  ModelFit fit(std::size_t model, const StudyData& estimation, id::Method method, const StudyData& validation);

  /// The grey box with one node of R0, R1, C1.
  id::Identification grey_box(const StudyData& part, id::Method method = id::Method::trust_region_reflective);

  static id::FitStatistics validated(const id::Identification& found, const StudyData& part);

  std::size_t done() const { return done_; }

 private:
  ModelFit linear(id::LinearKind kind, const StudyData& estimation, id::Method method, const StudyData& validation);
  void step();

  model::CellParameters<> cell_;
  std::size_t all_, done_ = 0;
  StudyProgress progress_;
};

}  // namespace bms::study
