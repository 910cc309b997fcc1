// How deep an image's stack can get, from its instructions: what each function takes and whom it calls, down to the
// libraries' functions.
//
//   worst = the deepest way from reset + frame of an interrupt + the deepest way from an interrupt's handler + frame of
//   a fault in it
//
// Interrupts have one priority (tests/firmware/unicorn_board.hpp), so at most one is on the stack; the handler of a
// fault begins at the stack's top again. What a function takes is its deepest point, wherever in it the call is: an
// upper bound. Read from the text of arm-none-eabi-objdump, Thumb of ARMv6-M and ARMv7-M. Throws std::runtime_error
// where that does not tell: recursion, a call by pointer from a function that `by_pointer` does not name, a stack
// pointer that is computed.
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
  bool by_pointer = false;           ///< it calls somebody that the text does not tell
};
using Functions = std::map<std::uint32_t, Function>;  ///< by address

/// From the text of objdump --disassemble --demangle.
Functions functions_of(const std::string& disassembly);

struct Depth {
  std::uint32_t bytes = 0;
  std::vector<std::string> way;  ///< from the root to the deepest function
};

/// by_pointer: whom a function means that calls by pointer; both as beginnings of names.
using ByPointer = std::map<std::string, std::vector<std::string>>;
Depth depth_from(const Functions& functions, std::uint32_t root, const ByPointer& by_pointer);

struct StackDepth {
  Depth reset, interrupt;
  std::uint32_t frame =
      0;  ///< bytes that the core stacks (ARMv7-M, B1.5.6): 8 words, 26 with an FPU, and one to align them
  std::uint32_t worst() const { return reset.bytes + interrupt.bytes + 2 * frame; }
};
StackDepth stack_depth(const std::filesystem::path& image);

}  // namespace bms::firmware
