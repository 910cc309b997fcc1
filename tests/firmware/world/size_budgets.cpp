#include "tests/firmware/world/size_budgets.hpp"

#include <stdexcept>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "tests/firmware/elf_image.hpp"
#include "tests/firmware/stack_depth.hpp"
#include "tests/firmware/world/operating.hpp"

namespace bms::world {

namespace {

constexpr double bits_per_second = 250e3, measured_ms = 10'000;

/// Of a standard frame, with the most stuff bits and the intermission (R. I. Davis et al., Real-Time Systems 35 (2007)
/// 239, eq. 2).
constexpr unsigned worst_bits(unsigned bytes) { return 34 + 8 * bytes + 13 + (34 + 8 * bytes - 1) / 4; }

}  // namespace

std::array<double, budget_columns> columns_of(const SizeBudget& b) {
  return {b.period_ms, b.i2c_ms, b.instructions, b.longest_sample_ms, b.frames, b.load_percent,
          b.flash,     b.ram,    b.stack};
}

SizeBudget size_budget_of(std::size_t cells) {
  const Pack pack = pack_of(printed_ah, cells);
  TruckWorld world(pack.image, typical_setup(pack));
  if (const std::string why = bring_to(world, pack, Operating::drive); !why.empty())
    throw std::runtime_error(fmt::format("{} cells: {}", cells, why));
  double samples = 0, frames = 0, bits = 0;
  world.vehicle.on_frame = [&](const can::Frame& frame) {
    samples += frame.id == can::PackState::id ? 1 : 0;
    ++frames;
    bits += worst_bits(frame.length);
  };
  const double before_ms = world.i2c_ms();
  const auto before = static_cast<double>(world.board.instructions);
  world.run_ms(measured_ms);
  if (samples < 1) throw std::runtime_error(fmt::format("{} cells: no samples", cells));
  const firmware::ImageSize size = firmware::size_of(pack.image);
  return {.period_ms = measured_ms / samples,
          .i2c_ms = (world.i2c_ms() - before_ms) / samples,
          .instructions = (static_cast<double>(world.board.instructions) - before) / samples,
          .longest_sample_ms = world.vehicle.longest_sample_ms(),
          .frames = 1e3 * frames / measured_ms,
          .load_percent = 100 * 1e3 * bits / measured_ms / bits_per_second,
          .flash = static_cast<double>(size.text + size.data),
          .ram = static_cast<double>(size.data + size.bss),
          .stack = static_cast<double>(firmware::stack_depth(pack.image).worst())};
}

std::string size_budget_table() {
  std::string table =
      "| pack | a sample every [ms] | I2C per sample [ms] | instructions per sample | longest sample [ms] | frames per "
      "second | load at 250 kbit/s [%] | flash [bytes] | static RAM [bytes] | stack, worst [bytes] |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n";
  for (const std::size_t cells : budget_sizes) {
    const SizeBudget b = size_budget_of(cells);
    table += fmt::format(
        "| {} cells | {:.1f} | {:.1f} | {:.0f} | {:.1f} | {:.0f} | {:.1f} | {:.0f} | {:.0f} | {:.0f} |\n", cells,
        b.period_ms, b.i2c_ms, b.instructions, b.longest_sample_ms, b.frames, b.load_percent, b.flash, b.ram, b.stack);
  }
  return table;
}

}  // namespace bms::world
