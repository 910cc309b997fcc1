// Worst-case stack depth of an image, from its instructions: the stack of each function and its calls, including
// library functions.
//
//   worst = deepest path from reset + frame of an interrupt + deepest path from a handler of low priority
//           + frame of an interrupt + deepest path from a handler of high priority + frame of a fault in it
//
// On the STM32F405 the handlers of buses and serial lines have a low priority (hal/stm32f4/registers.hpp,
// communication_priority), all others a high one; other chips have one priority. The fault handler and that of the NMI
// start again at the top of the stack. A function counts with its deepest point, wherever the call is: an upper bound.
// Input is the text of arm-none-eabi-objdump (Thumb, ARMv6-M and ARMv7-M). Throws std::runtime_error if the depth
// cannot be determined: recursion, a call by pointer from a function that `by_pointer` does not name, a computed stack
// pointer.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace bms::firmware {

struct Function {
  std::string name;                  ///< demangled
  std::uint32_t stack = 0;           ///< bytes, at its deepest
  std::vector<std::uint32_t> calls;  ///< addresses
  bool by_pointer = false;           ///< it calls a function that the text does not name
};
using Functions = std::map<std::uint32_t, Function>;  ///< by address

/// From the text of objdump --disassemble --demangle.
Functions functions_of(const std::string& disassembly);

struct Depth {
  std::uint32_t bytes = 0;
  std::vector<std::string> path;  ///< from the root to the deepest function
};

/// by_pointer: the callees of each function that calls by pointer. Names are given by their beginnings.
using ByPointer = std::map<std::string, std::vector<std::string>>;
Depth depth_from(const Functions& functions, std::uint32_t root, const ByPointer& by_pointer);

struct StackDepth {
  Depth reset, low_interrupt, interrupt;
  /// Bytes that the core stacks (ARMv7-M, B1.5.6): 8 words, 26 with an FPU, plus one for alignment.
  std::uint32_t frame = 0;
  std::uint32_t worst() const {
    const std::uint32_t nested = low_interrupt.path.empty() ? 0 : frame + low_interrupt.bytes;
    return reset.bytes + nested + interrupt.bytes + 2 * frame;
  }
};
StackDepth stack_depth(const std::filesystem::path& image);

}  // namespace bms::firmware
