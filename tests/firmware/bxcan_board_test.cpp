// smoke
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "hal/sample_frames.hpp"
#include "host_sim/cell_file.hpp"
#include "host_sim/firmware_image.hpp"
#include "tests/firmware/unicorn_board.hpp"

namespace bms {
namespace {
TEST(BxcanBoard, Smoke) {
  UnicornBoard board(firmware_image("stm32f405_forklift", read_cell("table9"), Image::application));
  board.run_for_ms(50);
  fmt::print("on {} irq {} instr {}\n", board.can.on_the_bus(), board.interrupts_taken, board.instructions);
  for (int k = 0; k < 5; ++k) {
    Sample s; s.time_us = 100000ULL * k; s.current_ua = 1000000; s.voltage_uv = 3300000; s.temperature_cdegc = 2500;
    for (auto f : hal::frames_of(s)) board.can.others.push_back({wire_frame(f), 0});
    board.run_for_ms(100);
  }
  for (const auto& s : board.can.seen) fmt::print("{:8} {:8} {} {:x}\n", s.begin_bit, s.end_bit, s.from_board, s.frame.id);
  const auto h = board.can_health();
  fmt::print("state {} sent {} rec {} dropped {} stack {}\n", (int)h.state, h.sent, h.received, h.dropped, board.stack_used());
  for (const auto& v : board.can.violations) fmt::print("{}\n", v);
  board.run_for_ms(3000);
  fmt::print("estimates {} feeds {} instr {} irq {}\n", board.estimates, board.watchdog_feeds, board.instructions, board.interrupts_taken);
}
}  // namespace
}  // namespace bms
