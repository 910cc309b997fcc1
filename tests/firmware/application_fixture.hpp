// Fixtures that run the firmware's application on this machine, with the functions of hal/ from host_hal.hpp.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "firmware/application.hpp"
#include "tests/firmware/host_hal.hpp"

namespace bms::firmware {

using namespace host_hal;

inline bool estimator_hangs_back = false;  ///< the estimator returns without having processed the sample
inline std::uint64_t processed_us = 0;     ///< time of the last processed sample

/// A board whose estimator always returns the same estimate.
template <std::size_t Cells>
struct Board : Table9Board<Cells> {
  static std::uint64_t estimated_us(const estimator::SocEstimator<float>&) { return processed_us; }
  static bms::estimator::Estimate<float> step(estimator::SocEstimator<float>&, const measurement::Sample& sample) {
    if (!estimator_hangs_back) processed_us = sample.time_us;
    bms::estimator::Estimate<float> e;
    e.soc = 0.54321F;
    e.soc_sigma = 0.01F;
    e.v_rc_v = -0.0123456F;
    e.voltage_predicted_v = 3.2999F;
    e.flags = estimator::voltage_stuck;
    return e;
  }
  static const protection::ProtectionPlan& plan() {
    static const auto plan = protection::protection_plan(Table9Board<Cells>::design(1));
    return plan;
  }
};

class TelemetryTest : public ::testing::Test {
 protected:
  void SetUp() override {
    begin();
    estimator_hangs_back = false;
    link_readings = {};
    cause = hal::ResetCause::watchdog;
  }
  void send_command(std::uint32_t code, std::uint32_t argument, std::uint8_t counter) {
    can::Command command;
    command.code = code;
    command.argument = argument;
    requests.push_back(command.frame(counter));
  }
  std::vector<unsigned> ids() const {
    std::vector<unsigned> all;
    for (const can::Frame& f : sent) all.push_back(f.id);
    return all;
  }
  storage::Persistence persistence;
  Application<Board<1>> application{std::nullopt, {0xCE110001, 0x010203}, 6, persistence};
  measurement::Sample sample{};
};

/// Sixteen cells at rest, with contactors and DC link of a simulated truck.
template <class VehicleProfile>
class PackWith : public TelemetryTest {
 protected:
  Application<Board<16>, VehicleProfile> pack{
      std::nullopt, {0xCE110001, 0}, 6, persistence};  // same cell file as `application`
  measurement::PackSample<16> reading{};
  double dc_link_v = 0;

  void SetUp() override {
    TelemetryTest::SetUp();
    set_link(1e-6 * reading.pack_uv, 0);
    cause = hal::ResetCause::power_on;
    for (std::size_t k = 0; k < 16; ++k) reading.cell_uv[k] = 3'280'000 + static_cast<std::int32_t>(k) * 100;
    reading.pack_uv = 16 * 3'280'750;
    reading.current_ua = 0;
    reading.temperature_cdegc = {2'500, 2'510, 2'490, 2'500};
  }
  /// Processes one sample a second later. Each cell voltage changes by 1 uV, so that no reading counts as stuck.
  void second() {
    reading.time_us += 1'000'000;
    for (auto& uv : reading.cell_uv) {
      if (uv != measurement::no_reading) uv += (reading.time_us / 1'000'000) % 2 == 0 ? 1 : -1;
    }
    const double pack_v = 1e-6 * reading.pack_uv;
    const auto& c = switched;
    if (c.main_plus && c.main_minus)
      dc_link_v = pack_v;
    else if (c.precharge && c.main_minus)
      dc_link_v += (pack_v - dc_link_v) * (1 - std::exp(-1 / 0.5));
    else
      dc_link_v *= std::exp(-0.2);
    set_link(pack_v, dc_link_v);
    pack.process_sample(reading);
  }
  bool driving() const { return switched.main_plus && switched.main_minus; }
};

}  // namespace bms::firmware
