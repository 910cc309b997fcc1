// Content of an image; symbols and sizes, read with the tools of the cross compiler.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace bms::firmware {

struct Symbol {
  std::uint64_t address = 0, size = 0;
  char kind = ' ';   ///< as nm prints it: T text, D data, B bss, U undefined ...
  std::string name;  ///< demangled
};

/// What is programmed into flash from an address on.
struct ProgramPart {
  std::uint32_t address = 0;
  std::string bytes;
};
/// Throws std::runtime_error if the file cannot be read.
std::vector<ProgramPart> program_of(const std::filesystem::path& image);

/// tools: prefix of the tools, "arm-none-eabi-" or "".
std::vector<Symbol> symbols_of(const std::filesystem::path& image, const std::string& tools = "arm-none-eabi-");

/// Returns the symbol whose name begins with `begin`. Throws std::runtime_error if not exactly one does.
Symbol symbol_named(const std::vector<Symbol>& symbols, const std::string& begin);

struct ImageSize {
  std::uint64_t text = 0, data = 0, bss = 0;  ///< bytes; text includes constants, bss includes .noinit
};
ImageSize size_of(const std::filesystem::path& image);

/// Names that firmware must not contain: double arithmetic, heap, exceptions, run-time type information.
std::vector<std::string> forbidden_in(const std::vector<Symbol>& symbols);

}  // namespace bms::firmware
