#include "tests/firmware/world/truck_world.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "tests/hal/thermistor.hpp"

namespace bms::world {

using plant::Relay;

namespace {

constexpr unsigned i2c_clock = 6, i2c_data = 7, isolated_clock = 10, isolated_data = 11, can_receive = 8, alert = 5,
                   charger_receive = 12, plus_auxiliary = 14, minus_auxiliary = 15, port_of_b = 1;
constexpr std::uint32_t isolated_i2c_base = 0x40005800;  // I2C2
constexpr unsigned key = 2, charger_plug = 3, coil_supply = 4, interlock_loop = 5, crash_sensor = 13, port_of_c = 2;
constexpr double longest_sleep_us = 100;  ///< the front end and the converter are asked for interrupts so often
constexpr double least_step_ms = 1e-3;
constexpr double settle_s = 0.03;       ///< the capacitors at the pins charge before the firmware starts
constexpr double switching_ms = 30;     ///< a contactor moves and bounces
constexpr double reset_delay_ms = 1.5;  ///< t_RSTTEMPO, DS8626, table 23
constexpr std::uint32_t brown_out = 1U << 25 | 1U << 26, power_on = brown_out | 1U << 27;
constexpr double power_down_v = 1.68;  ///< power-down reset
constexpr std::array thermistor_pin{ThermistorPin::ts1, ThermistorPin::ts3, ThermistorPin::hdq, ThermistorPin::cfetoff};

/// Thresholds of the supply detector by PLS, falling and rising (DS8626, table 23, typical).
constexpr std::array<std::array<double, 2>, 8> detector_v{
    {{2.04, 2.14}, {2.19, 2.30}, {2.36, 2.45}, {2.51, 2.60}, {2.66, 2.76}, {2.82, 2.93}, {2.92, 3.03}, {3.03, 3.14}}};

plant::PinLevel at_driver(Level level) {
  if (level == Level::floating) return plant::PinLevel::floating;
  return level == Level::high ? plant::PinLevel::high : plant::PinLevel::low;
}

plant::PinLevel at_driver(PinLevel level) {
  if (level == PinLevel::floating) return plant::PinLevel::floating;
  return level == PinLevel::high ? plant::PinLevel::high : plant::PinLevel::low;
}

}  // namespace

std::uint32_t WorldI2c::read(std::uint32_t offset, double now_us) {
  const std::uint32_t value = model_->read(offset, now_us);
  bytes_ += offset == data ? 1 : 0;
  if (offset != 0x14 && offset != 0x18) {
    polls_ = 0;
    return value;
  }
  if (++polls_ > 3) {
    const double waits_us = chip_.hung ? 5.0 : model_->ready_us() - now_us;
    board_.stall_us = std::max(board_.stall_us, std::min(waits_us, 50.0));
  }
  return value;
}

void WorldI2c::write(std::uint32_t offset, std::uint32_t value, double now_us) {
  polls_ = 0;
  bytes_ += offset == data ? 1 : 0;
  model_->write(offset, value, now_us);
}

void WorldI2c::chip_reset() {
  earlier_.insert(earlier_.end(), model_->violations.begin(), model_->violations.end());
  model_.emplace(chip_);
}

std::vector<std::string> WorldI2c::violations() const {
  std::vector<std::string> all = earlier_;
  all.insert(all.end(), model_->violations.begin(), model_->violations.end());
  return all;
}

TruckWorld::TruckWorld(const std::filesystem::path& image, const WorldSetup& setup)
    : board(image, setup.seed),
      truck(setup.truck),
      port_a(board, 0),
      port_b(board, port_of_b),
      port_c(board, port_of_c),
      exti(board),
      adc(board, setup.seed + 17),
      vehicle(board),
      setup_(setup),
      i2c_(board, chip),
      upper_i2c_(board, upper_chip),
      noise_(setup.seed + 29) {
  held_v_.fill(std::nan(""));
  for (std::size_t k = 0; k < 4; ++k) set_temperature(k, 25);
  board.may_start_again = true;
  board.longest_sleep_us = longest_sleep_us;
  board.plugged = {{firmware::I2cControllerModel::base, &i2c_},
                   {GpioPort::base(0), &port_a},
                   {GpioPort::base(port_of_b), &port_b},
                   {GpioPort::base(2), &port_c},
                   {ExtiModel::base, &exti},
                   {AdcModel::base, &adc}};
  if (stacked()) board.plugged.insert({isolated_i2c_base, &upper_i2c_});
  adc.offset_lsb = setup.adc_offset_lsb;
  adc.pin_v = [this](unsigned channel) {
    const plant::PinVoltages v = truck.pins();
    const std::array<double, 4> wired{v.pa1_v + sensors.hall_error_v, v.pa2_v, v.pc0_v, v.pc1_v};
    const std::array<unsigned, 4> channels{1, 2, 10, 11};
    const auto found = std::find(channels.begin(), channels.end(), channel);
    return found == channels.end() ? 0.0 : wired[static_cast<std::size_t>(found - channels.begin())];
  };
  adc.pin_is_analog = [this](unsigned channel) {
    if (channel < 8) return port_a.analog(channel);
    return channel < 10 ? port_b.analog(channel - 8) : port_c.analog(channel - 10);
  };
  truck.advance(settle_s);
  truck_start_s_ = truck.time_s();
  observe();
}

void TruckWorld::fit_clock() {
  board.rtc = &rtc;
  board.clock_wakes = [this] { exti.line_edge(ExtiModel::clock_line, true); };
  board.bus_falls = [this] { exti.pin_edge(port_of_b, can_receive, false); };
}

void TruckWorld::fit_charger_bus(std::uint32_t bits_per_second) {
  charger_bus.emplace(board, bits_per_second);
  charger_bus->falls = [this] { exti.pin_edge(port_of_b, charger_receive, false); };
}

void TruckWorld::fit_insulation_monitor() {
  insulation.emplace();
  pulse_timer_.emplace(board, port_a, *insulation);
  board.plugged.insert({PulseTimer::base, &*pulse_timer_});
}

// ---- time ----

double TruckWorld::step_ms() const {
  const double now = now_ms();
  double ms = now < switching_until_ms_ ? 1 : 5;
  if (now < fine_until_ms_) ms = std::min(ms, fine_step_ms_);
  if (late_ms_ > 0 && late_edge_ms_ > now) ms = std::min(ms, late_edge_ms_ - now);
  for (const double edge : edges_ms_) {
    if (edge > now + 1e-6) ms = std::min(ms, edge - now);
  }
  return std::max(ms, least_step_ms);
}

void TruckWorld::update_lateness() {
  if (late_ms_ <= 0 || held_in_reset_ || now_ms() < late_edge_ms_) return;
  if (!late_ && !board.sleeping()) return;  // no interrupt of the firmware is as long as a transfer
  late_ = !late_;
  late_edge_ms_ = now_ms() + (late_ ? 1 : 2) * late_ms_ * noise_.uniform();
  board.program_held = late_;
}

void TruckWorld::step(double limit_ms) {
  update_lateness();
  const std::uint64_t writes = port_c.writes;
  board.run_until([&] { return port_c.writes != writes; }, std::max(least_step_ms, std::min(limit_ms, step_ms())));
  const double behind_s = truck_start_s_ + now_s() - truck.time_s();
  if (behind_s > 0) truck.advance(behind_s);
  if (any_held_) update_held_cells();
  observe();
  apply_pins();
  vehicle.update();
  if (each_step) each_step();
}

void TruckWorld::run_ms(double ms) {
  const double until = now_ms() + ms;
  while (now_ms() < until - least_step_ms) step(until - now_ms());
}

double TruckWorld::run_until(const std::function<bool()>& holds, double within_ms) {
  const double start = now_ms();
  while (!holds()) {
    if (now_ms() - start >= within_ms) return -1;
    step(within_ms);
  }
  return now_ms() - start;
}

void TruckWorld::fine_steps(double duration_ms, double step_ms) {
  fine_until_ms_ = now_ms() + duration_ms;
  fine_step_ms_ = step_ms;
}

// ---- from the firmware to the circuit ----

void TruckWorld::apply_pins() {
  plant::ControllerPins pins;
  for (std::size_t k = 0; k < plant::relays; ++k) pins.relay[k] = at_driver(pin(static_cast<Relay>(k)));
  // Of two chips both must enable; the isolator's output is low without its supply.
  const bool upper_enables[2] = {!stacked() || (isolator_supplied && upper_chip.ddsg()),
                                 !stacked() || (isolator_supplied && upper_chip.dchg())};
  pins.ddsg = upper_enables[0] ? at_driver(chip.ddsg_level()) : plant::PinLevel::low;
  pins.dchg = upper_enables[1] ? at_driver(chip.dchg_level()) : plant::PinLevel::low;
  const bool enables[2] = {upper_enables[0] && chip.ddsg(), upper_enables[1] && chip.dchg()};
  if (port_c.writes != seen_writes_ || enables[0] != enables_[0] || enables[1] != enables_[1]) {
    seen_writes_ = port_c.writes;
    enables_[0] = enables[0];
    enables_[1] = enables[1];
    switching_until_ms_ = now_ms() + switching_ms;
  }
  truck.set_pins(pins);
}

// ---- from the circuit to the firmware ----

void TruckWorld::update_auxiliary(unsigned pin, double pin_v, double vdda_v) {
  const bool high = !aux_fitted || pin_v > 0.5 * vdda_v;
  if (high == port_b.outside(pin)) return;
  port_b.set_outside(pin, high);
  exti.pin_edge(port_of_b, pin, high);
}

void TruckWorld::update_inputs(const plant::PinVoltages& v) {
  port_c.set_outside(key, key_on);
  port_c.set_outside(charger_plug, plugged);
  port_c.set_outside(interlock_loop, interlock);
  port_c.set_outside(crash_sensor, !crashed);
  const bool supplied = v.pc4_v > 0.5 * v.vdda_v;
  if (supplied == port_c.outside(coil_supply)) return;
  port_c.set_outside(coil_supply, supplied);
  exti.pin_edge(port_of_c, coil_supply, supplied);
}

void TruckWorld::observe() {
  const plant::PinVoltages v = truck.pins();
  adc.vdda_v = v.vdda_v;
  if (insulation) {
    insulation->pass(now_s() - insulation_passed_s_, truck.insulation_ohm());
    insulation_passed_s_ = now_s();
  }
  // REG1 of the front end, the key and the plug each enable the regulator of the controller.
  update_supply(!chip.in_shutdown() || key_on || plugged ? v.vdda_v : 0);
  update_auxiliary(plus_auxiliary, v.pb14_v, v.vdda_v);
  update_auxiliary(minus_auxiliary, v.pb15_v, v.vdda_v);
  update_inputs(v);
  port_b.set_outside(i2c_data, true);
  port_b.set_outside(i2c_clock, !chip.hung);
  if (stacked()) {
    port_b.set_outside(isolated_data, true);
    port_b.set_outside(isolated_clock, !upper_chip.hung);
    upper_chip.gone = !isolator_supplied;
  }
  update_chip();
  if (chip.alert() != !port_b.outside(alert)) {
    port_b.set_outside(alert, !chip.alert());
    exti.pin_edge(port_of_b, alert, !chip.alert());
  }
  const bool closed_now = both_mains_closed();
  if (were_closed_ && !closed_now) opened_ms_ = now_ms();
  were_closed_ = closed_now;
  if (truck.events().size() != seen_events_) {
    seen_events_ = truck.events().size();
    switching_until_ms_ = now_ms() + switching_ms;
  }
}

/// The detector raises its interrupt line when its output rises. Below the brown-out level the core stands still.
void TruckWorld::update_supply(double vdda_v) {
  const std::uint32_t power_control = board.register_value(0x40007000);
  const auto& threshold = detector_v[power_control >> 5 & 7];
  supply_low_ = vdda_v < threshold[supply_low_ ? 1 : 0] + setup_.detector_error_v;
  const bool detected = supply_low_ && (power_control >> 4 & 1) != 0;
  board.supply(supply_low_);
  if (detected != detected_) exti.line_edge(ExtiModel::supply_line, detected);
  detected_ = detected;
  if (!held_in_reset_ && vdda_v < setup_.reset_v) {
    held_in_reset_ = true;
    board.reset(vdda_v < power_down_v ? power_on : brown_out);
    board.program_held = true;
    detected_ = false;
    released_ms_ = never;
  }
  if (!held_in_reset_) return;
  if (vdda_v < setup_.reset_ends_v) {
    released_ms_ = never;
  } else if (released_ms_ == never) {
    released_ms_ = now_ms() + reset_delay_ms;
  } else if (now_ms() >= released_ms_) {
    held_in_reset_ = board.program_held = false;
  }
}

/// Two chips: the larger half of an odd number at the lower one, which has the shunt (boards/stm32f405_80v/README.md).
void TruckWorld::update_chip() {
  const std::size_t cells = truck.cell_count(), below = stacked() ? (cells + 1) / 2 : cells;
  update_chip(chip, 0, below);
  if (stacked()) update_chip(upper_chip, below, cells - below);
}

void TruckWorld::update_chip(Bq76952Model& which, std::size_t first, std::size_t count) {
  const plant::PinVoltages v = truck.pins();
  const bool is_lower = &which == &chip;
  Bq76952Inputs in;
  in.internal_c = is_lower ? die_c : upper_die_c;
  in.ts2_low = key_on || plugged;
  in.stack_v = is_lower ? sensors.stack_error_v : 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double cell_v = truck.cell_v(first + k);
    double& input_v = in.cell_v[k + 1 < count ? k : in.cell_v.size() - 1];  // hal/bq76952/README.md, wiring
    in.stack_v += cell_v;
    input_v = cell_v + sensors.cell_error_v[first + k];
    if (setup_.cell_noise_v > 0) input_v += setup_.cell_noise_v * noise_.normal();
  }
  if (stacked()) {
    // the place of the chip; without its wire the pin has the other level. LD is at VSS
    const bool broken = is_lower ? sensors.lower_strap_broken : sensors.upper_strap_broken;
    in.pack_v = is_lower == broken ? in.stack_v : 0;
  } else {
    in.pack_v = v.pack_v;
    in.ld_v = v.ld_v;
  }
  if (is_lower) {
    in.shunt_v = sensors.shunt_factor * v.shunt_v;
    if (setup_.shunt_noise_v > 0) in.shunt_v += setup_.shunt_noise_v * noise_.normal();
  }
  const std::size_t thermistors = stacked() ? 2 : thermistor_pin.size(), first_sensor = is_lower ? 0 : thermistors;
  for (std::size_t k = 0; k < thermistors; ++k)
    in.thermistor_ohm[static_cast<std::size_t>(thermistor_pin[k])] = ohm_[first_sensor + k];
  const auto now_us = static_cast<std::uint64_t>(1e3 * now_ms());
  if (now_us > which.time_us) which.advance(now_us - which.time_us);  // with the values of the step that ends now
  which.advance(0, in);
}

