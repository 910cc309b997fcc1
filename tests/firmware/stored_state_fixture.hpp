// What the tests of the stored state share: the forklift board on this machine, its samples and commands.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "tests/firmware/host_board.hpp"
#include "tests/starting_point.hpp"

namespace bms::firmware {

/// The forklift board on this machine, one sample per second.
class StoredStateTest : public ::testing::Test {
 protected:
  void SetUp() override { host_hal::begin(); }
  void TearDown() override { host_hal::begin(); }

  /// The next sample, a second later: 2 A discharge; the fifth of sixteen cells is 30 mV above the others.
  Input second() {
    ++seconds_;
    Input in;
    in.pack.time_us = 1'000'000ULL * seconds_;
    in.pack.current_ua = -2'000'000 + static_cast<std::int32_t>(10'000 * (seconds_ % 3));
    in.pack.cell_uv.fill(3'240'000 + static_cast<std::int32_t>(500 * (seconds_ % 2)));
    in.pack.cell_uv[4] += 30'000;
    in.pack.pack_uv = 16 * in.pack.cell_uv[0] + 30'000;
    in.pack.temperature_cdegc.fill(2'500);
    return in;
  }
  void run(HostBoard& board, int count) {
    for (int k = 0; k < count; ++k) board.process_sample(second());
  }
  void send_command(HostBoard& board, std::uint32_t code, std::uint32_t argument) {
    can::Command command;
    command.code = code;
    command.argument = argument;
    Input in = second();
    in.command = command.frame(counter_ = can::next(counter_));
    board.process_sample(in);
  }

  const std::vector<std::uint8_t> new_chip =
      std::vector<std::uint8_t>(HostBoard::sectors * HostBoard::sector_bytes, 0xFF);
  const measurement::StartingPoint start = starting_at(0.6, 0.02);

 private:
  unsigned seconds_ = 0;
  std::uint8_t counter_ = 0;
};

}  // namespace bms::firmware
