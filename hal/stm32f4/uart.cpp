// USART1 on PB6 (TX) and PB7 (RX), alternate function 7 (datasheet, table 9).
#include "hal/uart.hpp"

#include "hal/received_bytes.hpp"
#include "hal/stm32f4/clock_tree.hpp"
#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t overrun = 1U << 3, received = 1U << 5, transmitter_free = 1U << 7;

ReceivedBytes received_bytes;

}  // namespace

void uart_start(std::uint32_t baud) {
  using namespace stm32f4;
  rcc_ahb1enr() = rcc_ahb1enr() | 1U << 1;
  rcc_apb2enr() = rcc_apb2enr() | 1U << 4;
  gpiob_moder() = (gpiob_moder() & ~(15U << 12)) | 10U << 12;
  gpiob_afrl() = (gpiob_afrl() & ~(255U << 24)) | 0x77U << 24;
  usart1_brr() = (clocks().apb2_hz + baud / 2) / baud;
  usart1_cr1() = 1U << 13 | 1U << 5 | 1U << 3 | 1U << 2;  // on, receive interrupt, transmitter, receiver
  nvic_priority(usart1_interrupt) = communication_priority;
  cortex_m::nvic_iser1() = 1U << (usart1_interrupt - 32);
}

void uart_write(std::span<const char> bytes) {
  for (const char byte : bytes) {
    while ((stm32f4::usart1_sr() & transmitter_free) == 0) {
    }
    stm32f4::usart1_dr() = static_cast<unsigned char>(byte);
  }
}

bool uart_read(char& byte) { return received_bytes.pop(byte); }

std::uint32_t uart_lost() { return received_bytes.lost(); }

}  // namespace bms::hal

/// Each of the two flags raises the interrupt until SR and then DR are read. A byte that is complete between these
/// reads sets ORE without RXNE (RM0090, 30.3.3).
extern "C" void usart1_interrupt() {
  using namespace bms::hal;
  std::uint32_t status = stm32f4::usart1_sr();
  while ((status & (received | overrun)) != 0) {
    const auto byte = static_cast<char>(stm32f4::usart1_dr());
    if ((status & received) != 0) received_bytes.push(byte);
    if ((status & overrun) != 0) received_bytes.lose();
    status = stm32f4::usart1_sr();
  }
}
