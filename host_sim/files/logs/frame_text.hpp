// CAN frames in text logs.
//
//   candump           (1436509052.249713) can0 182#0123456789ABCDEF     also "can0  182   [8]  01 23 ..." with a time
//   battery-emulator  (12.345) RX0 1F2 [8] 01 23 45 67 89 AB CD EF
//   asc               0.001234 1  1F2  Rx  d 8 01 23 45 67 89 AB CD EF  Vector ASC; "base dec", relative times
//                    0.001036 CANFD 1 Rx 0c0 Name 1 0 d 32 00 00 ...      the same of CAN FD
//   gvret             1000,000001F2,false,Rx,0,8,01,23,...              SavvyCAN; microseconds
//   trc               2) 1000.3 Rx 01F2 8 01 23 ...                     PEAK, versions 1.0 to 2.1; milliseconds
//   busmaster         13:33:13:8331 Rx 1 0x1F2 s 8 01 23 ...            all three of its clocks; hexadecimal or decimal
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

inline constexpr std::array frame_formats = {"candump", "battery-emulator", "asc", "gvret", "trc", "busmaster"};

inline constexpr std::uint32_t most_short_id = 0x7FF, most_long_id = 0x1FFF'FFFF;

/// Words of a line between spaces.
void split_words(std::string_view line, std::vector<std::string_view>& words);
/// A whole number in this base, also after "0x"; false for another text.
bool number_in(std::string_view text, int base, std::uint32_t& value);

/// Parses the lines of one log; header lines set how the others are read. Any bytes are safe.
class FrameText {
 public:
  /// format: one of frame_formats; empty: found by the first line that is a frame or header.
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
  void trc_header(std::string_view line);
  bool parse_trc(std::string_view line, TextFrame& frame);
  bool take_trc(char column, std::string_view word, TextFrame& frame, std::uint32_t& length) const;
  bool parse_busmaster(std::string_view line, TextFrame& frame);
  bool take_bytes(std::size_t first, std::size_t length, int base, TextFrame& frame) const;

  std::string format_;
  std::vector<std::string_view> words_;
  bool decimal_ = false, relative_ = false;
  double last_s_ = 0;
  std::vector<std::string> columns_;  ///< of gvret
  std::string trc_columns_;           ///< a letter each, as version 2 names them
  double day_s_ = 0;                  ///< that midnights have added
};

}  // namespace bms::files
