// The monitor's picture as lines of text, for a terminal of any size: made anew each time, written by the terminal in
// one piece.
//
// What matters most comes first, what does not fit is left out: state of charge with its two-sigma band, pack, limits,
// health, contactor, faults, cells; then the messages with their rates, ages and errors; on a large terminal each
// signal. From 150 columns on the messages stand beside the pack. Stale values are faint.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "monitor/bus_state.hpp"
#include "monitor/frame_source.hpp"

namespace bms::monitor {

enum class TextStyle { plain, faint, strong, good, warning, alarm, bar, band };

/// One line: pieces of text in an ink each. Only what is printable gets in; every character is one column wide.
class ScreenLine {
 public:
  ScreenLine& add(std::string_view text, TextStyle ink = TextStyle::plain);
  /// Blanks up to a column.
  ScreenLine& to(std::size_t column);
  ScreenLine& append(const ScreenLine& other);
  /// Leaves at most so many columns.
  void cut(std::size_t columns);
  std::size_t columns() const;

  struct Piece {
    std::string text;  ///< UTF-8
    TextStyle ink;
  };
  const std::vector<Piece>& pieces() const { return pieces_; }

 private:
  std::vector<Piece> pieces_;
};

struct ScreenSize {
  std::size_t columns = 80, rows = 24;
};

/// What the picture needs besides the bus.
struct ScreenFacts {
  std::string source;
  std::uint64_t malformed = 0, dropped = 0;
  double frames_per_second = 0;
  bool blocks = true;  ///< the terminal shows UTF-8; otherwise ASCII
};

/// At most size.rows lines of at most size.columns columns.
std::vector<ScreenLine> screen(const BusState& bus, const ScreenFacts& facts, const ScreenSize& size);

/// Without inks.
std::string plain_text(const std::vector<ScreenLine>& lines);

/// For a terminal: from its upper left corner on, each line cleared behind its end, what is below cleared too, the
/// whole as one synchronised update (mode 2026, which terminals that do not know it ignore). Nothing is cleared before
/// it is drawn: no flicker.
std::string ansi_frame(const std::vector<ScreenLine>& lines);

/// One line without inks: for standard output that is no terminal, and for logs.
std::string status_line(const BusState& bus, const ScreenFacts& facts);

}  // namespace bms::monitor
