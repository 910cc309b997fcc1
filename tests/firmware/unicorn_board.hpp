// Runs the firmware image of a board on this machine. Unicorn executes the instructions of the Cortex-M4F
// (unicorn_core.hpp). This class adds exception entry and return with the FPU frame (ARMv7-M, B1.5), faults, interrupt
// enables and priorities, SysTick, sleep until an interrupt, reset, and models of the chip: clock tree (rcc_model.hpp),
// watchdog (watchdog_model.hpp), timer 5 (timer_model.hpp), bxCAN (bxcan_model.hpp) and flash interface
// (flash_controller_model.hpp). Interrupts come between instructions, after a seeded random number of them; a more
// urgent one interrupts the handler of another.
//
// The core runs by blocks to the next event, and by instructions behind it, up to the interrupt. An event is a tick of
// SysTick, a capture of timer 5, a change of the bus, a write to a register, and the end of `longest_run_us`.
//
// Time: an instruction takes one core cycle of the clock that the registers give; sleep advances the time to the next
// event; while flash is programmed or erased the core is stopped. A clock tree, watchdog or timer that is used in a way
// that the manual forbids ends the run with std::runtime_error.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "hal/board_state.hpp"
#include "hal/can.hpp"
#include "tests/firmware/bxcan_model.hpp"
#include "tests/firmware/elf_image.hpp"
#include "tests/firmware/flash_controller_model.hpp"
#include "tests/firmware/rcc_model.hpp"
#include "tests/firmware/rtc_model.hpp"
#include "tests/firmware/timer_model.hpp"
#include "tests/firmware/unicorn_core.hpp"
#include "tests/firmware/watchdog_model.hpp"

namespace bms::firmware {

class UnicornBoard {
 public:
  explicit UnicornBoard(const std::filesystem::path& image, std::uint32_t seed = 1, bool crystal = true);
  /// A boot loader and the images of its slots; nothing for an erased slot. Its keys stand in the file of the loader.
  /// Only what the core executes is known by name: symbols are those of the loader.
  UnicornBoard(const std::filesystem::path& loader, const std::vector<std::filesystem::path>& images,
               std::uint32_t seed);
  ~UnicornBoard() = default;
  UnicornBoard(const UnicornBoard&) = delete;
  UnicornBoard& operator=(const UnicornBoard&) = delete;

  /// Throws std::runtime_error if the firmware faults, resets the core or does not feed the watchdog. If it may start
  /// again, throws only for what a chip cannot do.
  void run_for_ms(double ms);
  /// Returns false if the condition did not become true in time.
  bool run_until(const std::function<bool()>& becomes, double within_ms);

  /// For long runs: sleep is passed in steps of up to so many microseconds, which end at SysTick, at a capture of timer
  /// 5 and when the bus changes. Peripherals are asked for interrupts at their ends. 0: a step is a bit of the bus.
  double longest_sleep_us = 0;
  /// Counts each instruction, and a part of a run that ends early as a whole one. Peripherals see the time at its
  /// begin.
  bool by_instructions = false;

  RccModel rcc;
  WatchdogModel watchdog{rcc};
  TimerModel timer;
  double now_ms() const { return static_cast<double>(ticks_) / (ticks_per_second / 1e3); }
  double ms_at_bit(std::uint64_t bit) const { return 1e3 * static_cast<double>(bit) / can.bits_per_second; }
  hal::CanHealth can_health();
  hal::BoardState board_state();
  std::uint32_t register_value(std::uint32_t address) const;
  /// Changes a register that is not part of a model, as a disturbance does.
  void disturb_register(std::uint32_t address, std::uint32_t value) { registers_[address] = value; }
  /// main() waits for an interrupt.
  bool sleeping() const { return sleeping_; }
  /// The exception whose handler runs, 0 for none.
  std::uint32_t exception() const { return active_.empty() ? 0 : active_.back(); }
  /// Reads a word of the memory.
  std::uint32_t word(std::uint32_t address) const { return core_.word(address); }
  /// Bytes of stack that were written at least once.
  std::uint32_t stack_used() const;

  std::uint32_t& reset_flags = rcc.reset_flags;  ///< RCC_CSR
  /// Faults are handled, and a reset starts the firmware again as on a chip: RAM keeps its content, peripherals do not.
  bool may_start_again = false;
  std::vector<std::uint32_t> resets;  ///< reset flags of each reset

  /// Replaces the first instructions of a function in flash. unpatch() restores them. The name is given by its
  /// beginning.
  using Instructions = std::array<std::uint16_t, 2>;
  void patch(const std::string& function, Instructions with);
  void unpatch();
  static constexpr Instructions hangs{0xBF30, 0xE7FD}, returns{0x4770, 0x4770},
      undefined{0xDE00, 0xDE00};  ///< wfi, b to it; bx lr; udf #0
  std::uint32_t address_of(const std::string& function) const;
  void flip_bit(std::uint32_t address, unsigned bit);
  /// Writes bytes into the memory of a slot, and reads them, as a debug probe does.
  void write_flash(std::uint32_t address, std::span<const std::uint8_t> bytes);
  std::vector<std::uint8_t> read_flash(std::uint32_t address, std::size_t bytes) const;
  /// Programs the one-time programmable memory from its beginning: bits become 0 and stay so (RM0090, 3.6.5).
  void write_one_time_memory(std::span<const std::uint8_t> bytes);
  /// Makes a bit of the RAM stuck.
  void stick(std::uint32_t address, unsigned bit, bool at);

