// A battery with boot loader and two slots in QEMU. The test is its cell, its supply and its CAN adapter: a program
// opens `line()` as slcan:DEVICE and talks to the battery, across its restarts.
//
// QEMU cannot write the flash that it executes. So the slots are a file, and each reset of the chip ends the emulator
// and starts it again with that file as its flash. A loss of power kills it.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "files/temporary_folder.hpp"
#include "images/child_process.hpp"
#include "tests/pseudo_terminal.hpp"

namespace bms::boot {

class EmulatedBattery {
 public:
  /// loader: an ELF file with keys. Both slots are erased.
  explicit EmulatedBattery(std::filesystem::path loader);
  ~EmulatedBattery();
  EmulatedBattery(const EmulatedBattery&) = delete;
  EmulatedBattery& operator=(const EmulatedBattery&) = delete;

  const char* line() const { return terminal_.name(); }
  /// Passes frames and time on until `done`; false if it took longer than `s`.
  bool run_until(const std::function<bool()>& done, double s);
  void cut_power();
  unsigned starts() const { return starts_; }
  std::string slot(unsigned which) const;
  void write_slot(unsigned which, const std::string& bytes);
  bool samples = true;                                     ///< the cell is measured
  std::string last_frame_of(const std::string& id) const;  ///< "182" and so on, as SLCAN text; empty: none since start

 private:
  void start(const char* cause);
  void stop();
  void from_board();
  void from_terminal();
  void send_sample();
  void to_board(const std::string& text) const;
  std::filesystem::path slots_file() const { return folder_.path() / "slots"; }

  files::TemporaryFolder folder_;
  std::filesystem::path loader_;
  tests::PseudoTerminal terminal_;
  std::unique_ptr<images::ChildProcess> emulator_;
  int socket_ = -1;
  bool open_ = false;
  unsigned starts_ = 0;
  std::string received_, typed_;
  std::vector<std::string> frames_;
  std::uint64_t sample_us_ = 1'000'000;
  std::chrono::steady_clock::time_point next_sample_{};
};

}  // namespace bms::boot
