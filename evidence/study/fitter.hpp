// Identifications of the study, counted for the progress.
#pragma once

#include <array>
#include <mutex>
#include <string>
#include <vector>

#include "identification/linear_models.hpp"
#include "model/cell_parameters.hpp"
#include "study/study.hpp"
#include "study/study_data.hpp"

namespace bms::study {

namespace id = identification;

/// The models of the paper, in the order of its tables.
inline constexpr std::size_t linear_models = 3, hammerstein_wiener_model = 2, grey_box_model = 3, models = 4;
inline constexpr std::array<const char*, models> model_names = {"transfer function", "output error",
                                                                "Hammerstein-Wiener", "nonlinear grey box"};

/// The optimisers of the paper, in the order of its tables.
inline constexpr std::array methods = {id::Method::subspace_gauss_newton, id::Method::adaptive_subspace_gauss_newton,
                                       id::Method::levenberg_marquardt, id::Method::steepest_descent,
                                       id::Method::trust_region_reflective};
inline constexpr std::size_t levenberg_marquardt = 2, steepest_descent = 3, trust_region = 4;
inline constexpr std::array<const char*, methods.size()> method_names = {
    "subspace Gauss-Newton", "adaptive subspace Gauss-Newton", "Levenberg-Marquardt", "steepest descent",
    "nonlinear least squares (trust region)"};

/// Where a search begins.
enum class Start {
  paper,   ///< R0, R1, C1 and b1 of section 3.2.4, for every model, and 20 iterations (the default of the toolbox)
  search,  ///< start values found in the data, and 200 iterations
};
inline constexpr int paper_iterations = 20;
/// Section 3.2.4, at 80 % of SOC.
inline constexpr id::CircuitParameters paper_start = {0.13, 0.0126, 0.0192, 8333.33};

/// Result of one model with one optimiser.
struct ModelFit {
  id::FitStatistics estimation, validation;
  std::vector<id::Parameter> parameters, polynomials;
  id::Optimum optimum;
  std::vector<std::string> warnings;
  bool usable = false;
  std::string why_not;           ///< reason if it is not usable
  id::HammersteinWiener blocks;  ///< of the linear models
};

/// Several threads may use one at once.
class Fitter {
 public:
  /// all: number of identifications that the study will make.
  Fitter(const model::CellParameters<>& cell, std::size_t all, const StudyProgress& progress)
      : cell_(cell), all_(all), progress_(progress) {}

  /// A model (place in model_names), identified from one data set and validated with another. Unevenly sampled data are
  /// resampled for the linear models.
  ModelFit fit(std::size_t model, const StudyData& estimation, id::Method method, const StudyData& validation,
               Start start = Start::paper);

  /// The grey box with one node of R0, R1, C1.
  id::Identification grey_box(const StudyData& part, id::Method method = id::Method::trust_region_reflective,
                              Start start = Start::search);

  /// The same from a circuit of one's own, with 20 iterations.
  id::Identification grey_box_from(const StudyData& part, id::Method method, const id::CircuitParameters& circuit);

  static id::FitStatistics validated(const id::Identification& found, const StudyData& part);

  /// Replaces the OCV that the models are given.
  void set_ocv(const model::OcvTable<double>& ocv) { cell_.ocv = ocv; }
  const model::CellParameters<>& cell() const { return cell_; }
  std::size_t done() const { return done_; }

 private:
  ModelFit linear(id::LinearKind kind, const StudyData& estimation, id::Method method, const StudyData& validation,
                  Start start);
  id::GreyBoxOptions options_for(const StudyData& part) const;
  id::CircuitParameters start_circuit() const;
  void step();

  model::CellParameters<> cell_;
  std::size_t all_, done_ = 0;
  std::mutex counting_;
  StudyProgress progress_;
};

/// One data set of the grey box.
id::DataSet data_set(const StudyData& part);

/// The value of a parameter, NaN without one of this name.
double value_of(const std::vector<id::Parameter>& parameters, const std::string& name);

}  // namespace bms::study