// ---- the test's hands ----

void TruckWorld::dip_vdda(double delay_ms, double duration_ms, double depth_v) {
  const double at_ms = now_ms() + delay_ms;
  truck.add_vdda_dip({truck_start_s_ + 1e-3 * at_ms, 1e-3 * duration_ms, depth_v});
  edges_ms_.insert(edges_ms_.end(), {at_ms, at_ms + 0.02, at_ms + duration_ms, at_ms + duration_ms + 0.02});
}

void TruckWorld::dip_coil_supply(double delay_ms, double duration_ms, double depth_v) {
  const double at_ms = now_ms() + delay_ms;
  truck.add_coil_supply_dip({truck_start_s_ + 1e-3 * at_ms, 1e-3 * duration_ms, depth_v});
  edges_ms_.insert(edges_ms_.end(), {at_ms, at_ms + duration_ms});
}

void TruckWorld::hold_cell(std::size_t cell, double voltage_v) {
  held_v_[cell] = voltage_v;
  any_held_ = std::any_of(held_v_.begin(), held_v_.end(), [](double v) { return !std::isnan(v); });
  if (!std::isnan(voltage_v)) update_held_cells();
}

/// Newton steps on the charge of a cell. Beyond 0 and 100 % the curve goes on with its last slope.
void TruckWorld::update_held_cells() {
  for (std::size_t k = 0; k < truck.cell_count(); ++k) {
    if (std::isnan(held_v_[k])) continue;
    for (int step = 0; step < 40; ++step) {
      const double error_v = held_v_[k] - truck.cell_v(k);
      if (std::abs(error_v) < 2e-4) break;
      const double soc = truck.cells().soc(k);
      const double slope_v = std::max(0.2, (ocv_v_.at(soc + 1e-3) - ocv_v_.at(soc - 1e-3)) / 2e-3);
      truck.cells().set_soc(k, soc + error_v / slope_v);
    }
  }
}

