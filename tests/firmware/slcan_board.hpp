// The application image in the emulator, connected like a CAN adapter on a serial line. Numbers and identifiers are
// those of hal/slcan/codec.hpp, hal/sample_frames.hpp and firmware/can/greybox_bms.dbc, written a second time on
// purpose.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "files/temporary_folder.hpp"
#include "images/child_process.hpp"
#include "images/emulator.hpp"

namespace bms::firmware {

/// The answer to one sample.
struct BoardTelemetry {
  unsigned soc = 0, soc_sigma = 0, soc_display = 0, soc_quality = 0;  ///< raw, 0.002 %
  unsigned voltage = 0;                                               ///< mV
  int current = 0, temperature = 0;                                   ///< 20 mA, 0.01 degrees C
  std::int32_t v_rc_uv = 0, voltage_predicted_uv = 0;
  std::uint32_t flags = 0;
  unsigned sample_counter = 0, status_counter = 0, reset_cause = 0;
};

class SlcanBoard {
 public:
  /// arguments: of the program; the first is the file used as data flash. more: options of the emulator.
  explicit SlcanBoard(const std::filesystem::path& application_image, const std::vector<std::string>& arguments = {},
                      const std::vector<std::string>& more = {},
                      const images::EmulatedBoard& board = images::emulated_boards().front());
  ~SlcanBoard();
  SlcanBoard(const SlcanBoard&) = delete;
  SlcanBoard& operator=(const SlcanBoard&) = delete;

  void write(const std::string& bytes) const;
  /// The next answer: a line up to \r (without it), or "\a". Throws std::runtime_error after two minutes of silence: a
  /// limit for what has failed, not for what is slow.
  std::string read();
  /// Reads lines until one begins with `what`, and returns that line.
  std::string read_until(const std::string& what);

  void send_sample(std::uint64_t time_us, std::int32_t current_ua, std::int32_t voltage_uv,
                   std::int16_t temperature_cdegc) const;
  /// The frames up to the status frame that ends a sample.
  BoardTelemetry telemetry();

  /// Waits for the end of the firmware and returns the exit code of the emulator.
  int wait() { return emulator_.wait(); }

 private:
  files::TemporaryFolder folder_;
  images::ChildProcess emulator_;
  int line_ = -1;
  std::string received_;
};

}  // namespace bms::firmware
