// Calls to the debugger (ARM semihosting, version 2.0): files and exit code of the host under QEMU. Without a debugger
// they cause a processor fault.
#pragma once

#include <cstdint>
#include <span>

namespace bms::hal::semihosting {

enum class Open : std::uint32_t { read = 1, update = 3, write = 5, create = 7 };  // "rb", "r+b", "wb", "w+b"

/// Returns the handle of a file on the host, or -1.
int open(const char* name, Open mode);

/// Returns the number of bytes read; 0 at the end of the file.
std::size_t read(int file, std::span<unsigned char> into);

/// Returns false if not all bytes were written.
bool write(int file, std::span<const unsigned char> bytes);

/// at: offset of the next read or write from the beginning of the file [bytes].
bool seek(int file, std::size_t at);

std::uint32_t seconds_since_1970();

/// Splits the emulator's command line at spaces, in place in `text`, and returns the number of words, at most
/// words.size().
std::size_t arguments(std::span<char> text, std::span<const char*> words);

[[noreturn]] void exit(int code);

}  // namespace bms::hal::semihosting
