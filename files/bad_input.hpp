// An error that the user can correct: one line, "FILE:LINE: what is wrong, what was expected". main() prints it and
// ends with exit code 2.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace bms::files {

class BadInput : public std::runtime_error {
 public:
  BadInput(const std::string& file, std::size_t line, const std::string& what)
      : std::runtime_error(in_one_line(file + ":" + std::to_string(line) + ": " + what)) {}

 private:
  /// Names of files may contain control characters.
  static std::string in_one_line(std::string text) {
    for (char& c : text) {
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
    }
    return text;
  }
};

}  // namespace bms::files
