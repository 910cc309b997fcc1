// A pack on a bench whose state a test sets, with protection and a simulated DC link.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>

#include <gtest/gtest.h>

#include "plant/link_poles.hpp"
#include "protection/protection.hpp"
#include "tests/firmware/protection/expected_rows.hpp"

namespace bms::protection {

inline constexpr ProtectionPlan forklift_plan = protection_plan(forklift);

/// Sets the poles of a DC link where these contactors connect them.
inline void set_poles(ExternalInputs& inputs, const Outputs& closed, double pack_uv, double dc_link_uv) {
  const plant::LinkPoles poles =
      plant::link_poles(closed.main_plus || closed.precharge, closed.main_minus, 1e-6 * pack_uv, 1e-6 * dc_link_uv);
  inputs.link_plus_uv = static_cast<std::int32_t>(std::lround(1e6 * poles.plus_v));
  inputs.link_minus_uv = static_cast<std::int32_t>(std::lround(1e6 * poles.minus_v));
}

/// A pack in a state that the test sets. Its readings always change a little.
struct ProtectionBench {
  explicit ProtectionBench(std::uint64_t start_us = 0, const ProtectionPlan& plan = forklift_plan,
                           std::uint32_t period_us = 100'000)
      : protection(plan), time_us(start_us), period(period_us) {
    estimate.soc_ppb = 600'000'000;
  }
  const Decision& step() {
    sample.time_us = time_us += period;
    ++count;
    const Outputs out = protection.decision().outputs;
    closed = out.main_plus && out.main_minus;
    for (std::size_t k = 0; k < 16; ++k)
      sample.cell_uv[k] = base_uv + static_cast<std::int32_t>(500 * ((count + k) % 3));
    for (std::size_t k = 0; k < 4; ++k)
      sample.temperature_cdegc[k] = static_cast<std::int16_t>(2'500 + (count + k) % 5);
    sample.current_ua = closed ? load_ua : 0;
    if (change) change(sample);
    std::int64_t sum = 0;
    for (const std::int32_t uv : sample.cell_uv) sum += uv;
    sample.pack_uv = static_cast<std::int32_t>(sum) + pack_error_uv;
    if (closed)
      dc_link_uv = static_cast<double>(sample.pack_uv);
    else if (out.precharge && out.main_minus)
      dc_link_uv += (static_cast<double>(sample.pack_uv) - dc_link_uv) * 0.18;
    else
      dc_link_uv *= 0.97;
    const Outputs connected{
        .main_plus = out.main_plus || plus_welded, .main_minus = out.main_minus, .precharge = out.precharge};
    set_poles(inputs, connected, sample.pack_uv, dc_link_uv);
    return protection.update(sample, estimate, inputs);
  }
  void run(int steps) {
    for (int k = 0; k < steps; ++k) step();
  }
  void drive_off() {
    inputs.request = Request::drive;
    for (int k = 0; k < 100 && protection.decision().state != ContactorState::drive; ++k) step();
    load_ua = -3'000'000;
    run(60);
    ASSERT_EQ(protection.decision().state, ContactorState::drive);
    ASSERT_EQ(protection.decision().faults, 0U);
  }

  Protection<16> protection;
  measurement::PackSample<16> sample;
  PackEstimate<16> estimate;
  ExternalInputs inputs;
  std::uint64_t time_us;
  std::uint32_t period, count = 0;
  std::int32_t base_uv = 3'300'000, load_ua = 0, pack_error_uv = 0;  ///< error: of the pack's own measurement
  double dc_link_uv = 0;
  bool closed = false, plus_welded = false;
  std::function<void(measurement::PackSample<16>&)> change;
};

}  // namespace bms::protection
