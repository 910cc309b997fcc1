// What the cross compiler's tools say of an image.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace bms::firmware {

struct Symbol {
  std::uint64_t address = 0, size = 0;
  char kind = ' ';   ///< as nm prints it: T text, D data, B bss, U not defined here...
  std::string name;  ///< demangled
};

/// tools: prefix of the tools, "arm-none-eabi-" or "".
std::vector<Symbol> symbols_of(const std::filesystem::path& image, const std::string& tools = "arm-none-eabi-");

/// The one whose name begins so. Throws std::runtime_error when there is none or more than one.
Symbol symbol_named(const std::vector<Symbol>& symbols, const std::string& begin);

struct ImageSize {
  std::uint64_t text = 0, data = 0, bss = 0;  ///< bytes; text with read-only data, bss with what a reset leaves alone
};
ImageSize size_of(const std::filesystem::path& image);

/// Names in an image that firmware may not have: double arithmetic, heap, exceptions, run-time type information.
std::vector<std::string> forbidden_in(const std::vector<Symbol>& symbols);

}  // namespace bms::firmware
