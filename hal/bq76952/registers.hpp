// Addresses of the BQ76952: TI's technical reference manual SLUUBY2B, chapters 12 (commands) and 13 (data memory).
#pragma once

#include <cstddef>
#include <cstdint>

namespace bms::hal::bq76952 {

inline constexpr std::uint8_t i2c_address = 0x08;       // 0x10 with the write bit [9.4]
inline constexpr std::uint16_t device_number = 0x7695;  // [12.2]

// direct commands [12.1], two bytes each
inline constexpr std::uint8_t control_status = 0x00, safety_status_a = 0x03, battery_status = 0x12, first_cell = 0x14,
                              stack_voltage = 0x34, pack_voltage = 0x36, ld_voltage = 0x38, subcommand_low = 0x3E,
                              transfer_buffer = 0x40, buffer_checksum = 0x60, alarm_status = 0x62,
                              alarm_raw_status = 0x64, die_temperature = 0x68, cfetoff_temperature = 0x6A,
                              ts1_temperature = 0x70, ts3_temperature = 0x74, hdq_temperature = 0x76, fet_status = 0x7F;

inline constexpr std::uint16_t in_deep_sleep = 1U << 2;  // of control_status

// bits of battery_status
inline constexpr std::uint16_t in_config_update = 1U << 0, was_reset = 1U << 3, security = 3U << 8, sealed = 3U << 8,
                               failed_permanently = 1U << 12;

// bits of alarm_status, latched until 1 is written [6.5]: all cells were measured again; all inputs were; a protection
// of register A tripped, or one of B or C
inline constexpr std::uint16_t cells_scanned = 1U << 1, all_scanned = 1U << 7, tripped_a = 1U << 14,
                               tripped_bc = 1U << 15;

// bits of Safety Status A: CUV 2, COV 3, OCC 4, OCD1 5, OCD2 6, SCD 7; of C:
inline constexpr std::uint8_t host_watchdog = 1U << 1, short_circuit_latch = 1U << 6, sustained_overcurrent = 1U << 7;

// bits of fet_status: the pins assert a fault
inline constexpr std::uint8_t dchg_asserted = 1U << 4, ddsg_asserted = 1U << 5;

// subcommands [12.2, 12.3]
inline constexpr std::uint16_t get_device_number = 0x0001, get_currents = 0x0075, get_charge = 0x0076,
                               exit_deep_sleep = 0x000E, shutdown = 0x0010, reset = 0x0012, balance_cells = 0x0083,
                               set_config_update = 0x0090, exit_config_update = 0x0092, sleep_disable = 0x009A,
                               recover_short_circuit_latch = 0x009C, swap_comm_mode = 0x29BC;

// content of the transfer buffer
inline constexpr std::size_t buffer_bytes = 32, buffer_overhead = 4;   // the length counts address, checksum and itself
inline constexpr std::size_t cc3_current_at = 20, cc3_counts_at = 28;  // of get_currents: i16 userA, i32 counts [4.6]
inline constexpr std::size_t charge_at = 0, charge_fraction_at = 4,
                             charge_time_at = 8;  // of get_charge: i32 userAh, u32 of 2^32, u32 seconds [4.6]

}  // namespace bms::hal::bq76952
