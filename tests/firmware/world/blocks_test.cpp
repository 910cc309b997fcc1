// The emulated core by blocks and by single instructions (unicorn_core.hpp), on the flashed image from reset to
// driving.
#include <algorithm>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unicorn/unicorn.h>

#include "tests/firmware/world/operating.hpp"

namespace bms::world {
namespace {

using firmware::UnicornCore;
using plant::Relay;

/// A second core that repeats every eighth run of blocks by single instructions, from the same registers and memory and
/// with the same answers of the peripherals. It must end in the same state, and read and write the same addresses in
/// the same order, with the same values.
class Twin {
 public:
  static constexpr std::uint64_t one_of = 8;

  explicit Twin(UnicornCore& core) : core_(core) {
    using enum UnicornCore::Access;
    for (const Part& part : parts) {
      if (part.kind == Kind::peripherals)
        twin_.map_registers(part.address, part.bytes);
      else
        twin_.map(part.address, part.bytes, part.kind == Kind::ram ? read_and_write : read_and_execute);
      if (part.kind == Kind::code) copy(part);
    }
    core_.on_read = [this, inner = core_.on_read](std::uint32_t address, unsigned size) {
      const std::uint32_t value = inner(address, size);
      if (core_.in_blocks()) accesses_.push_back({address, value, size, false});
      return value;
    };
    core_.on_write = [this, inner = core_.on_write](std::uint32_t address, std::uint32_t value, unsigned size) {
      if (core_.in_blocks()) accesses_.push_back({address, value, size, true});
      inner(address, value, size);
    };
    core_.before_blocks = [this] { begin(); };
    core_.after_blocks = [this](const UnicornCore::Run& run) { compare(run); };
    twin_.on_read = [this](std::uint32_t address, unsigned size) { return repeat({address, 0, size, false}); };
    twin_.on_write = [this](std::uint32_t address, std::uint32_t value, unsigned size) {
      repeat({address, value, size, true});
    };
  }

  std::uint64_t instructions = 0, accesses = 0, skipped = 0;
  std::vector<std::string> differences;

 private:
  enum class Kind { code, ram, peripherals };
  struct Part {
    std::uint32_t address, bytes;
    Kind kind;
  };
  struct Access {
    std::uint32_t address, value;
    unsigned bytes;
    bool write;
  };
  /// The memory map of UnicornBoard.
  static constexpr Part parts[] = {{0x08000000, 0x4000, Kind::code},         {0x08004000, 0xC000, Kind::peripherals},
                                   {0x08010000, 0xF0000, Kind::code},        {0x1FFF7000, 0x1000, Kind::code},
                                   {0x20000000, 0x20000, Kind::ram},         {0x10000000, 0x10000, Kind::ram},
                                   {0x40000000, 0x30000, Kind::peripherals}, {0x50060000, 0x1000, Kind::peripherals},
                                   {0xE000E000, 0x1000, Kind::peripherals}};

  std::vector<std::uint8_t> content(const UnicornCore& core, const Part& part) const {
    std::vector<std::uint8_t> bytes(part.bytes);
    if (!core.read(part.address, bytes)) throw std::runtime_error("the board has another memory map");
    return bytes;
  }
  void copy(const Part& part) { twin_.write(part.address, content(core_, part)); }

  bool chosen() const { return runs_ % one_of == 0; }

  void begin() {
    ++runs_;
    if (!chosen()) return;
    before_ = core_.registers();
    accesses_.clear();
    repeated_ = 0;
    for (const Part& part : parts) {
      if (part.kind == Kind::ram) copy(part);
    }
  }

  std::uint32_t repeat(const Access& now) {
    if (repeated_ == accesses_.size()) {
      differ(fmt::format("one more access to {:08x}", now.address));
      return 0;
    }
    const Access& then = accesses_[repeated_++];
    if (then.address != now.address || then.bytes != now.bytes || then.write != now.write ||
        (then.write && then.value != now.value))
      differ(fmt::format("access to {:08x} instead of {:08x}", now.address, then.address));
    return then.value;
  }

  /// Single instructions are not counted if their condition in an IT block is false. So the twin may be in the same
  /// state after fewer counts, by at most the number of such instructions. It stops at random places in between.
  void compare(const UnicornCore::Run& run) {
    if (!chosen() || run.instructions == 0) return;
    instructions += run.instructions;
    accesses += accesses_.size();
    twin_.set_registers(before_);
    std::uint64_t left = run.conditional, count = run.instructions - left;
    UnicornCore::Run again{.pc = static_cast<std::uint32_t>(before_[before_.size() - 2])};
    std::string difference;
    for (;; --left, count = 1) {
      for (std::uint64_t part = 0; count > 0; count -= part) {
        part = std::min(count, 1 + random_() % 50);
        again = twin_.run_instructions(again.pc, part);
      }
      difference = difference_to(again, run);
      if (difference.empty() || left == 0 || !differences.empty()) break;
    }
    skipped += left;
    if (!difference.empty()) differ(difference);
  }

