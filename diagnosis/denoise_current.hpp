// The current without its sensor's noise, where it is constant.
//
// A model that is driven by the measured current puts the sensor's noise into its voltage, and the cell's voltage has
// it not: over hours of rest or constant current the residual is a faint copy of the noise, which a fit takes for a
// resistance that is too small or a current that is late. So: a reading is replaced by the mean of its neighbours that
// differ from it by no more than the noise, up to half a minute either way; a step ends the neighbourhood.
#pragma once

#include <span>
#include <vector>

namespace bms::diagnosis {

/// Standard deviation of a current channel's noise, from the calmest tenth of the record; quantisation included. NaN is
/// skipped.
double current_noise(std::span<const double> current_a);

std::vector<double> denoise_current(std::span<const double> current_a, double noise_a);

}  // namespace bms::diagnosis
