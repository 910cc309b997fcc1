// The answer to bad input.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "files/bad_input.hpp"

namespace bms::files {

/// The text with one piece replaced. The piece must be in it.
inline std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

/// The line with which `read` rejects its input; `file`: the name of the input.
template <class Read>
std::string refusal_by(const std::string& file, const Read& read) {
  try {
    read();
  } catch (const BadInput& error) {
    EXPECT_THAT(error.what(), ::testing::MatchesRegex(file + ":[0-9]+: [^\n]+"))
        << "one line, with file and line number";
    return error.what();
  }
  ADD_FAILURE() << "accepted";
  return "";
}

}  // namespace bms::files
