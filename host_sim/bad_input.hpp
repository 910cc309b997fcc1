// What a user can correct: one line, "FILE:LINE: what is wrong, what was expected". main() prints it and ends with exit code 2.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace bms {

class BadInput : public std::runtime_error {
 public:
  explicit BadInput(const std::string& line) : std::runtime_error(line) {}
  BadInput(const std::string& file, std::size_t line, const std::string& what) : std::runtime_error(file + ":" + std::to_string(line) + ": " + what) {}
};

}  // namespace bms
