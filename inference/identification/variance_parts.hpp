// Separates errors into a constant part and a part that grows with a known quantity.
#pragma once

#include <span>
#include <vector>

namespace bms::identification {

/// RMS error = sqrt(constant^2 + (per * by)^2).
struct VarianceParts {
  double constant = 0, per = 0;  ///< >= 0
};

/// Maximum likelihood of both parts, for normal errors: each entry of rms is the error of one set, and that of by the
/// size of what its second part is proportional to. Every set counts once, and relative to its expected size: the
/// largest errors do not decide alone. With fewer than two sets, or if by does not differ, all is constant.
VarianceParts variance_parts(std::span<const double> rms, std::span<const double> by);

/// Of a recording beyond an edge of the range.
struct GrowthAt {
  double temperature_c = 0, per_ev = 0;
};

/// RMS of the recordings beyond each edge, the colder one first: recordings of one temperature share the error of the
/// law. One value if all lie beyond the same edge: within 5 K.
std::vector<double> by_edge(std::span<const GrowthAt> outside);

/// ModelErrors::resistance_per_ev from the RMS beyond each of the two edges of the range [eV]; 0 without any.
/// Two edges say little about a scale. Before them the square of the scale is model::default_resistance_per_ev squared
/// with the weight of two edges (scaled inverse chi square, two degrees of freedom); its mean after them is the sum of
/// the default's square and theirs.
double growth_outside(std::span<const double> per_ev);

}  // namespace bms::identification
