// Aborts if a condition that must hold for any input does not hold.
#pragma once

#include <cstdlib>

inline void require(bool condition) {
  if (!condition) std::abort();
}
