#include <algorithm>

#include "identification/joint_structure.hpp"

namespace bms::identification {

namespace {

JointUnknown circuit_unknown(JointUnknown::Of of, double start, double least, double most) {
  constexpr double reach = 50;  // of the start, either way
  JointUnknown u;
  u.of = of;
  u.low = std::max(least, start / reach);
  u.high = std::min(most, start * reach);
  u.start = std::clamp(start, u.low, u.high);
  u.positive = true;
  return u;
}

/// Adds the mechanism with the defaults of the catalogue, if it is missing.
void need(JointModel& m, std::string_view id) {
  const std::size_t index = model::mechanism_index(id);
  for (const model::MechanismSetting& setting : m.mechanisms) {
    if (setting.index == index) return;
  }
  m.mechanisms.push_back(model::default_setting(index, m.cell));
  // in the order of the catalogue, as a cell file has them
  std::sort(m.mechanisms.begin(), m.mechanisms.end(), [](const auto& a, const auto& b) { return a.index < b.index; });
}

void add_circuit(JointModel& m, double r1_ohm, double c1_f) {
  constexpr auto ohm = model::accepted::resistance_ohm, farad = model::accepted::capacitance_f;
  m.unknowns.push_back(circuit_unknown(JointUnknown::Of::r0, mean_of(m.cell.rc.r0_ohm), ohm.low, ohm.high));
  m.unknowns.push_back(circuit_unknown(JointUnknown::Of::r1, r1_ohm, ohm.low, ohm.high));
  m.unknowns.push_back(circuit_unknown(JointUnknown::Of::c1, c1_f, farad.low, farad.high));
  for (const model::MechanismSetting& setting : m.mechanisms) {
    if (setting.index != model::mechanism_index_of<model::OcvHysteresis>) continue;
    JointUnknown decay = unknown_of("ocv_hysteresis", "decay", 20, m.cell.capacity_ah, true);
    decay.high = 200;  // narrower loops than half a percent of the capacity are not resolved
    m.unknowns.push_back(decay);
  }
}

/// Activation energies: of the reactions in R0 40 to 50 kJ/mol, at edges of current at eight temperatures and of two
/// laboratories' cells; of the pairs anything.
void add_temperature(JointModel& m) {
  constexpr double r0_j_per_mol = 45'000, r0_sigma_j_per_mol = 5'000;
  constexpr const char* id = "temperature_resistance";
  const double capacity_ah = m.cell.capacity_ah;
  need(m, id);
  JointUnknown r0 = unknown_of(id, "r0_activation_j_per_mol", r0_j_per_mol, capacity_ah, false);
  r0.prior = r0_j_per_mol;
  r0.prior_sigma = r0_sigma_j_per_mol;
  m.unknowns.push_back(r0);
  m.unknowns.push_back(unknown_of(id, "r0_share", 0.3, capacity_ah, false));
  m.unknowns.push_back(unknown_of(id, "r1_activation_j_per_mol", 25'000, capacity_ah, true));
}

void add_slow_pair(JointModel& m, double slow_ohm) {
  const double capacity_ah = m.cell.capacity_ah;
  need(m, "slow_polarisation");
  for (model::MechanismSetting& setting : m.mechanisms) {
    if (setting.index == model::mechanism_index_of<model::SlowPolarisation>) setting.value[2] = 0;  // a second RC pair
  }
  m.unknowns.push_back(unknown_of("slow_polarisation", "resistance_ohm", slow_ohm, capacity_ah, true));
  JointUnknown tau = unknown_of("slow_polarisation", "time_constant_s", 110, capacity_ah, true);
  tau.high = 2'000;  // what lasts longer is a position of the hysteresis or an error of the SOC axis
  m.unknowns.push_back(tau);
}

void add_own_energy(JointModel& m) {
  m.unknowns.push_back(unknown_of("temperature_resistance", "slow_ratio", 1.5, m.cell.capacity_ah, true));
}

void add_rise_towards_empty(JointModel& m) {
  for (const char* at : {"more_at_10", "more_at_25", "more_at_80"}) {
    JointUnknown more = unknown_of("temperature_resistance", at, 0, m.cell.capacity_ah, false);
    more.prior_sigma = 0.5;
    m.unknowns.push_back(more);
  }
}

}  // namespace

std::vector<JointCandidate> joint_candidates(const model::CellParameters<>& cell,
                                             const std::vector<model::MechanismSetting>& mechanisms,
                                             std::span<const JointRecording> recordings) {
  constexpr double fast_s = 10;  // of the faster of two pairs
  const bool temperatures = by_temperature(recordings).size() > 1;
  const double r1_ohm = mean_of(cell.rc.r1_ohm), half_ohm = r1_ohm / 2;
  JointModel one{cell, mechanisms, {}};
  add_circuit(one, r1_ohm, mean_of(cell.rc.c1_f));
  if (temperatures) add_temperature(one);
  JointModel two{cell, mechanisms, {}};
  add_circuit(two, half_ohm, fast_s / half_ohm);
  if (temperatures) add_temperature(two);
  add_slow_pair(two, half_ohm);
  std::vector<JointCandidate> all = {{"one RC pair", one, 1}, {"two RC pairs", two, 2}};
  if (!temperatures) return all;
  JointModel own = two, rising = two;
  add_own_energy(own);
  add_rise_towards_empty(rising);
  JointModel both = own;
  add_rise_towards_empty(both);
  all.push_back({"two RC pairs, each with its activation energy", own, 2});
  all.push_back({"two RC pairs, rising towards empty in the cold", rising, 2});
  all.push_back({"two RC pairs, each with its activation energy, rising towards empty in the cold", both, 2});
  return all;
}

}  // namespace bms::identification
