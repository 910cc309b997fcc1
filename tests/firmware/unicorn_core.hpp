// The instructions of an emulated Cortex-M4F: Unicorn with memories and the registers of peripherals. It knows neither
// exceptions nor time; unicorn_board.hpp adds them.
//
// There are two ways to run. By blocks: translated code runs from branch to branch, and a run ends between two blocks.
// By instructions: a run ends after a given number of them, also within a block. This costs several times as much,
// because Unicorn counts by a hook of each instruction. Each way has a Unicorn of its own, because translated code
// contains the hooks that existed when it was translated. Both have the same memories. The registers are copied when
// the way changes.
//
// Both ways lead to the same registers, memory and accesses (Blocks.EndInTheStateOfSingleInstructionsBitForBit). They
// count differently: Unicorn does not count an instruction in an IT block whose condition is false. In the image of the
// forklift board these are 1.5 % of all instructions; on the chip each takes a cycle.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "tests/firmware/elf_image.hpp"

struct uc_struct;

namespace bms::firmware {

class UnicornCore {
 public:
  UnicornCore();
  ~UnicornCore();
  UnicornCore(const UnicornCore&) = delete;
  UnicornCore& operator=(const UnicornCore&) = delete;

  enum class Access { read, read_and_execute, read_and_write, program_and_execute };
  /// Adds a memory of zeros. Address and size are multiples of 4096.
  void map(std::uint32_t address, std::uint32_t bytes, Access access);
  /// Before each store of the core to a memory with program_and_execute.
  std::function<void(std::uint32_t address, std::uint32_t value, unsigned bytes)> on_program;
  /// Call before code runs that the core has stored itself.
  void forget_code(std::uint32_t begin, std::uint32_t end);
  /// The core's accesses to this range call `on_read` and `on_write`.
  void map_registers(std::uint32_t address, std::uint32_t bytes);
  std::function<std::uint32_t(std::uint32_t address, unsigned bytes)> on_read;
  std::function<void(std::uint32_t address, std::uint32_t value, unsigned bytes)> on_write;
  /// Learns where instructions are, from the mapping symbols of the loaded image (AAELF32). Throws std::runtime_error
  /// if the image has no such symbols.
  void find_instructions(const std::vector<Symbol>& symbols);
  /// Calls `on_entry` whenever the function at this address begins.
  void watch_entry(std::uint32_t address);
  std::function<void()> on_entry;
  /// Calls `before_word` before each read of the word at this address.
  void watch_word(std::uint32_t address);
  std::function<void()> before_word;

  /// Reads memory. Returns false if a part of it does not exist.
  bool read(std::uint32_t address, std::span<std::uint8_t> bytes) const;
  /// Writes memory with any access, also code. Returns false if a part of it does not exist.
  bool write(std::uint32_t address, std::span<const std::uint8_t> bytes);
  std::uint32_t half_word(std::uint32_t address) const;  ///< 0 if it does not exist
  std::uint32_t word(std::uint32_t address) const;       ///< 0 if it does not exist
  std::uint32_t reg(int id) const;                       ///< id: of unicorn/arm.h
  void set_reg(int id, std::uint32_t value);
  /// All registers of the core: 16 of the FPU, then the others.
  using Registers = std::array<std::uint64_t, 38>;
  Registers registers() const;
  void set_registers(const Registers& values);

  struct Run {
    int error = 0;                   ///< uc_err
    std::uint32_t pc = 0;            ///< of the next instruction
    std::uint64_t instructions = 0;  ///< that were executed; if counted one by one, those that were ordered
    std::uint64_t conditional = 0;   ///< of them in IT blocks; one by one, only those that have an effect are counted
    bool at_limit = false;           ///< the next block would exceed the limit, or stop() was called
  };
  /// Runs whole blocks of together at most `limit` instructions.
  Run run_blocks(std::uint32_t from, std::uint64_t limit);
  Run run_instructions(std::uint32_t from, std::uint64_t count);
  /// For a comparison of both ways: before and after each run_blocks().
  std::function<void()> before_blocks;
  std::function<void(const Run&)> after_blocks;
  /// Runs a function that returns a structure at the address `result`, and restores the registers.
  void call(std::uint32_t function, std::uint32_t result);

  // within a callback
  bool in_blocks() const { return running_ && active_ == 0; }
  /// Instructions of the blocks that run_blocks() has begun.
  std::uint64_t executed() const { return executed_; }
  /// Lowers the limit of run_blocks().
  void set_limit(std::uint64_t instructions) { limit_ = std::min(limit_, instructions); }
  /// Ends the run at the next possible instruction.
  void stop();

 private:
  struct Memory;
  struct Peripherals {
    UnicornCore* core;
    std::uint32_t address;
  };
  Memory* memory_at(std::uint32_t address, std::size_t bytes) const;
  void use(std::size_t engine);
  void begin_block(std::uint32_t address, std::uint32_t bytes);
  /// Numbers of instructions, and of those in IT blocks.
  std::pair<std::uint32_t, std::uint32_t> instructions_in(std::uint32_t address, std::uint32_t bytes) const;
  std::uint32_t after_what_was_executed(std::uint32_t pc) const;
  Run finish(int error, std::uint64_t instructions);
  uc_struct* engine() const { return engines_[active_]; }

  std::array<uc_struct*, 2> engines_{};  ///< 0: by blocks, 1: by instructions
  std::size_t active_ = 1;
  bool running_ = false, stopped_ = false;
  std::vector<std::unique_ptr<Memory>> memories_;
  std::vector<std::unique_ptr<Peripherals>> peripherals_;
  struct Before {
    std::uint32_t instructions = 0, conditional = 0;
  };
  std::vector<Before> before_;                        ///< what begins before a half-word of the flash
  std::map<std::uint32_t, std::uint32_t> it_blocks_;  ///< first instruction after the IT -> first one after the block
  std::uint32_t entry_ = 0;
  std::uint64_t executed_ = 0, conditional_ = 0, limit_ = 0;
};

}  // namespace bms::firmware
