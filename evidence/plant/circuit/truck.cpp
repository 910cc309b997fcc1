#include "plant/circuit/truck.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace bms::plant {

namespace {

constexpr double broken_ohm = 1e10;
constexpr double peak_time_s = 5e-3;
constexpr double ramp_v = 1;  ///< the drive and the DC/DC converter reach their power over this voltage

/// 0 below `from_v`, 1 from a volt above it.
double share_above(double v, double from_v) { return std::clamp((v - from_v) / ramp_v, 0.0, 1.0); }

double depth_v(const std::vector<SupplyDip>& dips, double time_s) {
  double sum_v = 0;
  for (const SupplyDip& dip : dips) {
    if (time_s >= dip.start_s - 1e-9 && time_s < dip.start_s + dip.duration_s - 1e-9) sum_v += dip.depth_v;
  }
  return sum_v;
}

double next_edge_s(const std::vector<SupplyDip>& dips, double time_s) {
  double next_s = std::numeric_limits<double>::infinity();
  for (const SupplyDip& dip : dips) {
    for (const double edge_s : {dip.start_s, dip.start_s + dip.duration_s}) {
      if (edge_s > time_s + 1e-9) next_s = std::min(next_s, edge_s - time_s);
    }
  }
  return next_s;
}

/// Two and a half volts at no current, 2.5 mV/A, divided from 5 V to 3.3 V; its output stays within its supply.
double hall_pin_v(const HallParameters& hall, double current_a) {
  constexpr double v_per_a = 2.5e-3, nominal_v = 5, divided = 3.3 / 5;
  const double ratio = hall.supply_v / nominal_v;
  const double output_v = ratio * (nominal_v / 2 + hall.gain * v_per_a * current_a) + hall.offset_v;
  return divided * std::clamp(output_v, 0.0, hall.supply_v);
}

}  // namespace

Truck::Truck(const TruckParameters& parameters)
    : parameters_(parameters),
      cells_(parameters.cells, parameters.ocv_v),
      network_(build_network(circuit_, parameters_, cells_)),
      contactors_{{{parameters.relay[0], 4 * parameters.seed},
                   {parameters.relay[1], 4 * parameters.seed + 1},
                   {parameters.relay[2], 4 * parameters.seed + 2},
                   {parameters.relay[3], 4 * parameters.seed + 3}}},
      vdda_v_(parameters.supply.vdda_v),
      resistor_c_(parameters.precharge.ambient_c) {
  update_supplies(0);
  update_charger();
  circuit_.solve_now();
}

void Truck::break_wire(Wire wire) {
  switch (wire) {
    case Wire::fuse:
      circuit_.set_resistance_ohm(network_.fuse, broken_ohm);
      break;
    case Wire::ld:
      circuit_.set_resistance_ohm(network_.ld_wire, broken_ohm);
      break;
    case Wire::pack:
      circuit_.set_resistance_ohm(network_.pack_wire, broken_ohm);
      break;
    case Wire::plus_divider:
      circuit_.set_resistance_ohm(network_.upper[0], broken_ohm);
      break;
    case Wire::minus_divider:
      circuit_.set_resistance_ohm(network_.upper[1], broken_ohm);
      break;
    case Wire::precharge_resistor:
      set_precharge_ohm(broken_ohm);
      break;
  }
}

void Truck::set_string_leak_ohm(double ohm) {
  parameters_.leaks.string_ohm = ohm;
  circuit_.set_resistance_ohm(network_.string_leak, ohm);
}

double Truck::insulation_ohm() const {
  const FrameLeaks& leaks = parameters_.leaks;
  double siemens = 1 / leaks.string_ohm;
  const bool joined =
      contact_closed(Relay::main_plus) || contact_closed(Relay::main_minus) || contact_closed(Relay::precharge);
  if (joined) siemens += 1 / leaks.plus_ohm + 1 / leaks.minus_ohm;
  return 1 / siemens;
}

void Truck::set_precharge_ohm(double ohm) {
  parameters_.precharge.ohm = ohm;
  circuit_.set_resistance_ohm(contact(Relay::precharge), ohm);
}

