// Contactors of the forklift's pack in the electrical world of evidence/plant/circuit: pins out, voltages at the pins
// in. How the pins read is written from the wiring table of boards/stm32f405_forklift/README.md.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "plant/circuit/truck.hpp"
#include "protection/contactors.hpp"
#include "tests/firmware/protection/contactor_bench.hpp"

namespace bms::protection {

/// Voltage at the far end of a divider, with 56 kohm to C0 and 56 kohm to VDDA, from its pin. Nominal: 1 Mohm, for more
/// than 16 cells 2 Mohm. The converter has 12 bits of VDDA; VDDA itself is known to 0.1 % by the internal reference.
inline std::int32_t divided_uv(double pin_v, double vdda_v, std::size_t cells) {
  const double upper_ohm = cells > 16 ? 2e6 : 1e6,
               counts = std::round(std::clamp(4'095 * pin_v / vdda_v, 0.0, 4'095.0));
  const double shown_v = 1.001 * vdda_v * (counts / 4'095 * (1 + 2 * upper_ohm / 56e3) - upper_ohm / 56e3);
  return static_cast<std::int32_t>(1e6 * shown_v);
}

/// Cells of 100 Ah: rest below 2 A.
inline constexpr ContactorPlan wired_contactors = [] {
  PackDesign design = forklift;
  design.capacity_ah = 100;
  return contactor_plan(design);
}();

class WiredTruck {
 public:
  explicit WiredTruck(const plant::TruckParameters& world, bool auxiliary_contacts = true)
      : truck(world), auxiliary_(auxiliary_contacts), contactors_(wired_contactors) {
    truck.advance(0.05);  // the capacitors of the pins
    pack_v_ = cells_v();
  }

  /// One sample: readings, a step of the contactors 12 ms later, the rest of the period.
  void sample() {
    const plant::PinVoltages pins = truck.pins();
    ContactorInput in{.request = request, .step_us = 100'000};
    in.open_now = open_now;
    in.current_ua = static_cast<std::int32_t>(std::lround(1e6 * truck.current_a()));
    in.pack_uv = static_cast<std::int32_t>(1e6 * pack_v_);
    in.link_plus_uv = divided_uv(pins.pc1_v, pins.vdda_v, truck.cell_count());
    in.link_minus_uv = divided_uv(pins.pc0_v, pins.vdda_v, truck.cell_count());
    in.auxiliary = {auxiliary_, pins.pb14_v < 1, pins.pb15_v < 1};
    in.contact_lost = lost_;
    watched_ = {in.auxiliary.fitted && in.auxiliary.main_plus_closed && outputs_.main_plus,
                in.auxiliary.fitted && in.auxiliary.main_minus_closed && outputs_.main_minus};
    advance(0.012);
    outputs_ = contactors_.update(in);
    if (!outputs_.any_closed()) lost_ = false;
    drive_pins();
    const ContactorEvents& now = contactors_.events();
    seen.welded = seen.welded || now.welded;
    seen.precharge_failed = seen.precharge_failed || now.precharge_failed;
    seen.not_closed = seen.not_closed || now.not_closed;
    rows(now);
    advance(0.04);
    pack_v_ = cells_v();  // the front end reads the cells half a period before the sample ends
    advance(0.048);
    time_s_ += 0.1;
  }
  void run(double seconds) {
    for (double t = 0; t < seconds - 1e-9; t += 0.1) sample();
  }
  /// Returns the time until the state is reached [s], or -1.
  double until(ContactorState s, double most_s) {
    for (double t = 0; t <= most_s; t += 0.1) {
      if (contactors_.state() == s) return t;
      sample();
    }
    return -1;
  }
  ContactorState state() const { return contactors_.state(); }
  Pole welded_pole() const { return contactors_.welded_pole(); }
  const Outputs& outputs() const { return outputs_; }
  bool any_event() const { return seen.welded || seen.precharge_failed || seen.not_closed; }
  double cells_v() const {
    double sum_v = 0;
    for (std::size_t k = 0; k < truck.cell_count(); ++k) sum_v += truck.cell_v(k);
    return sum_v;
  }
  /// Largest voltage across a main contactor when it closed, and largest current within 5 ms after it.
  struct Closing {
    double across_v = 0, peak_a = 0;
  };
  Closing worst_closing(plant::Relay relay) const {
    Closing worst;
    for (const plant::ContactEvent& e : truck.events()) {
      if (e.relay != relay || !e.closes || e.bounce) continue;
      worst.across_v = std::max(worst.across_v, std::abs(e.across_v));
      worst.peak_a = std::max(worst.peak_a, e.peak_a);
    }
    return worst;
  }

  plant::Truck truck;
  Request request = Request::none;
  bool open_now = false;
  ContactorEvents seen;    ///< any event since the start
  bool fault = false;      ///< a row of the table was raised
  bool rows_react = true;  ///< the rows of the table open

 private:
  /// The delays of the rows precharge failed, contactor welded and contactor not closed.
  void rows(const ContactorEvents& now) {
    welded_samples_ = now.welded ? welded_samples_ + 1 : 0;
    open_samples_ = now.not_closed ? open_samples_ + 1 : 0;
    if (now.precharge_failed || welded_samples_ > 2 || open_samples_ > 3) fault = true;
    if (rows_react) open_now = fault;
  }
  void drive_pins() {
    const auto level = [](bool on) { return on ? plant::PinLevel::high : plant::PinLevel::low; };
    plant::ControllerPins pins;
    pins.relay = {level(outputs_.main_plus && !lost_), level(outputs_.main_minus && !lost_),
                  level(outputs_.precharge && !lost_), level(outputs_.charge_enable && !lost_)};
    pins.ddsg = pins.dchg = plant::PinLevel::high;
    truck.set_pins(pins);
  }
  /// The interrupt of an auxiliary contact opens everything.
  void advance(double duration_s) {
    for (double t = 0; t < duration_s - 1e-9; t += 0.001) {
      truck.advance(0.001);
      const plant::PinVoltages pins = truck.pins();
      if (!lost_ && ((watched_.plus && outputs_.main_plus && pins.pb14_v > 1) ||
                     (watched_.minus && outputs_.main_minus && pins.pb15_v > 1))) {
        lost_ = true;
        drive_pins();
      }
    }
  }

  struct Watched {
    bool plus = false, minus = false;
  };
  bool auxiliary_, lost_ = false;
  Watched watched_;
  Contactors contactors_;
  Outputs outputs_;
  double pack_v_ = 0, time_s_ = 0;
  int welded_samples_ = 0, open_samples_ = 0;
};

}  // namespace bms::protection
