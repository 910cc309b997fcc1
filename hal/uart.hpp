// One serial port, 8N1. Received bytes are buffered by interrupt; what nobody reads in time is lost and counted.
#pragma once

#include <cstdint>
#include <span>

namespace bms::hal {

void uart_start(std::uint32_t baud);

/// Returns when the last byte is in the transmitter.
void uart_write(std::span<const char> bytes);

bool uart_read(char& byte);

/// Bytes lost because the buffer was full.
std::uint32_t uart_lost();

}  // namespace bms::hal