void Truck::set_other_batteries(const LinkSource& source) {
  circuit_.set_emf_v(network_.other_batteries, source.emf_v);
  constexpr double same = 0.01;  // a new resistance discards the factors; within 1 % the old one will do
  if (std::abs(source.siemens - others_.siemens) <= same * others_.siemens) return;
  others_ = source;
  circuit_.set_resistance_ohm(network_.other_batteries, source.siemens > 0 ? 1 / source.siemens : broken_ohm);
}

LinkSource Truck::link_source() const {
  const bool plus = contact_closed(Relay::main_plus);
  if (!contact_closed(Relay::main_minus) || !(plus || contact_closed(Relay::precharge))) return {};
  const double to_plus_ohm = plus ? parameters_.main_contact_ohm : parameters_.precharge.ohm;
  return {cells_.emf_v(), 1 / (cells_.resistance_ohm() + parameters_.fuse_ohm + parameters_.shunt_ohm + to_plus_ohm +
                               parameters_.main_contact_ohm)};
}

void Truck::update_supplies(double duration_s) {
  const SupplyParameters& supply = parameters_.supply;
  double coils_a = 0;
  const double coil_v = coil_supply_v();
  for (std::size_t k = 0; k < relays; ++k) {
    bool driven = pins_.relay[k] == PinLevel::high;
    if (k == static_cast<std::size_t>(Relay::main_plus)) driven = driven && pins_.ddsg == PinLevel::high;
    if (k == static_cast<std::size_t>(Relay::charge)) driven = driven && pins_.dchg == PinLevel::high;
    contactors_[k].set_coil_v(driven ? coil_v : 0);
    coils_a += contactors_[k].coil_a();
  }
  steady_coil_a_ = coils_a + (steady_coil_a_ - coils_a) / (1 + duration_s / supply.rail_recovery_s);
  const double new_a = std::max(0.0, coils_a - steady_coil_a_);
  vdda_v_ = std::max(0.0, supply.vdda_v - depth_v(vdda_dips_, time_s()) - supply.rail_ohm * new_a);
  for (std::size_t k = 0; k < 2; ++k) {
    circuit_.set_emf_v(network_.bias[k], vdda_v_);
    circuit_.set_emf_v(network_.high_clamp[k], vdda_v_ + adc_clamp_v);
  }
}

void Truck::update_drive() {
  const DcLinkParameters& p = parameters_.dc_link;
  const double v = voltages().dc_link_v();
  const double current_a = v > 1 ? drive_.power_w / v + drive_.current_a : 0;
  double share = share_above(v, p.lockout_v);
  if (current_a < 0) share *= 1 - share_above(v, p.recuperation_limit_v);
  const double idle_a = v > 1 ? share_above(v, p.idle_from_v) * p.idle_w / v : 0;
  circuit_.set_source_a(network_.drive_source, share * current_a + idle_a);
}

void Truck::update_charger() {
  const ChargerParameters& p = parameters_.charger;
  const double idle_a = p.idle_v > 0 ? p.idle_a : 0;
  circuit_.set_source_a(network_.charger_source, charger_.on ? charger_.current_a : idle_a);
  circuit_.set_emf_v(network_.charger_limit, charger_.on ? charger_.voltage_v : p.idle_v);
}

/// The drive's current is constant within a step. Where only the capacitor feeds it, the voltage changes by 0.2 V at
/// most.
double Truck::step_limit_s(double rest_s) const {
  double limit_s = std::min({rest_s, next_edge_s(vdda_dips_, time_s()), next_edge_s(coil_dips_, time_s())});
  for (const Contactor& contactor : contactors_) limit_s = std::min(limit_s, contactor.next_change_s());
  const bool fed = others_.siemens > 1;  // by another battery
  if (!fed && (!contact_closed(Relay::main_plus) || !contact_closed(Relay::main_minus))) {
    const double drive_a = std::abs(circuit_.current_a(network_.drive_source));
    if (drive_a > 0) limit_s = std::min(limit_s, std::max(1e-5, 0.2 * parameters_.dc_link.capacitance_f / drive_a));
  }
  return limit_s;
}

