// Every mechanism of the catalogue at values that a cell of 6 Ah might have.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "model/extended.hpp"

namespace bms::model {

struct UsualMechanism {
  std::string_view id;
  MechanismValues<> value;
};

inline const std::vector<UsualMechanism>& usual_mechanisms() {
  static const std::vector<UsualMechanism> all = {
      {"channel_skew", {1.5}},
      {"current_offset", {0.03}},
      {"current_gain", {0.02}},
      {"current_clipping", {2, 7, 0.1}},
      {"temperature_sensor", {3, 200}},
      {"initial_soc", {0.05}},
      {"capacity_change", {0.1}},
      {"coulombic_loss", {0.004}},
      {"leakage", {0.002}},
      {"slow_polarisation", {0.004, 600, 0.2, 150}},
      {"fast_polarisation", {0.002, 1.5}},
      {"load_memory", {0.003, -0.002, 900}},
      {"branch_temperature", {0.9, 0.3, 0.25, 0.4, 0.006, 0.002, 0, -0.002, 60'000, 35'000, 28'000, 30'000, 23}},
      {"ocv_hysteresis", {0.008, 40, 0.2, -0.5}},
      {"self_heating", {8, 900, 25'000, 26}},
      {"resistance_growth", {0.3}},
      {"polarisation_growth", {0.2, -0.3}},
      {"direction_asymmetry", {0.2}},
      {"temperature_resistance", {40'000, 35'000, 23, 0.4, 0.5, 0.1, -0.1, 0.6}},
      {"charge_transfer", {0.4, 0.6, 2, 0.4}},
      {"contact_step", {0.003, 60}},
      {"contact_intermittent", {0.01, 0.1}},
      {"ocv_shape", {0.03, -0.02}},
      {"entropic_ocv", {1e-4, -2e-4, 1e-4, 2e-4, 24}},
      {"voltage_offset", {0.004}},
      {"voltage_gain", {0.002}},
  };
  return all;
}

inline MechanismSetting usual(std::string_view id) {
  for (const UsualMechanism& m : usual_mechanisms()) {
    if (m.id == id) return {mechanism_index(id), m.value, {}};
  }
  throw std::invalid_argument(std::string(id));
}

/// Those with these ids, in the catalogue's order.
inline std::vector<MechanismSetting> usual(const std::vector<std::string_view>& ids) {
  std::vector<MechanismSetting> settings(mechanism_count), chosen;
  for (const std::string_view id : ids) settings[mechanism_index(id)] = usual(id);
  for (const MechanismSetting& m : settings) {
    if (m.value != MechanismValues<>{}) chosen.push_back(m);
  }
  return chosen;
}

}  // namespace bms::model
