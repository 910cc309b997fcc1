// Hammerstein-Wiener model (paper, 3.2.3): a static curve on the current, the output error model, a static curve on its
// output.
//
//   u = f(i) = i + direction s(i) + growth i s(i) / 1C      s(i) = sqrt(i^2 + (1C / 20)^2) - 1C / 20, a smooth |i|
//   w = B/F u + offset                                      the output error model (discrete_model.hpp)
//   y = g(w)                                                ten straight pieces with rounded corners
//
// g starts as the shape of the OCV over the state of charge that the data cover (section 2), stretched over the range
// of w. Its eleven corners are unknown: gain and offset of the linear block decide where they lie along w. Corners that
// the data do not reach stay where they are, by weak priors. The corners are rounded so that every optimiser has
// derivatives.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "identification/discrete_model.hpp"
#include "model/cell.hpp"

namespace bms::identification {

/// The curve on the current. All zero: f(i) = i.
struct InputCurve {
  double direction = 0;  ///< relative difference of charge and discharge, halved
  double growth = 0;     ///< relative change of the gain at 1C
  double one_c_a = 1;

  double size(double current_a) const;  ///< s(i)
  std::vector<double> through(std::span<const double> current_a) const;
};

/// The curve on the output: y at even steps of w, straight beyond its ends. Empty: y = w.
struct OutputCurve {
  double w_from_v = 0, w_step_v = 0;
  std::vector<double> y_v;

  double through(double w_v) const;
  double slope(double w_v) const;
};

struct HammersteinWiener {
  Structure structure;
  DiscreteModel linear;
  InputCurve input;
  OutputCurve output;
};

Eigen::VectorXd simulate(const HammersteinWiener& model, std::span<const double> current_a);

/// Unknowns: those of the linear block, direction, growth, corners of the output curve.
Eigen::VectorXd to_unknowns(const HammersteinWiener& model);
HammersteinWiener with_unknowns(HammersteinWiener model, const Eigen::VectorXd& unknowns);
/// How many unknowns come before the corners. The residuals are linear in the corners.
Eigen::Index unknowns_before_corners(const HammersteinWiener& model);

/// How many pieces the curve on the output reaches beyond the range of w over the data. It decides where its corners
/// lie, and from there a search does not move them by a piece.
struct BeyondData {
  double below = 0, above = 0;
};

/// A model around an identified linear block: f(i) = i, g with the shape of the OCV around `soc`, the middle of the
/// data. Its corners enclose the range of w over the data.
HammersteinWiener begin_hammerstein_wiener(const DiscreteModel& linear, const Structure& structure,
                                           const model::OcvTable<double>& ocv, const Data& data, double soc,
                                           const BeyondData& beyond = {});

/// Simulation error of every `every`-th sample, then the priors. Throws as simulation_error().
LeastSquares simulation_error(const Data& data, const HammersteinWiener& start, std::size_t every = 1);

/// Models from data with resampled residuals: the spread of what they simulate is the uncertainty of the model.
/// Residuals are drawn in blocks as long as their correlation, and enlarged by the freedom that the fit takes. The same
/// seed gives the same models.
std::vector<HammersteinWiener> resampled(const HammersteinWiener& model, const Data& data, std::size_t count,
                                         std::uint64_t seed);

/// The simulation of a model and, sample by sample, limits that contain 95 %, from the spread of the resampled models.
struct Band {
  Eigen::VectorXd low_v, high_v;
};
Band band_of(const HammersteinWiener& model, const std::vector<HammersteinWiener>& resampled,
             std::span<const double> current_a);

/// Measured minus simulated, without missing samples.
Eigen::VectorXd residuals_of(const HammersteinWiener& model, const Data& data);

/// The band over the data that the model was identified from. Empty where its residuals are not white noise: then the
/// model lacks something, which no spread of resampled residuals contains, and the band would be too narrow.
std::optional<Band> confidence_band(const HammersteinWiener& model, const Data& data, std::size_t count,
                                    std::uint64_t seed);

}  // namespace bms::identification