void TruckWorld::set_temperature(std::size_t sensor, double celsius) {
  celsius_[sensor] = celsius;
  ohm_[sensor] = thermistor_ohm(celsius);
}

void TruckWorld::set_thermistor_ohm(std::size_t sensor, double ohm) {
  celsius_[sensor] = std::nan("");
  ohm_[sensor] = ohm;
}

// ---- what happened ----

bool TruckWorld::isolated() const {
  return !both_mains_closed() && !(closed(Relay::precharge) && closed(Relay::main_minus));
}

double TruckWorld::highest_cell_v() const {
  double v = 0;
  for (std::size_t k = 0; k < truck.cell_count(); ++k) v = std::max(v, truck.cell_v(k));
  return v;
}

double TruckWorld::lowest_cell_v() const {
  double v = 10;
  for (std::size_t k = 0; k < truck.cell_count(); ++k) v = std::min(v, truck.cell_v(k));
  return v;
}

double TruckWorld::pack_v() const {
  double v = 0;
  for (std::size_t k = 0; k < truck.cell_count(); ++k) v += truck.cell_v(k);
  return v;
}

std::vector<TruckWorld::Closing> TruckWorld::closings_below_v(double volt, std::size_t since) const {
  std::vector<Closing> found;
  std::array<bool, plant::relays> is_closed{};
  const auto& events = truck.events();
  for (std::size_t k = 0; k < events.size(); ++k) {
    const plant::ContactEvent& e = events[k];
    is_closed[static_cast<std::size_t>(e.relay)] = e.closes;
    const bool main = e.relay == Relay::main_plus || e.relay == Relay::main_minus;
    if (!main || !e.closes || k < since || !is_closed[0] || !is_closed[1]) continue;
    if (std::abs(e.across_v) <= volt) continue;
    found.push_back({1e3 * (e.time_s - truck_start_s_), e.across_v, e.peak_a, e.dc_link_v, e.relay, e.bounce});
  }
  return found;
}

std::vector<std::string> TruckWorld::violations() const {
  std::vector<std::string> all = i2c_.violations();
  const std::vector<std::string> of_upper = upper_i2c_.violations();
  for (const auto* more : {&of_upper, &chip.violations, &upper_chip.violations, &board.can.violations,
                           &board.rcc.violations, &board.flash.violations, &adc.violations, &port_a.violations,
                           &port_b.violations, &port_c.violations, &rtc.violations}) {
    all.insert(all.end(), more->begin(), more->end());
  }
  if (pulse_timer_) all.insert(all.end(), pulse_timer_->violations.begin(), pulse_timer_->violations.end());
  if (charger_bus) all.insert(all.end(), charger_bus->can.violations.begin(), charger_bus->can.violations.end());
  return all;
}

}  // namespace bms::world