  /// A further peripheral of the chip.
  struct Peripheral {
    virtual ~Peripheral() = default;
    virtual std::uint32_t read(std::uint32_t offset, double now_us) = 0;
    virtual void write(std::uint32_t offset, std::uint32_t value, double now_us) = 0;
    /// The number of the requested interrupt (RM0090, table 61), or -1.
    virtual int interrupt(double now_us) {
      static_cast<void>(now_us);
      return -1;
    }
    /// The chip is reset.
    virtual void chip_reset() {}
  };
  std::map<std::uint32_t, Peripheral*> plugged;  ///< by base address, one kilobyte each

  /// Stop mode (RM0090, 5.3.5): only lines of EXTI end it. Peripherals, but for the real-time clock and the watchdog,
  /// have no clock meanwhile.
  bool stopped() const { return stopped_; }
  double stopped_ms() const { return static_cast<double>(stopped_ticks_) / (ticks_per_second / 1e3); }
  unsigned stops = 0;
  std::function<void()> clock_wakes;  ///< the wake-up timer of the real-time clock expires: line 22
  std::function<void()> bus_falls;    ///< CAN RX falls while the bus was idle: the line of its pin
  double longest_stop_us = 5'000;     ///< of a step in stop mode

  RtcModel* rtc = nullptr;  ///< with the control register of the backup domain; outlives a board
  /// Sets PVDO of PWR_CSR and raises the interrupt of the detector.
  void supply(bool low);
  /// Resets the chip, as the brown-out detector does. flags: of RCC_CSR.
  void reset(std::uint32_t flags) { start_again(flags); }
  double stall_us = 0;  ///< the core waits for so long after the instructions that run now; a peripheral sets it
  /// Calls a function of the firmware between two instructions, as a debugger does. The function returns `words` words
  /// through an address.
  std::vector<std::uint32_t> call(const std::string& function, std::size_t words);

  /// For observers of each run.
  UnicornCore& core() { return core_; }

  BxcanModel can;
  FlashControllerModel flash;
  bool receive_interrupt_held = false;  ///< the CAN receive interrupt waits, as after a long interrupt
  bool program_held = false;            ///< main() is stopped, interrupts are handled
  unsigned estimates = 0;               ///< calls of estimator_step()
  const unsigned& watchdog_feeds = watchdog.feeds;
  const double& longest_unfed_ms = watchdog.longest_unfed_ms;
  std::uint64_t interrupts_taken = 0, instructions = 0;

 private:
  static constexpr std::uint64_t ticks_per_second =
      336'000'000;  // a multiple of 168 MHz, 16 MHz and of bit rates of 125 to 500 kbit/s

  void map_memories(bool with_slots);
  void load(const std::filesystem::path& image);
  void lose_power();
  void slice();
  std::uint64_t run_by_instructions();
  std::uint64_t run_by_blocks();
  void pass_instructions(std::uint64_t count);
  std::uint64_t instructions_to_event() const;
  std::uint32_t core_read(std::uint32_t address, unsigned size);
  void core_write(std::uint32_t address, std::uint32_t value, unsigned size);
  void pass(std::uint64_t ticks);
  std::uint64_t sleep_ticks() const;
  void deliver_interrupt();
  void enter(std::uint32_t exception);
  void start();
  void start_again(std::uint32_t flags);
  bool take_fault(int error);
  void leave(std::uint32_t exc_return);
  std::uint32_t pending_exception() const;
  int priority(std::uint32_t exception) const;
  std::uint32_t peripheral_read(std::uint32_t address);
  void peripheral_write(std::uint32_t address, std::uint32_t value, unsigned size);
  bool write_core_register(std::uint32_t offset, std::uint32_t value, unsigned size);
  void refuse_violations() const;
  double now_us() const { return 1e3 * now_ms(); }
  bool core_stopped() const { return core_hz_ < 1; }
  double ticks_a_cycle() const { return core_stopped() ? 0 : ticks_per_second / core_hz_; }
  bool handling() const { return !active_.empty(); }
  std::uint32_t reg(int id) const { return core_.reg(id); }
  void set_reg(int id, std::uint32_t value) { core_.set_reg(id, value); }
  void ended(const UnicornCore::Run& run);
  void begin_stop();
  void watch_lines();

  UnicornCore core_;
  std::vector<Symbol> symbols_;
  std::vector<std::pair<std::uint32_t, Instructions>> patched_;
  std::mt19937 random_;
  bool sleeping_ = false, stopped_ = false, bus_was_busy_ = false, clock_woke_ = false, systick_pending_ = false,
       supply_low_ = false, supply_pending_ = false;
  std::map<std::uint32_t, std::uint32_t> registers_;
  std::uint32_t systick_csr_ = 0, systick_rvr_ = 0;
  std::array<std::uint32_t, 3> enabled_{};          ///< interrupts 0 to 95
  std::array<std::uint8_t, 16 + 96> priorities_{};  ///< by exception number
  std::vector<std::uint32_t> active_;               ///< exceptions that are handled, the most urgent last
  std::uint64_t stopped_ticks_ = 0;
  std::uint64_t ticks_ = 0, next_systick_ = 0, next_bit_ = 0;
  double core_hz_ = 16e6;
  std::uint64_t run_until_ticks_ = 0;
  std::uint64_t passed_ = 0;  ///< instructions of this run whose time has passed
  bool soon_ends_ = false;    ///< this run has written to a register
  std::string ended_;
  struct Stuck {
    std::uint32_t address = 0;
    unsigned bit = 0;
    bool at = false;
  } stuck_;
};

}  // namespace bms::firmware
