// bms study: the paper's comparison of models, optimisers and experiments, as tables and one page.
#pragma once

#include <string>

#include "tool/output.hpp"

namespace bms::tool {

struct StudyOptions {
  std::string cell = "table9";  ///< OCV, capacity, and where the searches begin
  std::string recordings;       ///< folder with CSV files; empty: the plant
  unsigned long seed = 1;       ///< of the plant's noise
  std::string out;              ///< folder: tables as CSV, study.json, study.html
  Output output;
};

int run(const StudyOptions& options);

}  // namespace bms::tool
