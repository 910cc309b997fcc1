// OCV over SOC from a test of pulses and rests in both directions (paper, section 2, Fig. 2-4): the voltage at the end
// of each rest, at the counted SOC. Then the three representations that the paper compares.
#pragma once

#include <string>
#include <vector>

#include "identification/data.hpp"
#include "model/cell_parameters.hpp"

namespace bms::identification {

struct RestedVoltage {
  double soc = 0, voltage_v = 0;
  bool after_charge = false;  ///< direction of the last pulse before the rest
};

/// Every rest of at least shortest_s, from the state of charge soc_from at the first sample. A rest before the first
/// pulse counts for both directions. Throws std::invalid_argument if the data contain fewer than three rests.
std::vector<RestedVoltage> rested_voltages(const Data& data, double soc_from, double shortest_s = 540);

enum class OcvDirection { discharge, charge, middle };

/// Rested voltages of one direction over SOC, rising; of both: the mean where both were measured.
struct OcvPoints {
  std::vector<double> soc, voltage_v;
  double at(double soc) const;  ///< linear in between, constant beyond
};
OcvPoints points_of(const std::vector<RestedVoltage>& rests, OcvDirection direction);

/// b0, b1 of `pieces` even pieces through the points (Table 1). Where a piece would fall, it rises by 1 uV.
model::OcvTable<double> even_pieces(const OcvPoints& points, std::size_t pieces = 10);

/// Coefficients of a polynomial over SOC by least squares, from the constant up.
std::vector<double> polynomial(const OcvPoints& points, std::size_t order = 7);
double polynomial_at(const std::vector<double>& coefficients, double soc);

}  // namespace bms::identification
