// Registers of the STM32F405 that this firmware uses, from ST's RM0090 (section in brackets). Registers of every
// Cortex-M: hal/cortex_m/registers.hpp.
#pragma once

#include "hal/cortex_m/registers.hpp"

namespace bms::hal::stm32f4 {

using namespace cortex_m;

// reset and clock control [7.3]
inline Register& rcc_cr() { return at<0x40023800>(); }
inline Register& rcc_pllcfgr() { return at<0x40023804>(); }
inline Register& rcc_cfgr() { return at<0x40023808>(); }
inline Register& rcc_ahb1enr() { return at<0x40023830>(); }
inline Register& rcc_ahb2enr() { return at<0x40023834>(); }
inline Register& rcc_apb1enr() { return at<0x40023840>(); }
inline Register& rcc_apb2enr() { return at<0x40023844>(); }
inline Register& rcc_bdcr() { return at<0x40023870>(); }
inline Register& rcc_csr() { return at<0x40023874>(); }

// flash interface [3.9.1], power [5.4.1]
inline Register& flash_acr() { return at<0x40023C00>(); }
inline Register& flash_keyr() { return at<0x40023C04>(); }
inline Register& flash_sr() { return at<0x40023C0C>(); }
inline Register& flash_cr() { return at<0x40023C10>(); }
inline Register& flash_optcr() { return at<0x40023C14>(); }
inline Register& pwr_cr() { return at<0x40007000>(); }
inline Register& pwr_csr() { return at<0x40007004>(); }

// random number generator [24.4]
inline Register& rng_cr() { return at<0x50060800>(); }
inline Register& rng_sr() { return at<0x50060804>(); }
inline Register& rng_dr() { return at<0x50060808>(); }

// GPIOA, GPIOB [8.4]
inline Register& gpioa_moder() { return at<0x40020000>(); }
inline Register& gpioa_pupdr() { return at<0x4002000C>(); }
inline Register& gpioa_afrl() { return at<0x40020020>(); }
inline Register& gpiob_moder() { return at<0x40020400>(); }
inline Register& gpiob_pupdr() { return at<0x4002040C>(); }
inline Register& gpiob_afrl() { return at<0x40020420>(); }
inline Register& gpiob_afrh() { return at<0x40020424>(); }
inline Register& gpiob_otyper() { return at<0x40020404>(); }
inline Register& gpiob_idr() { return at<0x40020410>(); }
inline Register& gpiob_bsrr() { return at<0x40020418>(); }

// GPIOC [8.4]
inline Register& gpioc_moder() { return at<0x40020800>(); }
inline Register& gpioc_otyper() { return at<0x40020804>(); }
inline Register& gpioc_pupdr() { return at<0x4002080C>(); }
inline Register& gpioc_idr() { return at<0x40020810>(); }
inline Register& gpioc_odr() { return at<0x40020814>(); }
inline Register& gpioc_bsrr() { return at<0x40020818>(); }

// ADC1 [13.13]
inline Register& adc1_sr() { return at<0x40012000>(); }
inline Register& adc1_cr1() { return at<0x40012004>(); }
inline Register& adc1_cr2() { return at<0x40012008>(); }
inline Register& adc1_smpr1() { return at<0x4001200C>(); }
inline Register& adc1_smpr2() { return at<0x40012010>(); }
inline Register& adc1_sqr1() { return at<0x4001202C>(); }
inline Register& adc1_sqr3() { return at<0x40012034>(); }
inline Register& adc1_dr() { return at<0x4001204C>(); }
inline Register& adc_ccr() { return at<0x40012304>(); }

// timer 3 [18.4]
inline Register& tim3_cr1() { return at<0x40000400>(); }
inline Register& tim3_smcr() { return at<0x40000408>(); }
inline Register& tim3_sr() { return at<0x40000410>(); }
inline Register& tim3_egr() { return at<0x40000414>(); }
inline Register& tim3_ccmr1() { return at<0x40000418>(); }
inline Register& tim3_ccer() { return at<0x40000420>(); }
inline Register& tim3_psc() { return at<0x40000428>(); }
inline Register& tim3_arr() { return at<0x4000042C>(); }
inline Register& tim3_ccr1() { return at<0x40000434>(); }
inline Register& tim3_ccr2() { return at<0x40000438>(); }

// timer 5 [18.4]
inline Register& tim5_cr1() { return at<0x40000C00>(); }
inline Register& tim5_dier() { return at<0x40000C0C>(); }
inline Register& tim5_ccmr2() { return at<0x40000C1C>(); }
inline Register& tim5_ccer() { return at<0x40000C20>(); }
inline Register& tim5_ccr4() { return at<0x40000C40>(); }
inline Register& tim5_or() { return at<0x40000C50>(); }
inline constexpr unsigned tim5_interrupt = 50;

// USART1 [30.6]
inline Register& usart1_sr() { return at<0x40011000>(); }
inline Register& usart1_dr() { return at<0x40011004>(); }
inline Register& usart1_brr() { return at<0x40011008>(); }
inline Register& usart1_cr1() { return at<0x4001100C>(); }
inline constexpr unsigned usart1_interrupt = 37;

// CAN1, CAN2 [32.9]; their registers: can_controller.hpp
inline constexpr unsigned can1_tx_interrupt = 19, can1_rx0_interrupt = 20, can2_tx_interrupt = 63,
                          can2_rx0_interrupt = 64;

// external interrupts [12.3], their ports [9.2]
inline Register& syscfg_exticr2() { return at<0x4001380C>(); }
inline Register& syscfg_exticr3() { return at<0x40013810>(); }
inline Register& syscfg_exticr4() { return at<0x40013814>(); }
inline Register& exti_imr() { return at<0x40013C00>(); }
inline Register& exti_rtsr() { return at<0x40013C08>(); }
inline Register& exti_ftsr() { return at<0x40013C0C>(); }
inline Register& exti_pr() { return at<0x40013C14>(); }
inline constexpr unsigned pvd_interrupt = 1, rtc_wakeup_interrupt = 3, exti4_interrupt = 10, exti9_5_interrupt = 23,
                          exti15_10_interrupt = 40;

// real-time clock [26.6]
inline Register& rtc_tr() { return at<0x40002800>(); }
inline Register& rtc_dr() { return at<0x40002804>(); }
inline Register& rtc_cr() { return at<0x40002808>(); }
inline Register& rtc_isr() { return at<0x4000280C>(); }
inline Register& rtc_prer() { return at<0x40002810>(); }
inline Register& rtc_wutr() { return at<0x40002814>(); }
inline Register& rtc_ssr() { return at<0x40002828>(); }
inline Register& rtc_wpr() { return at<0x40002824>(); }
/// Backup register 0; 19 more follow.
inline Register& rtc_bkp0r() { return at<0x40002850>(); }

// independent watchdog [21.4]
inline Register& iwdg_kr() { return at<0x40003000>(); }
inline Register& iwdg_pr() { return at<0x40003004>(); }
inline Register& iwdg_rlr() { return at<0x40003008>(); }
inline Register& iwdg_sr() { return at<0x4000300C>(); }

/// Priority of an interrupt [ARMv7-M B3.4.9], four bits: 0x00 is the most urgent and that of every interrupt in reset.
inline volatile std::uint8_t& nvic_priority(unsigned interrupt) {
  return reinterpret_cast<volatile std::uint8_t*>(0xE000E400)[interrupt];
}
/// Of the interrupts that serve a bus or a serial line. Supply and clock supervision interrupt their handlers.
inline constexpr std::uint8_t communication_priority = 0x10;

// SysTick [ARMv7-M B3.3]
inline Register& syst_csr() { return at<0xE000E010>(); }
inline Register& syst_rvr() { return at<0xE000E014>(); }
inline Register& syst_cvr() { return at<0xE000E018>(); }

}  // namespace bms::hal::stm32f4
