#include "hal/emulated/semihosting.hpp"

#include <array>
#include <cstring>

#include "hal/power.hpp"

namespace bms::hal::semihosting {

namespace {

enum Operation : std::uint32_t {
  sys_open = 0x01,
  sys_write = 0x05,
  sys_read = 0x06,
  sys_seek = 0x0A,
  sys_time = 0x11,
  sys_get_cmdline = 0x15,
  sys_exit_extended = 0x20
};

std::uint32_t call(Operation operation, const void* parameters) {
  register std::uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = parameters;
  asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

std::uint32_t address(const void* pointer) { return reinterpret_cast<std::uint32_t>(pointer); }

}  // namespace

int open(const char* name, Open mode) {
  const std::array<std::uint32_t, 3> parameters{address(name), static_cast<std::uint32_t>(mode), std::strlen(name)};
  return static_cast<int>(call(sys_open, parameters.data()));
}

std::size_t read(int file, std::span<unsigned char> into) {
  const std::array<std::uint32_t, 3> parameters{static_cast<std::uint32_t>(file), address(into.data()), into.size()};
  const std::uint32_t not_read = call(sys_read, parameters.data());
  return not_read <= into.size() ? into.size() - not_read : 0;
}

bool write(int file, std::span<const unsigned char> bytes) {
  const std::array<std::uint32_t, 3> parameters{static_cast<std::uint32_t>(file), address(bytes.data()), bytes.size()};
  return call(sys_write, parameters.data()) == 0;
}

bool seek(int file, std::size_t at) {
  const std::array<std::uint32_t, 2> parameters{static_cast<std::uint32_t>(file), at};
  return call(sys_seek, parameters.data()) == 0;
}

std::uint32_t seconds_since_1970() { return call(sys_time, nullptr); }

std::size_t arguments(std::span<char> text, std::span<const char*> words) {
  const std::array<std::uint32_t, 2> parameters{address(text.data()), text.size()};
  if (call(sys_get_cmdline, parameters.data()) != 0) return 0;
  text.back() = '\0';
  std::size_t count = 0;
  for (char* at = text.data(); *at != '\0' && count < words.size();) {
    words[count++] = at;
    while (*at != '\0' && *at != ' ') ++at;
    if (*at == ' ') *at++ = '\0';
  }
  return count;
}

void exit(int code) {
  constexpr std::uint32_t application_exit = 0x20026;
  const std::array<std::uint32_t, 2> parameters{application_exit, static_cast<std::uint32_t>(code)};
  call(sys_exit_extended, parameters.data());
  while (true) {
  }
}

}  // namespace bms::hal::semihosting

namespace bms::hal {

void finish(int code) { semihosting::exit(code); }

}  // namespace bms::hal
