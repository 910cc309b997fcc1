// ADC1, one conversion at a time (RM0090, 13): PA1 current, PA2 voltage, PA3 temperature, PC0 and PC1 DC link at main
// minus and main plus, channel 17 the internal reference. Sampling takes 84 cycles of 21 MHz, 4 us, in which a source
// of 50 kohm settles (datasheet DS8626, ADC characteristics, R_AIN). The reference needs 10 us (13.3, t_S_vrefint); 480
// cycles are 23 us.
#include "hal/adc.hpp"

#include "hal/clock.hpp"
#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

namespace {

using namespace stm32f4;

constexpr std::uint32_t converted = 1U << 1, on = 1U << 0, begin = 1U << 30;
/// About 6 cycles each: 36 us at 168 MHz, more at 16 MHz. The longest conversion takes 23.4 us.
constexpr unsigned max_polls = 1'000;
constexpr std::uint64_t stable_us = 10;  ///< until the reference is stable; the converter needs 3 (datasheet, t_STAB)

constexpr std::uint32_t channel(AnalogInput input) {
  switch (input) {
    case AnalogInput::current:
      return 1;
    case AnalogInput::voltage:
      return 2;
    case AnalogInput::temperature:
      return 3;
    case AnalogInput::link_plus:
      return 11;
    case AnalogInput::link_minus:
      return 10;
    case AnalogInput::reference:
      break;
  }
  return 17;
}

}  // namespace

void adc_start() {
  rcc_ahb1enr() = rcc_ahb1enr() | 1U << 0 | 1U << 2;  // GPIOA, GPIOC
  rcc_apb2enr() = rcc_apb2enr() | 1U << 8;            // ADC1
  gpioa_moder() = gpioa_moder() | 0xFCU;              // PA1 to PA3 analog
  gpioc_moder() = gpioc_moder() | 0xFU;               // PC0, PC1 analog
  adc_ccr() = 1U << 16 | 1U << 23;                    // APB2 / 4 = 21 MHz; reference on
  adc1_smpr1() = 7U << 21 | 4U << 3 | 4U << 0;        // channel 17: 480 cycles; 10 and 11: 84
  adc1_smpr2() = 4U << 3 | 4U << 6 | 4U << 9;         // channels 1 to 3: 84 cycles
  adc1_cr1() = 0;                                     // 12 bits
  adc1_cr2() = on;
  const std::uint64_t since_us = now_us();
  while (now_us() - since_us <= stable_us) {
  }
}

std::optional<std::uint16_t> adc_convert(AnalogInput input) {
  adc1_sqr1() = 0;  // one conversion
  adc1_sqr3() = channel(input);
  adc1_sr() = 0;
  adc1_cr2() = on | begin;
  for (unsigned k = 0; k < max_polls; ++k) {
    if ((adc1_sr() & converted) != 0) return static_cast<std::uint16_t>(adc1_dr() & 0xFFFU);
  }
  return std::nullopt;
}

/// VREFINT_CAL (datasheet, internal reference voltage calibration values).
std::uint16_t adc_reference_at_3v3() { return *reinterpret_cast<const volatile std::uint16_t*>(0x1FFF7A2A); }

}  // namespace bms::hal
