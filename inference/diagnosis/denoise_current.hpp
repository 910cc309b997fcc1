// The current without the noise of its sensor, where it is constant.
//
// A model that is driven by the measured current puts the sensor's noise into its voltage; the cell's voltage does not
// contain it. Over hours of rest or constant current the residual is then a faint copy of the noise, which a fit takes
// for a resistance that is too small or a current that is late. So a reading is replaced by the mean of its neighbours
// that differ from it by no more than the noise, up to half a minute either way. A step ends the neighbourhood.
#pragma once

#include <span>
#include <vector>

namespace bms::diagnosis {

/// Standard deviation of a current channel's noise [A], from the calmest fifth of the record, quantisation included.
/// NaN is skipped. 0 if the record is too short.
double current_noise(std::span<const double> current_a);

/// The current, as long as current_a. noise_a: standard deviation; 0 returns the current as it is.
std::vector<double> denoise_current(std::span<const double> current_a, double noise_a);

}  // namespace bms::diagnosis
