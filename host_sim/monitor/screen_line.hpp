// A line of styled text, and the ways to write such lines.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace bms::monitor {

enum class TextStyle { plain, faint, strong, good, warning, alarm, bar, band };

/// Pieces of text, each with one style. Each character must be printable and one column wide.
class ScreenLine {
 public:
  ScreenLine& add(std::string_view text, TextStyle style = TextStyle::plain);
  /// Adds spaces up to a column.
  ScreenLine& pad_to(std::size_t column);
  ScreenLine& append(const ScreenLine& other);
  /// Removes what is to the right of `columns` columns.
  void cut(std::size_t columns);
  std::size_t columns() const;

  struct Piece {
    std::string text;  ///< UTF-8
    TextStyle style;
  };
  const std::vector<Piece>& pieces() const { return pieces_; }

 private:
  std::vector<Piece> pieces_;
};

/// Text without styles.
std::string plain_text(const std::vector<ScreenLine>& lines);

/// Escape codes for a terminal. They start at the upper left corner, clear the rest of each line and the rows below,
/// and are one synchronised update (mode 2026, which other terminals ignore). Nothing is cleared before it is drawn
/// again, so the screen does not flicker.
std::string ansi_frame(const std::vector<ScreenLine>& lines);

/// Stale values are faint.
inline TextStyle style_of(bool stale, TextStyle fresh = TextStyle::plain) { return stale ? TextStyle::faint : fresh; }

/// Replaces everything but printable ASCII by '?', for text from files and the bus.
std::string printable(std::string_view text);

/// "3.0 s", "4 min", "2 h", or "-" if infinite.
std::string age_text(double age_s);

}  // namespace bms::monitor
