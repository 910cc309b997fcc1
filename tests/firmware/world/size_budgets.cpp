#include "tests/firmware/world/size_budgets.hpp"

#include <filesystem>
#include <functional>
#include <stdexcept>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "tests/firmware/elf_image.hpp"
#include "tests/firmware/stack_depth.hpp"
#include "tests/firmware/world/group_world.hpp"
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

namespace {

/// Of a board that drives, while `run` lets the time pass.
SizeBudget measured(TruckWorld& world, const std::filesystem::path& image, const std::function<void(double)>& run) {
  double samples = 0, frames = 0, bits = 0;
  world.vehicle.on_frame = [&](const can::Frame& frame) {
    samples += frame.id == can::PackState::id ? 1 : 0;
    ++frames;
    bits += worst_bits(frame.length);
  };
  const double before_ms = world.i2c_ms();
  const auto before = static_cast<double>(world.board.instructions);
  run(measured_ms);
  world.vehicle.on_frame = {};
  if (samples < 1) throw std::runtime_error("no samples");
  const firmware::ImageSize size = firmware::size_of(image);
  return {.period_ms = measured_ms / samples,
          .i2c_ms = (world.i2c_ms() - before_ms) / samples,
          .instructions = (static_cast<double>(world.board.instructions) - before) / samples,
          .longest_sample_ms = world.vehicle.longest_sample_ms(),
          .frames = 1e3 * frames / measured_ms,
          .load_percent = 100 * 1e3 * bits / measured_ms / bits_per_second,
          .flash = static_cast<double>(size.text + size.data),
          .ram = static_cast<double>(size.data + size.bss),
          .stack = static_cast<double>(firmware::stack_depth(image).worst())};
}

std::string row_of(const std::string& pack, const SizeBudget& b) {
  return fmt::format("| {} | {:.1f} | {:.1f} | {:.0f} | {:.1f} | {:.0f} | {:.1f} | {:.0f} | {:.0f} | {:.0f} |\n", pack,
                     b.period_ms, b.i2c_ms, b.instructions, b.longest_sample_ms, b.frames, b.load_percent, b.flash,
                     b.ram, b.stack);
}

}  // namespace

SizeBudget size_budget_of(std::size_t cells) {
  const Pack pack = pack_of(printed_ah, cells);
  TruckWorld world(pack.image, typical_setup(pack));
  if (const std::string why = bring_to(world, pack, Operating::drive); !why.empty())
    throw std::runtime_error(fmt::format("{} cells: {}", cells, why));
  return measured(world, pack.image, [&](double ms) { world.run_ms(ms); });
}

SizeBudget size_budget_of_group() {
  const WorldSetup setup = typical_setup(parallel_pack());
  Group group({{setup, 1, 2}, {setup, 2, 2}});
  group.run_ms(2'500);
  group.request(Request::drive);
  if (group.run_until([&] { return group.connected() == 2; }, start_limit_ms) < 0)
    throw std::runtime_error("two batteries do not close");
  return measured(*group.worlds[0], parallel_pack().image, [&](double ms) { group.run_ms(ms); });
}

std::string size_budget_table() {
  std::string table =
      "| pack | a sample every [ms] | I2C per sample [ms] | instructions per sample | longest sample [ms] | frames per "
      "second | load at 250 kbit/s [%] | flash [bytes] | static RAM [bytes] | stack, worst [bytes] |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n";
  for (const std::size_t cells : budget_sizes) table += row_of(fmt::format("{} cells", cells), size_budget_of(cells));
  table += row_of(group_row, size_budget_of_group());
  return table;
}

}  // namespace bms::world
