// A truck of 280 Ah around the application on this machine, ten samples a second: key, emergency stop, loads on the DC
// link, a CANopen charger with its plug. Contacts follow their outputs while the coils have a supply.
#pragma once

#include <algorithm>
#include <string>

#include "firmware/cia418_profile.hpp"
#include "plant/link_poles.hpp"
#include "tests/firmware/application_fixture.hpp"
#include "tests/firmware/storage/flash_model.hpp"

namespace bms::firmware {

struct TruckBoard : Board<16> {
  static const protection::ProtectionPlan& plan() {
    static const auto plan = [] {
      protection::PackDesign d = Table9Board<16>::design(0.1);
      d.capacity_ah = d.limits.charge_current_max_a = d.limits.discharge_current_max_a = 280;
      d.current_range_a = 2'000;
      return protection::protection_plan(d);
    }();
    return plan;
  }
  /// The estimate is constant, so it gives no limits.
  static void update_condition(auto&, const auto&, const auto&, const auto&, bool) {}
};

class TruckDay {
 public:
  /// device_key: makes the image one for a product.
  /// inputs: bits of hal::TruckInput that are fitted
  explicit TruckDay(bool auxiliary_contacts = true,
                    const std::optional<std::array<std::uint8_t, 16>>& device_key = std::nullopt,
                    std::uint32_t inputs = 0) {
    host_hal::begin();
    host_hal::key = device_key;
    host_hal::development = !device_key;
    estimator_hangs_back = false;
    for (std::uint32_t k = 0; k < 3; ++k) flash_.fill(k, std::vector<std::uint8_t>(0x4000, 0xFF));
    plug_in(&flash_);
    persistence_.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
    application_.emplace(std::nullopt, messages::Identity{host_hal::cell_hash, 0}, 280.F, persistence_);
    host_hal::contacts.fitted = auxiliary_contacts;
    host_hal::truck.fitted = inputs;
    run(1);
  }
  ~TruckDay() {
    plug_in(nullptr);
    host_hal::begin();
  }
  TruckDay(const TruckDay&) = delete;
  TruckDay& operator=(const TruckDay&) = delete;

  // What the day does.
  bool key = false, emergency_stop = false;
  bool interlock = true, crashed = false, seen_plug = false,
       key_input = false;  ///< levels of the inputs, if they are fitted
  bool talks = true;       ///< the truck sends its request every second, also request 0
  double load_a = 0;       ///< of drive, converter and fan, while the contactors are closed
  double idle_w = 0;       ///< on the DC link, also while it is precharged
  struct Charger {
    bool plugged = false, on = true;
    double current_a = 100;
    bool present() const { return plugged && on; }
  } charger;

  void dip_supply(int samples) { dip_samples_ = samples; }
  void send(const can::Frame& frame) { host_hal::requests.push_back(frame); }
  void send_request(std::uint32_t argument) {
    can::Command c;
    c.code = can::Command::code_request;
    c.argument = argument;
    send(c.frame(counter_ = can::next(counter_)));
  }

