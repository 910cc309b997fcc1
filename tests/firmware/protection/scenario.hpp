// A thousand samples of a pack with many conditions and faults, and all decisions of the protection as one hash: equal
// on host and board.
#pragma once

#include <algorithm>
#include <cstdint>

#include "protection/protection.hpp"
#include "tests/firmware/protection/expected_rows.hpp"

namespace bms::protection {

inline constexpr ProtectionPlan scenario_plan = protection_plan(forklift);

/// Integers only. Random numbers from a linear congruential generator (constants of Numerical Recipes).
class Scenario {
 public:
  template <class Step>
  constexpr std::uint32_t run(int samples, Step&& step) {
    std::uint32_t hash = 2'166'136'261U;  // FNV-1a
    const auto add = [&](std::uint32_t word) { hash = (hash ^ word) * 16'777'619U; };
    for (int k = 1; k <= samples; ++k) {
      measure(k);
      const Decision& d = step(protection, sample, estimate, inputs);
      outputs_ = d.outputs;
      for (const std::uint32_t word :
           {static_cast<std::uint32_t>(d.faults), static_cast<std::uint32_t>(d.faults >> 32),
            static_cast<std::uint32_t>(d.state), static_cast<std::uint32_t>(d.allowed.charge_ua),
            static_cast<std::uint32_t>(d.allowed.discharge_ua), d.bleed, d.bleed_left_s,
            static_cast<std::uint32_t>(d.first.fault), static_cast<std::uint32_t>(d.first.time_us),
            static_cast<std::uint32_t>(d.outputs.any_closed())}) {
        add(word);
      }
    }
    return hash;
  }

  Protection<16> protection{scenario_plan};
  measurement::PackSample<16> sample;
  PackEstimate<16> estimate;
  ExternalInputs inputs;

 private:
  constexpr std::int32_t chance(std::int32_t most) {
    state_ = state_ * 1'664'525U + 1'013'904'223U;
    return static_cast<std::int32_t>(state_ >> 16) % (2 * most + 1) - most;
  }
  constexpr void measure(int k) {
    sample.time_us = 100'000U * static_cast<std::uint64_t>(k);
    const bool closed = outputs_.main_plus;
    const std::int32_t ramp = (k % 200 < 100 ? k % 100 : 100 - k % 100) * 400;
    const std::int32_t load_ua = k % 40 < 30 ? -4'000'000 : 2'000'000;
    sample.current_ua = (closed ? load_ua : 0) + chance(30'000);
    if (k > 700 && k < 760) sample.current_ua *= 3;
    std::int32_t sum = 0;
    for (std::size_t c = 0; c < 16; ++c) {
      sample.cell_uv[c] = 3'280'000 + ramp + static_cast<std::int32_t>(c) * 300 + chance(3'000);
      if (k > 300 && k < 340 && c == 3) sample.cell_uv[c] = 3'720'000 + chance(3'000);
      if (k > 550 && k < 560 && c == 8) sample.cell_uv[c] = measurement::no_reading;
      if (k > 900 && c == 12) sample.cell_uv[c] = 1'700'000;
      sum += sample.cell_uv[c] == measurement::no_reading ? 3'300'000 : sample.cell_uv[c];
      estimate.cell_soc_ppb[c] = static_cast<std::int32_t>(c) * 2'000'000;
      estimate.cell_sigma_ppb[c] = 1'000'000;
    }
    sample.pack_uv = sum + chance(60'000);
    for (std::size_t t = 0; t < 4; ++t)
      sample.temperature_cdegc[t] = static_cast<std::int16_t>((k > 400 && k < 500 ? -300 : 2'500) + chance(20));
    estimate.soc_ppb = 700'000'000 + std::min(k, 600) * 500'000;
    estimate.soc_sigma_ppb = 10'000'000;
    estimate.model_charge_ua = 5'000'000;
    estimate.model_discharge_ua = 5'500'000;
    inputs.request = k % 800 < 20 ? Request::none : Request::drive;
    if (closed)
      dc_link_uv_ = sum;
    else if (outputs_.precharge && outputs_.main_minus)
      dc_link_uv_ += (sum - dc_link_uv_) / 5;
    else
      dc_link_uv_ -= dc_link_uv_ / 16;
    // Poles of the DC link as the wiring gives them: at the pack, at 0 V, or floating.
    if (outputs_.main_minus)
      inputs.link_minus_uv = 0;
    else if (outputs_.main_plus || outputs_.precharge)
      inputs.link_minus_uv = sum - dc_link_uv_;
    else
      inputs.link_minus_uv = 1'278'000 - dc_link_uv_ / 5 * 3;
    inputs.link_plus_uv = inputs.link_minus_uv + dc_link_uv_;
  }

  std::uint32_t state_ = 1;
  std::int32_t dc_link_uv_ = 0;
  Outputs outputs_;
};

inline constexpr std::uint32_t expected_scenario_hash = 3454605757U;

inline std::uint32_t scenario_hash(int samples) {
  Scenario s;
  return s.run(samples, [](auto& p, const auto& sample, const auto& estimate, const auto& inputs) -> const Decision& {
    return p.update(sample, estimate, inputs);
  });
}

}  // namespace bms::protection
