// A board's firmware image on this machine: Unicorn runs the Cortex-M4F's instructions, and what it lacks is here:
// exception entry and return with the FPU's frame (ARMv7-M, B1.5), faults, the NVIC's enables, SysTick, sleep until an
// interrupt, and of the chip the clock tree, watchdog, reset, bxCAN (bxcan_model.hpp) and the flash interface
// (flash_controller_model.hpp). Interrupts come between instructions, after a seeded random number of them.
//
// Time: an instruction is a core cycle; sleeping costs none, time goes on to the next event; while flash is programmed
// or erased the core stands still. All interrupts have one priority, as the firmware sets them: none interrupts
// another.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "hal/can.hpp"
#include "tests/firmware/bxcan_model.hpp"
#include "tests/firmware/elf_image.hpp"
#include "tests/firmware/flash_controller_model.hpp"
#include "tests/firmware/rtc_model.hpp"

struct uc_struct;

namespace bms::firmware {

class UnicornBoard {
 public:
  explicit UnicornBoard(const std::filesystem::path& image, std::uint32_t seed = 1, bool crystal = true);
  ~UnicornBoard();
  UnicornBoard(const UnicornBoard&) = delete;
  UnicornBoard& operator=(const UnicornBoard&) = delete;

  /// Throws std::runtime_error when the firmware faults, resets or starves the watchdog; or, if it may start again,
  /// only when it does nothing that a chip could do.
  void run_for_ms(double ms);
  /// False when it did not become so in time.
  bool run_until(const std::function<bool()>& becomes, double within_ms);

  double now_ms() const { return static_cast<double>(ticks_) / (ticks_per_second / 1e3); }
  double ms_at_bit(std::uint64_t bit) const { return 1e3 * static_cast<double>(bit) / can.bits_per_second; }
  hal::CanHealth can_health();
  std::uint32_t register_value(std::uint32_t address) const;
  /// Bytes of stack that were ever written.
  std::uint32_t stack_used() const;

  std::uint32_t reset_flags = 0x0E000000;  ///< RCC_CSR: power on
  /// Faults are taken, and a reset starts the firmware again as on a chip: RAM is as it was, the peripherals are not.
  bool may_start_again = false;
  std::vector<std::uint32_t> resets;  ///< the flags of each

  /// A function, whose name begins so, begins with these instructions from now on, in flash; unpatch(): as it was.
  using Instructions = std::array<std::uint16_t, 2>;
  void patch(const std::string& function, Instructions with);
  void unpatch();
  static constexpr Instructions hangs{0xBF30, 0xE7FD}, returns{0x4770, 0x4770},
      undefined{0xDE00, 0xDE00};  ///< wfi, b to it; bx lr; udf #0
  std::uint32_t address_of(const std::string& function) const;
  void flip_bit(std::uint32_t address, unsigned bit);
  /// A bit of the RAM that does not change.
  void stick(std::uint32_t address, unsigned bit, bool at);

  /// What else answers at the addresses of the chip's peripherals.
  struct Peripheral {
    virtual ~Peripheral() = default;
    virtual std::uint32_t read(std::uint32_t offset, double now_us) = 0;
    virtual void write(std::uint32_t offset, std::uint32_t value, double now_us) = 0;
  };
  std::map<std::uint32_t, Peripheral*> plugged;  ///< by the base of its kilobyte

  RtcModel* rtc = nullptr;  ///< with it the backup domain's control register; outlives a board, as its battery does
  /// PVDO of PWR_CSR, and the interrupt that the detector raises for it.
  void supply(bool low);
  /// Calls a function of the firmware between two of its instructions, as a debugger would; it returns so many words by
  /// address.
  std::vector<std::uint32_t> call(const std::string& function, std::size_t words);

  BxcanModel can;
  FlashControllerModel flash;
  bool receive_interrupt_held = false;  ///< the CAN receive interrupt waits, as behind a long one
  bool program_held = false;            ///< main() does not go on, interrupts are served
  unsigned estimates = 0;               ///< calls of estimator_step()
  unsigned watchdog_feeds = 0;
  double longest_unfed_ms = 0;
  std::uint64_t interrupts_taken = 0, instructions = 0;

 private:
  static constexpr std::uint64_t ticks_per_second =
      336'000'000;  // of 168 and 16 MHz and of bits of 125 to 500 kbit/s a multiple

  void load(const std::filesystem::path& image);
  void slice();
  void sleep();
  void pass(std::uint64_t ticks);
  void deliver_interrupt();
  void enter(std::uint32_t exception);
  void start();
  void start_again(std::uint32_t flags);
  bool take_fault(int error);
  void leave(std::uint32_t exc_return);
  int pending_exception() const;
  std::uint32_t peripheral_read(std::uint32_t address);
  void peripheral_write(std::uint32_t address, std::uint32_t value);
  std::uint32_t core_hz() const;
  std::uint64_t ticks_a_cycle() const { return ticks_per_second / core_hz(); }
  std::uint32_t reg(int id) const;
  void set_reg(int id, std::uint32_t value);
  void execute(std::uint32_t from, std::size_t count);
  void find_it_blocks();
  std::uint32_t behind_it_block(std::uint32_t pc) const;

  uc_struct* core_ = nullptr;
  std::vector<Symbol> symbols_;
  std::map<std::uint32_t, std::uint32_t>
      it_blocks_;  ///< from the first instruction behind the IT to the first behind the block
  std::vector<std::pair<std::uint32_t, Instructions>> patched_;
  std::mt19937 random_;
  bool crystal_, handling_ = false, sleeping_ = false, systick_pending_ = false, supply_low_ = false,
                 supply_pending_ = false;
  std::map<std::uint32_t, std::uint32_t> registers_;
  std::uint32_t systick_csr_ = 0, systick_rvr_ = 0, enabled_ = 0;
  std::uint64_t ticks_ = 0, next_systick_ = 0, next_bit_ = 0, fed_at_ = 0, watchdog_ticks_ = 0;
  std::string ended_;
  std::uint32_t exception_ = 0;
  struct Stuck {
    std::uint32_t address = 0;
    unsigned bit = 0;
    bool at = false;
  } stuck_;
};

}  // namespace bms::firmware
