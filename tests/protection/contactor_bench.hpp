// Contactors of the forklift's pack on a bench: with a simulated DC link, or with readings that a test sets.
#pragma once

#include <cmath>
#include <cstdint>
#include <ostream>

#include <gtest/gtest.h>

#include "protection/contactors.hpp"
#include "tests/protection/expected_rows.hpp"

namespace bms::protection {

inline void PrintTo(ContactorState s, std::ostream* out) { *out << contactor_state_names[static_cast<std::size_t>(s)]; }

/// Test part 0.3 s, half time constant 0.25 s, DC link 5 s, rest 0.12 A.
inline constexpr ContactorPlan forklift_contactors = contactor_plan(forklift);
inline constexpr std::int32_t rested_pack_uv = 52'800'000;

/// Contactors between a pack and a DC link: precharge resistor 50 ohm, 10 mF, discharge resistor. A welded or failing
/// contactor ignores its command.
struct ContactorBench {
  Contactors contactors{forklift_contactors};
  ContactorInput in{
      .request = Request::none, .current_ua = 0, .pack_uv = rested_pack_uv, .dc_link_uv = 0, .step_us = 100'000};
  double dc_link_v = 0, load_a = 0, time_constant_s = 0.5, discharge_s = 3, load_fraction = 0;
  bool plus_welded = false, minus_welded = false, precharge_welded = false, plus_fails = false;

  void step() {
    const Outputs out = contactors.update(in);
    const bool plus = (out.main_plus && !plus_fails) || plus_welded, minus = out.main_minus || minus_welded,
               relay = out.precharge || precharge_welded;
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
    in.dc_link_uv = static_cast<std::int32_t>(1e6 * dc_link_v);
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
  ContactorState step(double seconds, std::int32_t dc_link_uv = 0) {
    in.step_us = static_cast<std::uint32_t>(std::lround(1e6 * seconds));
    in.dc_link_uv = dc_link_uv;
    contactors.update(in);
    return contactors.state();
  }
  /// Runs to a state with a normal DC link.
  FedContactors& to(ContactorState s, Request r = Request::drive) {
    in.request = r;
    for (int k = 0; k < 1'000 && contactors.state() != s; ++k)
      step(0.1, contactors.state() == ContactorState::precharge || contactors.outputs().main_plus ? rested_pack_uv : 0);
    EXPECT_EQ(contactors.state(), s);
    return *this;
  }
  bool welded() const { return contactors.events().welded; }

  Contactors contactors;
  ContactorInput in{
      .request = Request::none, .current_ua = 0, .pack_uv = rested_pack_uv, .dc_link_uv = 0, .step_us = 0};
};

}  // namespace bms::protection
