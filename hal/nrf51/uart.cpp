// UART on P0.24 (TX) and P0.25 (RX), the pins of the micro:bit's USB interface.
#include "hal/uart.hpp"

#include "hal/nrf51/registers.hpp"
#include "hal/received_bytes.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t tx_pin = 24, rx_pin = 25;

ReceivedBytes received_bytes;

}  // namespace

void uart_start(std::uint32_t baud) {
  using namespace nrf51;
  gpio_outset() = 1U << tx_pin;
  gpio_dirset() = 1U << tx_pin;
  uart_pseltxd() = tx_pin;
  uart_pselrxd() = rx_pin;
  uart_baudrate() = (baud * 268 + baud * 435 / 1'000 + 0x800) & 0xFFFFF000U;  // baud * 2^32 / 16 MHz
  uart_enable() = 4;
  uart_rxdrdy() = 0;
  uart_intenset() = 1U << 2;  // a byte received
  cortex_m::nvic_iser0() = 1U << uart_interrupt;
  uart_starttx() = 1;
  uart_startrx() = 1;
}

void uart_write(std::span<const char> bytes) {
  for (const char byte : bytes) {
    nrf51::uart_txdrdy() = 0;
    nrf51::uart_txd() = static_cast<unsigned char>(byte);
    while (nrf51::uart_txdrdy() == 0) {
    }
  }
}

bool uart_read(char& byte) { return received_bytes.pop(byte); }

std::uint32_t uart_lost() { return received_bytes.lost(); }

}  // namespace bms::hal

extern "C" void uart_interrupt() {
  using namespace bms::hal;
  while (nrf51::uart_rxdrdy() != 0) {
    nrf51::uart_rxdrdy() = 0;  // before the byte is taken: the next one sets it again
    received_bytes.push(static_cast<char>(nrf51::uart_rxd()));
  }
}
