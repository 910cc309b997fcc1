// Calls to the debugger (ARM semihosting, version 2.0): files and exit of the host under QEMU. Without a debugger they
// fault.
#pragma once

#include <cstdint>
#include <span>

namespace bms::hal::semihosting {

enum class Open : std::uint32_t { read = 1, update = 3, write = 5, create = 7 };  // "rb", "r+b", "wb", "w+b"

/// A file of the host, or -1.
int open(const char* name, Open mode);

/// Bytes read; 0 at the end.
std::size_t read(int file, std::span<unsigned char> into);

/// False when not everything was written.
bool write(int file, std::span<const unsigned char> bytes);

/// The next read or write begins `at` bytes from the beginning.
bool seek(int file, std::size_t at);

std::uint32_t seconds_since_1970();

/// Words of the command line given to the emulator, separated by 0; at most `words` of them.
std::size_t arguments(std::span<char> text, std::span<const char*> words);

[[noreturn]] void exit(int code);

}  // namespace bms::hal::semihosting
