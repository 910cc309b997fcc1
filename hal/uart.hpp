// One serial port, 8N1. An interrupt buffers the received bytes; bytes that do not fit are lost and counted.
#pragma once

#include <cstdint>
#include <span>

namespace bms::hal {

/// baud: bits per second.
void uart_start(std::uint32_t baud);

/// Returns when the last byte is in the transmitter.
void uart_write(std::span<const char> bytes);

/// Returns false if no byte is waiting.
bool uart_read(char& byte);

/// Number of lost bytes. On the stm32f4 each overrun of the receiver counts as one, although it may have lost more.
std::uint32_t uart_lost();

}  // namespace bms::hal
