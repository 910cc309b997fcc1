// SciPy as an independent reference; only the tests use it.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace bms::identification {

/// A python3 with scipy, or an empty text. The second candidate is that of the distribution, next to an installed one.
inline std::string python_with_scipy() {
  for (const std::string python : {"python3", "/usr/bin/python3"}) {
    if (std::system((python + " -c 'import scipy.optimize' > /dev/null 2>&1").c_str()) == 0) return python;
  }
  return "";
}

/// Columns that tests/inference/identification/scipy_linear_reference.py prints; empty where no Python with scipy is
/// installed.
inline std::map<std::string, std::vector<double>> scipy_reference() {
  std::map<std::string, std::vector<double>> columns;
  const std::string python = python_with_scipy();
  if (python.empty()) return columns;
  FILE* pipe =
      popen((python + " " BMS_SOURCE_DIR "/tests/inference/identification/scipy_linear_reference.py").c_str(), "r");
  if (pipe == nullptr) return columns;
  std::string text;
  for (int c; (c = std::fgetc(pipe)) != EOF;) text += static_cast<char>(c);
  EXPECT_EQ(pclose(pipe), 0);
  std::istringstream lines(text);
  for (std::string line, name; std::getline(lines, line);) {
    std::istringstream words(line);
    words >> name;
    for (double v; words >> v;) columns[name].push_back(v);
  }
  return columns;
}

}  // namespace bms::identification
