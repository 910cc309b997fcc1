// Vector table in which every exception and interrupt without a handler is a fault. A chip builds its own table from
// this one (hal/<chip>/vectors.cpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

extern "C" {

extern std::uint32_t image_stack_top[];  // defined by the linker script

[[noreturn]] void reset_handler();
void fault_handler();

}  // extern "C"

namespace bms::hal::cortex_m {

using Handler = void (*)();
inline constexpr std::size_t core_exceptions = 16, nmi = 2, systick = 15;

template <std::size_t Interrupts>
struct VectorTable {
  std::uint32_t* stack;
  std::array<Handler, core_exceptions - 1 + Interrupts> handlers;

  /// exception: the chip's interrupt k has number 16 + k.
  constexpr void serve(std::size_t exception, Handler handler) { handlers[exception - 1] = handler; }
};

template <std::size_t Interrupts>
constexpr VectorTable<Interrupts> fault_vectors() {
  VectorTable<Interrupts> table{image_stack_top, {}};
  for (Handler& handler : table.handlers) handler = fault_handler;
  table.serve(1, reset_handler);
  return table;
}

}  // namespace bms::hal::cortex_m
