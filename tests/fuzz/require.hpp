// What has to be so whatever the input is.
#pragma once

#include <cstdlib>

inline void require(bool true_of_any_input) {
  if (!true_of_any_input) std::abort();
}
