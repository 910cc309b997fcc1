// Contactors of the forklift's pack on a bench: with a simulated DC link, or with readings that a test sets. Both poles
// of the DC link are where the wiring puts them.
#pragma once

#include <cmath>
#include <cstdint>
#include <ostream>

#include <gtest/gtest.h>

#include "plant/link_poles.hpp"
#include "protection/contactors.hpp"
#include "tests/firmware/protection/expected_rows.hpp"

namespace bms::protection {

inline void PrintTo(ContactorState s, std::ostream* out) { *out << contactor_state_names[static_cast<std::size_t>(s)]; }

/// Test part 0.3 s, half time constant 0.25 s, rest 0.12 A, main plus closes at 9 V at most.
inline constexpr ContactorPlan forklift_contactors = contactor_plan(forklift);
inline constexpr std::int32_t rested_pack_uv = 52'800'000;

inline void set_poles(ContactorInput& in, const plant::LinkPoles& poles) {
  in.link_plus_uv = static_cast<std::int32_t>(std::lround(1e6 * poles.plus_v));
  in.link_minus_uv = static_cast<std::int32_t>(std::lround(1e6 * poles.minus_v));
}

/// Contactors between a pack and a DC link: precharge resistor 50 ohm, 10 mF, discharge resistor. A welded or failing
/// contactor ignores its command.
struct ContactorBench {
  Contactors contactors{forklift_contactors};
  ContactorInput in{.current_ua = 0,
                    .pack_uv = rested_pack_uv,
                    .link_plus_uv = 1'278'000,
                    .link_minus_uv = 1'278'000,
                    .step_us = 100'000};
  double dc_link_v = 0, load_a = 0, time_constant_s = 0.5, discharge_s = 3, load_fraction = 0;
  bool plus_welded = false, minus_welded = false, precharge_welded = false, plus_fails = false, minus_fails = false;
  bool resistor_open = false;

  void step() {
    const Outputs out = contactors.update(in);
    const bool plus = (out.main_plus && !plus_fails) || plus_welded,
               minus = (out.main_minus && !minus_fails) || minus_welded,
               relay = (out.precharge || precharge_welded) && !resistor_open;
    const double step_s = in.step_us / 1e6, pack_v = rested_pack_uv / 1e6;
    double current_a = 0;
    if (plus && minus) {
      dc_link_v = pack_v;
      current_a = load_a;
    } else if (relay && minus) {
      const double end_v = pack_v * (1 - load_fraction);
      dc_link_v += (end_v - dc_link_v) * (1 - std::exp(-step_s / time_constant_s));
    } else {
      dc_link_v *= std::exp(-step_s / discharge_s);
      if (load_a < 0) dc_link_v *= 0.8;
    }
    set_poles(in, plant::link_poles(plus || relay, minus, pack_v, dc_link_v));
    in.current_ua = static_cast<std::int32_t>(1e6 * current_a);
    closed = plus && minus;
  }
  ContactorState run(double seconds) {
    for (double t = 0; t < seconds - 1e-9; t += in.step_us / 1e6) step();
    return contactors.state();
  }
  /// Runs until the state is reached. Returns the time [s], or -1 after most_s.
  double until(ContactorState s, double most_s) {
    for (double t = 0; t <= most_s; t += in.step_us / 1e6) {
      if (contactors.state() == s) return t;
      step();
      seen.welded = seen.welded || contactors.events().welded;
      seen.precharge_failed = seen.precharge_failed || contactors.events().precharge_failed;
      seen.not_closed = seen.not_closed || contactors.events().not_closed;
    }
    return -1;
  }
  void drive_off(Request r = Request::drive) {
    in.request = r;
    until(r == Request::drive ? ContactorState::drive : ContactorState::charge, 10);
    run(1);
  }
  bool closed = false;
  ContactorEvents seen;
};

/// Contactors with the readings that a test sets.
struct FedContactors {
  explicit FedContactors(const ContactorPlan& plan = forklift_contactors) : contactors(plan) {}
  /// dc_link_uv: voltage of the DC link. Its poles are where the commanded contactors connect them.
  ContactorState step(double seconds, std::int32_t dc_link_uv = 0) {
    const Outputs out = contactors.outputs();
    in.link_plus_uv = in.link_minus_uv = measurement::no_reading;
    if (dc_link_uv != measurement::no_reading)
      set_poles(in, plant::link_poles(out.main_plus || out.precharge, out.main_minus, 1e-6 * rested_pack_uv,
                                      1e-6 * dc_link_uv));
    return step_with_poles(seconds, in.link_plus_uv, in.link_minus_uv);
  }
  ContactorState step_with_poles(double seconds, std::int32_t plus_uv, std::int32_t minus_uv) {
    in.step_us = static_cast<std::uint32_t>(std::lround(1e6 * seconds));
    in.link_plus_uv = plus_uv;
    in.link_minus_uv = minus_uv;
    contactors.update(in);
    return contactors.state();
  }
  /// Runs to a state with a normal DC link, which starts with first_uv.
  FedContactors& to(ContactorState s, Request r = Request::drive, std::int32_t first_uv = 0) {
    in.request = r;
    std::int32_t dc_link_uv = first_uv;
    for (int k = 0; k < 1'000 && contactors.state() != s; ++k) {
      const Outputs out = contactors.outputs();
      if (out.main_plus)
        dc_link_uv = rested_pack_uv;
      else if (out.main_minus && out.precharge)
        dc_link_uv += (rested_pack_uv - dc_link_uv) / 5;
      step(0.1, dc_link_uv);
    }
    EXPECT_EQ(contactors.state(), s);
    return *this;
  }
  bool welded() const { return contactors.events().welded; }

  Contactors contactors;
  ContactorInput in{.current_ua = 0, .pack_uv = rested_pack_uv, .step_us = 0};
};

}  // namespace bms::protection