  /// One sample.
  void step() {
    ++samples_;
    if (talks && samples_ % 10 == 1) send_request(key ? 1 : 0);
    if (samples_ % 5 == 2 && charger.present()) send({0x70A, 1, {5}});
    if (dip_samples_ > 0) ++host_hal::supply_falls;
    host_hal::board_state.supply_low = --dip_samples_ > 0;
    move_contacts();
    const double current_a = advance_link();
    measurement::PackSample<16> s;
    s.time_us = 100'000ULL * samples_;
    for (std::size_t k = 0; k < 16; ++k) s.cell_uv[k] = 3'280'000 + static_cast<std::int32_t>((samples_ + k) % 3) * 500;
    s.pack_uv = static_cast<std::int32_t>(1e6 * pack_v);
    s.temperature_cdegc.fill(2'500);
    s.temperature_cdegc[0] = first_cdegc;
    for (std::size_t k = 1; k < 4; ++k) s.temperature_cdegc[k] += static_cast<std::int16_t>((samples_ + k) % 4);
    s.current_ua = static_cast<std::int32_t>(1e6 * current_a);
    const plant::LinkPoles poles = plant::link_poles(plus_ || relay_, minus_, pack_v, link_v_);
    host_hal::link_readings = {static_cast<std::int32_t>(1e6 * poles.plus_v),
                               static_cast<std::int32_t>(1e6 * poles.minus_v)};
    set_inputs();
    application_->process_sample(s);
  }
  void run(double seconds) {
    for (double t = 0; t < seconds - 1e-9; t += 0.1) step();
  }
  bool drives() const { return plus_ && minus_ && state() == can::ContactorState::state_drive; }
  bool charges() const { return plus_ && minus_ && host_hal::switched.charge_enable; }
  bool any_closed() const { return plus_ || minus_ || relay_; }
  std::uint32_t state() const { return host_hal::last<can::ContactorState>()->state; }
  std::uint64_t faults() const {
    const auto bits = [](const auto& message, unsigned first) {
      std::uint64_t all = 0;
      for (unsigned k = 0; k < 32; ++k) all |= std::uint64_t{can::get_raw(message.frame(0), first + k, 1)} << k;
      return all;
    };
    return bits(*host_hal::last<can::Faults>(), 16) | bits(*host_hal::last<can::MoreFaults>(), 16) << 32;
  }
  std::uint32_t first_cause() const { return host_hal::last<can::Faults>()->first_cause; }
  /// The driver waits, turns the key off and on, and drives. Returns false if not.
  bool next_key_on_drives() {
    key = false;
    load_a = 0;
    idle_w = 0;
    run(13);
    return key_on();
  }
  bool key_on(double within_s = 10) {
    key = true;
    for (double t = 0; t < within_s && !drives(); t += 0.1) step();
    return drives();
  }
  /// Number of faults stored so far, and the newest.
  std::uint32_t stored() const { return persistence_.events().faults; }
  std::string last_stored() const {
    const std::uint16_t code = persistence_.events().last(0).code;
    return code == 0 ? "none" : protection::fault_names[code - first_fault_code];
  }

  static constexpr double pack_v = 16 * 3.2805;
  std::int16_t first_cdegc = 2'500;  ///< of the first thermistor

 private:
  void set_inputs() {
    const auto bit = [](hal::TruckInput input, bool on) { return on ? static_cast<std::uint32_t>(input) : 0U; };
    host_hal::truck.on = bit(hal::TruckInput::coil_supply, !emergency_stop) |
                         bit(hal::TruckInput::interlock, interlock) | bit(hal::TruckInput::crash, !crashed) |
                         bit(hal::TruckInput::charger_plug, seen_plug) | bit(hal::TruckInput::key, key_input);
  }
  /// The interrupt of an auxiliary contact, or that of the supply, has opened all outputs until the firmware knows it.
  void move_contacts() {
    const auto& out = host_hal::switched;
    const bool lost = emergency_stop && host_hal::contacts.fitted && (out.main_plus || out.main_minus);
    const bool watched = host_hal::truck.has(hal::TruckInput::coil_supply);
    if (emergency_stop && watched && out.main_minus) host_hal::truck.coil_losses = 1;
    if (lost && host_hal::contacts.losses == 0) host_hal::contacts.losses = 1;
    const bool coils = !emergency_stop && host_hal::contacts.losses == 0 && host_hal::truck.coil_losses == 0 &&
                       host_hal::supply_falls == 0;
    plus_ = out.main_plus && coils;
    minus_ = out.main_minus && coils;
    relay_ = out.precharge && coils;
    host_hal::contacts.main_plus_closed = plus_;
    host_hal::contacts.main_minus_closed = minus_;
  }
  /// A capacitor of 10 mF, a precharge resistor of 50 ohm, a bleeder of 1 kohm. Returns the current of the cells.
  double advance_link() {
    if (plus_ && minus_) {
      link_v_ = pack_v;
      const bool fed = charger.present() && host_hal::switched.charge_enable;
      return (fed ? charger.current_a : 0) - load_a - idle_w / pack_v;
    }
    double charge_c = 0;
    for (int ms = 0; ms < 100; ++ms) {
      const double in_a = relay_ && minus_ ? (pack_v - link_v_) / 50 : 0,
                   out_a = link_v_ / 1'000 + (link_v_ > 15 ? (idle_w + load_a * pack_v) / link_v_ : 0);
      link_v_ = std::max(0.0, link_v_ + (in_a - out_a) * 0.001 / 0.01);
      charge_c += in_a * 0.001;
    }
    return -charge_c / 0.1;
  }

  FlashModel flash_{{3, 0x4000}, 1};
  storage::Persistence persistence_;
  std::optional<Application<TruckBoard, Cia418Profile>> application_;
  double link_v_ = 0;
  unsigned samples_ = 0;
  int dip_samples_ = 0;
  std::uint8_t counter_ = 0;
  bool plus_ = false, minus_ = false, relay_ = false;
};

}  // namespace bms::firmware