  std::string difference_to(const UnicornCore::Run& again, const UnicornCore::Run& run) const {
    if (again.pc != run.pc) return fmt::format("ends at {:08x} instead of {:08x}", again.pc, run.pc);
    if (repeated_ != accesses_.size()) return fmt::format("{} accesses instead of {}", repeated_, accesses_.size());
    if (twin_.registers() != core_.registers()) return "registers";
    for (const Part& part : parts) {
      if (part.kind == Kind::ram && content(core_, part) != content(twin_, part))
        return fmt::format("memory from {:08x}", part.address);
    }
    return "";
  }

  void differ(const std::string& what) {
    if (differences.size() < 20)
      differences.push_back(fmt::format("run {} from {:08x}: {}", runs_, before_[before_.size() - 2], what));
  }

  UnicornCore& core_;
  UnicornCore twin_;
  UnicornCore::Registers before_{};
  std::vector<Access> accesses_;
  std::size_t repeated_ = 0;
  std::uint64_t runs_ = 0;
  std::mt19937_64 random_{1};
};

struct Switched {
  Relay relay;
  bool closes;
  double at_s;
};
/// Main contacts until the truck drives, without bounces.
std::vector<Switched> switched(const TruckWorld& world) {
  std::vector<Switched> all;
  for (const plant::ContactEvent& e : world.truck.events()) {
    if (all.empty() || e.relay != all.back().relay || e.time_s > all.back().at_s + 0.02)
      all.push_back({e.relay, e.closes, e.time_s});
  }
  return all;
}

/// A condition at the border of two pages decided the wrong way there, in one case of 700 of the fault matrix.
TEST(Instructions, AnItBlockAtTheBorderOfTwoPagesMayBeInterruptedAnywhere) {
  constexpr std::uint32_t begin = 0x08000FF6;
  constexpr std::uint8_t code[]{0x00, 0x20,               // movs  r0, #0
                                0x09, 0x21,               // movs  r1, #9
                                0x01, 0x28,               // cmp   r0, #1
                                0xD4, 0xBF,               // ite   le
                                0x4F, 0xF0, 0x00, 0x01,   // movle r1, #0, the last two bytes on the next page
                                0x4F, 0xF0, 0x01, 0x01,   // movgt r1, #1
                                0x00, 0xBF, 0xFE, 0xE7};  // nop, and an endless loop
  UnicornCore core;
  core.map(0x08000000, 0x4000, UnicornCore::Access::read_and_execute);
  ASSERT_TRUE(core.write(begin, code));
  core.find_instructions({{.address = begin, .name = "$t"}, {.address = begin + sizeof code, .name = "$d"}});
  core.run_instructions(begin, 8);  // from now on translated code is used again
  for (std::uint64_t count = 1; count <= 8; ++count) {
    const UnicornCore::Run run = core.run_instructions(begin, count);
    const auto registers = core.registers();
    core.set_reg(UC_ARM_REG_XPSR, 1U << 24);
    core.run_instructions(begin + sizeof code - 2, 3);  // an interrupt
    core.set_registers(registers);
    core.run_instructions(run.pc, 8);
    EXPECT_EQ(core.reg(UC_ARM_REG_R1), 0U) << "interrupted after " << count << " instructions";
  }
}

TEST(Blocks, EndInTheStateOfSingleInstructionsBitForBit) {
  TruckWorld world(pack_of(6).image, typical_setup(pack_of(6)));
  Twin twin(world.board.core());
  EXPECT_EQ(bring_to(world, pack_of(6), Operating::drive), "");
  EXPECT_THAT(twin.differences, ::testing::IsEmpty());
  EXPECT_GT(twin.instructions, 1'500'000U);
  EXPECT_GT(twin.accesses, 50'000U);
  EXPECT_LT(100 * twin.skipped, 2 * twin.instructions) << "share that single instructions do not count";
  RecordProperty("instructions", static_cast<int>(twin.instructions));
  RecordProperty("accesses", static_cast<int>(twin.accesses));
  RecordProperty("skipped", static_cast<int>(twin.skipped));
}

/// The ways differ in the moment within a run in which a register is read, and in what they count. That can be a sample
/// when the sequence of the contactors begins, and another one where it waits for two samples in a row; the frames of
/// these samples are sent in one world only.
TEST(Blocks, SwitchTheContactorsAsSingleInstructionsWithinTwoSamples) {
  TruckWorld by_blocks(pack_of(6).image, typical_setup(pack_of(6)));
  TruckWorld by_instructions(pack_of(6).image, typical_setup(pack_of(6)));
  by_instructions.board.by_instructions = true;
  for (TruckWorld* world : {&by_blocks, &by_instructions})
    EXPECT_EQ(bring_to(*world, pack_of(6), Operating::drive), "");
  const auto one = switched(by_blocks), other = switched(by_instructions);
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    EXPECT_EQ(one[k].relay, other[k].relay) << k;
    EXPECT_EQ(one[k].closes, other[k].closes) << k;
    EXPECT_NEAR(one[k].at_s, other[k].at_s, 0.205) << k;
  }
  for (std::size_t id = 0; id < by_blocks.vehicle.frames.size(); ++id)
    EXPECT_NEAR(by_blocks.vehicle.frames[id], by_instructions.vehicle.frames[id], 2) << id;
  EXPECT_EQ(by_blocks.vehicle.soc_percent(), by_instructions.vehicle.soc_percent());
}

}  // namespace
}  // namespace bms::world
