// Voltages of the DC link and current of the Hall sensor, from pins as the wiring of boards/stm32f405_forklift gives
// them.
#include "hal/adc/dc_link.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "hal/adc.hpp"
#include "hal/contactor_pins.hpp"
#include "hal/second_current.hpp"

namespace bms {
namespace {

double vdda_v = 3.3, plus_v = 0, minus_v = 0, hall_v = 1.65;
bool outputs_on = false, converts = true;

double divided_v(double pole_v) { return (pole_v / 1e6 + vdda_v / 56e3) / (1 / 1e6 + 2 / 56e3); }

}  // namespace

namespace hal {

void adc_start() {}
std::uint16_t adc_reference_at_3v3() { return 1'502; }
std::optional<std::uint16_t> adc_convert(AnalogInput input) {
  if (!converts) return std::nullopt;
  double pin_v = 1.2104;  // 1,502 counts at 3.3 V
  if (input == AnalogInput::link_plus) pin_v = divided_v(plus_v);
  if (input == AnalogInput::link_minus) pin_v = divided_v(minus_v);
  if (input == AnalogInput::current) pin_v = hall_v;
  return static_cast<std::uint16_t>(std::clamp(std::lround(4'095 * pin_v / vdda_v), 0L, 4'095L));
}
bool contactor_pins_on() { return outputs_on; }

namespace {

TEST(DcLink, IsMeasuredAtBothPolesAtAnySupplyOfTheChip) {
  for (const double supply_v : {3.2, 3.3, 3.37}) {
    vdda_v = supply_v;
    for (const auto& [l_plus_v, l_minus_v] :
         {std::pair{0.0, 0.0}, {52.8, 0.0}, {52.8, 52.8}, {22.3, -30.5}, {1.28, 1.28}, {-40.0, -55.0}, {60.0, 30.0}}) {
      plus_v = l_plus_v;
      minus_v = l_minus_v;
      const LinkVoltages link = link_voltages();
      // A step of the converter is 30 mV at the pole, one of the reference 0.07 %.
      EXPECT_NEAR(1e-6 * link.plus_uv, l_plus_v, 0.03 + 0.001 * std::abs(l_plus_v)) << supply_v;
      EXPECT_NEAR(1e-6 * link.minus_uv, l_minus_v, 0.03 + 0.001 * std::abs(l_minus_v)) << supply_v;
    }
  }
  vdda_v = 3.3;
}

TEST(DcLink, HasNoReadingWithoutTheConverterOrWithAnImpossibleSupply) {
  converts = false;
  EXPECT_EQ(link_voltages().plus_uv, measurement::no_reading);
  EXPECT_EQ(link_voltages().minus_uv, measurement::no_reading);
  EXPECT_EQ(second_current_ua(), measurement::no_reading);
  converts = true;
  for (const double supply_v : {2.39, 3.61}) {
    vdda_v = supply_v;
    EXPECT_EQ(link_voltages().plus_uv, measurement::no_reading) << supply_v;
  }
  vdda_v = 3.3;
  EXPECT_EQ(adc::supply_uv(0, 1'502), 0);
}

/// 2.5 V and 2.5 mV/A at 5 V, divided by 33 / 50; its supply is 2 % low.
double hall_pin_v(double current_a) { return 0.66 * 0.98 * (2.5 + 2.5e-3 * current_a); }

TEST(SecondCurrent, LearnsItsZeroWhileAllOutputsAreOff) {
  hall_v = hall_pin_v(0);
  for (int k = 0; k < 2; ++k) EXPECT_EQ(second_current_ua(), measurement::no_reading) << k;
  EXPECT_NEAR(1e-6 * second_current_ua(), 0, 0.5);
  outputs_on = true;
  for (const double current_a : {-900.0, -350.0, -20.0, 0.0, 35.0, 900.0}) {
    hall_v = hall_pin_v(current_a);
    EXPECT_NEAR(1e-6 * second_current_ua(), current_a, 0.6 + 0.021 * std::abs(current_a)) << "a gain of 2 %";
  }
  outputs_on = false;
  hall_v = hall_pin_v(300);  // no offset: current through a welded contactor
  for (int k = 0; k < 50; ++k) EXPECT_NEAR(1e-6 * second_current_ua(), 300, 8);
  outputs_on = true;
  for (const double rail_v : {3.3, 0.001}) {
    hall_v = rail_v;
    EXPECT_EQ(second_current_ua(), measurement::no_reading) << "without its 5 V or with a broken wire";
  }
}

}  // namespace
}  // namespace hal
}  // namespace bms
