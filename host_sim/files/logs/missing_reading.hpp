// What testers and loggers write in place of a reading.
#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <string_view>

namespace bms::files {

/// Returns true for the largest number of single precision, 3.4028e38, which testers write after an overflow.
inline bool is_overflow(double value) {
  constexpr double least = 3.4e38, most = 3.41e38;
  return std::abs(value) >= least && std::abs(value) <= most;
}

/// Returns true for a word that means that there is no reading.
inline bool is_missing_word(std::string_view text) {
  constexpr std::array words = {"none", "unavailable", "unknown", "null", "n/a", "nan"};
  return std::any_of(words.begin(), words.end(), [&](std::string_view word) {
    return word.size() == text.size() && std::equal(word.begin(), word.end(), text.begin(), [](char a, char b) {
             return a == static_cast<char>(std::tolower(static_cast<unsigned char>(b)));
           });
  });
}

}  // namespace bms::files
