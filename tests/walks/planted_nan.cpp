// Plants a result that is not a number in a program that is not changed: preloaded, it takes the place of functions of
// the mathematics library, which return NaN from the call PLANT_FROM on.
#include <dlfcn.h>

#include <cstdlib>
#include <limits>

namespace {

bool is_planted() {
  static const char* const text = std::getenv("PLANT_FROM");
  static const long from = text == nullptr ? -1 : std::strtol(text, nullptr, 10);
  static thread_local long calls = 0;
  return from >= 0 && ++calls > from;
}

template <class Function>
Function real(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

#define PLANT(type, name)                                                       \
  extern "C" type name(type x) noexcept {                                       \
    static const auto function = real<type (*)(type)>(#name);                   \
    return is_planted() ? std::numeric_limits<type>::quiet_NaN() : function(x); \
  }

PLANT(double, exp)
PLANT(double, expm1)
PLANT(double, log)
PLANT(double, cos)
PLANT(float, expf)
PLANT(float, expm1f)
PLANT(float, logf)
