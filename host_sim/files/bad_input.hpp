// An error that the user can correct: one line, "FILE:LINE: what is wrong, what was expected". main() prints it and
// ends with exit code 2.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace bms::files {

/// The text without bytes that a terminal obeys: control characters, and those of Unicode from U+0080 to U+009F, are
/// '?'. Names of files may contain them. A line end is replaced as well, unless several lines are allowed.
inline std::string printable(std::string text, bool several_lines = false) {
  for (std::size_t k = 0; k < text.size(); ++k) {
    const auto c = static_cast<unsigned char>(text[k]);
    if ((c < 0x20 && !(several_lines && c == '\n')) || c == 0x7F) text[k] = '?';
    const bool control_in_utf8 = c == 0xC2 && k + 1 < text.size() && static_cast<unsigned char>(text[k + 1]) < 0xA0;
    if (control_in_utf8) text.replace(k, 2, "?");
  }
  return text;
}

class BadInput : public std::runtime_error {
 public:
  BadInput(const std::string& file, std::size_t line, const std::string& what)
      : std::runtime_error(printable(file + ":" + std::to_string(line) + ": " + what)) {}
};

}  // namespace bms::files
