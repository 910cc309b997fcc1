// CAN frames in text logs.
//
//   candump           (1436509052.249713) can0 182#0123456789ABCDEF     also "can0  182   [8]  01 23 ..." with a time
//   battery-emulator  (12.345) RX0 1F2 [8] 01 23 45 67 89 AB CD EF
//   asc               0.001234 1  1F2  Rx  d 8 01 23 45 67 89 AB CD EF  Vector ASC; "base dec", relative times
//                    0.001036 CANFD 1 Rx 0c0 Name 1 0 d 32 00 00 ...      the same of CAN FD
//   gvret             1000,000001F2,false,Rx,0,8,01,23,...              SavvyCAN; microseconds
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace bms::files {

struct TextFrame {
  double time_s = 0;
  std::string_view channel;  ///< "can0", "1"; of the line, valid as long as it
  std::uint32_t id = 0;
  bool long_id = false;  ///< 29 bits
  std::size_t length = 0;
  std::array<std::uint8_t, 64> data{};
};

/// Parses the lines of one log; header lines set how the others are read. Any bytes are safe.
class FrameText {
 public:
  /// format: "candump", "battery-emulator", "asc" or "gvret"; empty: found by the first line that is a frame or header.
  explicit FrameText(std::string format = {}) : format_(std::move(format)) {}

  /// Returns true if the line is a data frame.
  bool parse(std::string_view line, TextFrame& frame);
  /// Name of the format; empty as long as no line has shown it.
  const std::string& format() const { return format_; }

 private:
  bool parse_dump(TextFrame& frame);
  bool parse_asc(std::string_view line, TextFrame& frame);
  std::size_t fd_data(std::uint32_t& length) const;
  bool parse_gvret(std::string_view line, TextFrame& frame);

  std::string format_;
  std::vector<std::string_view> words_;
  bool decimal_ = false, relative_ = false;
  double last_s_ = 0;
  std::vector<std::string> columns_;  ///< of gvret
};

}  // namespace bms::files