void Truck::update_cells(double duration_s) {
  const bool moved = cells_.advance(circuit_.current_a(network_.string), duration_s);
  if (network_.divided) {
    const std::size_t below = network_.cells_below;
    if (moved) {
      circuit_.set_resistance_ohm(network_.string, cells_.resistance_ohm() - cells_.resistance_ohm(below));
      circuit_.set_resistance_ohm(network_.string_below, cells_.resistance_ohm(below));
    }
    circuit_.set_emf_v(network_.string, cells_.emf_v() - cells_.emf_v(below));
    circuit_.set_emf_v(network_.string_below, cells_.emf_v(below));
    return;
  }
  if (moved) circuit_.set_resistance_ohm(network_.string, cells_.resistance_ohm());
  circuit_.set_emf_v(network_.string, cells_.emf_v());
}

void Truck::update_resistor(double duration_s) {
  const PrechargeResistor& p = parameters_.precharge;
  const double heat_j = precharge_heat_j() - counted_heat_j_;
  counted_heat_j_ += heat_j;
  resistor_c_ += (heat_j - p.to_ambient_w_per_k * (resistor_c_ - p.ambient_c) * duration_s) / p.heat_capacity_j_per_k;
}

void Truck::move_contacts() {
  for (std::size_t k = 0; k < relays; ++k) {
    const bool closes = contactors_[k].closed();
    const std::size_t branch = network_.contact[k];
    if (circuit_.closed(branch) == closes) continue;
    ContactEvent event;
    event.time_s = time_s();
    event.relay = static_cast<Relay>(k);
    event.closes = closes;
    event.dc_link_v = voltages().dc_link_v();
    event.across_v = circuit_.across_v(branch);
    event.current_a = circuit_.current_a(branch);
    circuit_.set_closed(branch, closes);
    circuit_.solve_now();
    if (closes) event.current_a = circuit_.current_a(branch);
    if (!closes) event.across_v = circuit_.across_v(branch);
    event.peak_a = std::abs(event.current_a);
    event.bounce = contactors_[k].last_change_bounced();
    events_.push_back(event);
  }
}

void Truck::track_peaks() {
  for (auto event = events_.rbegin(); event != events_.rend() && event->time_s > time_s() - peak_time_s; ++event) {
    if (event->closes && contact_closed(event->relay)) {
      event->peak_a = std::max(event->peak_a, std::abs(contact_a(event->relay)));
    }
  }
}

void Truck::advance(double duration_s) {
  constexpr double rounding_s = 1e-10;
  const double end_s = time_s() + duration_s;
  for (double rest_s = duration_s; rest_s > rounding_s; rest_s = end_s - time_s()) {
    update_supplies(last_step_s_);
    move_contacts();
    update_drive();
    update_charger();
    const double step_s = last_step_s_ = circuit_.step(step_limit_s(rest_s));
    track_peaks();
    update_cells(step_s);
    update_resistor(step_s);
    for (Contactor& contactor : contactors_) contactor.advance(step_s);
    move_contacts();
  }
}

double Truck::coil_supply_v() const { return std::max(0.0, parameters_.supply.coil_v - depth_v(coil_dips_, time_s())); }

PinVoltages Truck::pins() const {
  const double b_a = current_a();
  return {.ld_v = circuit_.voltage_v(network_.ld_pin),
          .pack_v = circuit_.voltage_v(network_.pack_pin),
          .pc1_v = circuit_.voltage_v(network_.plus_pin),
          .pc0_v = circuit_.voltage_v(network_.minus_pin),
          .vdda_v = vdda_v_,
          .pb14_v = contactor(Relay::main_plus).auxiliary_closed() ? 0 : vdda_v_,
          .pb15_v = contactor(Relay::main_minus).auxiliary_closed() ? 0 : vdda_v_,
          .pa1_v = hall_pin_v(parameters_.hall[0], b_a),
          .pa2_v = hall_pin_v(parameters_.hall[1], b_a),
          .shunt_v = -circuit_.voltage_v(network_.b_minus),
          .pc4_v = std::min(vdda_v_, coil_supply_v() * 12 / 45)};  // 33 kohm, 12 kohm
}

TrueVoltages Truck::voltages() const {
  return {.b_plus_v = circuit_.voltage_v(network_.b_plus),
          .b_minus_v = circuit_.voltage_v(network_.b_minus),
          .l_plus_v = circuit_.voltage_v(network_.l_plus),
          .l_minus_v = circuit_.voltage_v(network_.l_minus),
          .charger_v = circuit_.voltage_v(network_.charger_plus) - circuit_.voltage_v(network_.l_minus)};
}

}  // namespace bms::plant
