// The CAN bus of an emulated board in lock step with a program on the host. Frames are records in two of the debugger's
// files, which are named pipes (pipe_format.hpp). Command line: "fw TO_BOARD FROM_BOARD".
//
// The firmware works until it asks for a frame a second time and none is left. Then it sends its frames as a block and
// waits for a block of the host. That block begins with a record of length `tick`, whose data set the board's clock. An
// empty block is one record of length `nothing`. The end of the file closes the channel and ends the program.
// A run is therefore repeatable, and as fast as both sides compute. Exit code 3: the files are missing.
#include <array>
#include <span>

#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/emulated/semihosting.hpp"
#include "hal/pipe_format.hpp"
#include "hal/power.hpp"

namespace bms::hal {

namespace {

using namespace pipe;

constexpr int bad_pipe = 3;

std::array<unsigned char, record_size * most_records> incoming, outgoing;
std::size_t in_count = 0, in_next = 0, out_count = 0;
int in = -1, out = -1;
bool open = false, had_none = false;
std::uint64_t time_us = 0;

bool read_fully(std::span<unsigned char> into) {
  for (std::size_t have = 0; have < into.size();) {
    const std::size_t n = semihosting::read(in, into.subspan(have));
    if (n == 0) return false;
    have += n;
  }
  return true;
}

std::span<unsigned char> record(std::array<unsigned char, record_size * most_records>& of, std::size_t k) {
  return std::span(of).subspan(record_size * k, record_size);
}

void flush() {
  if (out_count == 0) put(record(outgoing, out_count++), {.length = nothing});
  for (std::size_t k = 0; k < out_count; ++k)
    record(outgoing, k)[of_block_at] = static_cast<unsigned char>(out_count - 1 - k);
  if (!semihosting::write(out, std::span(outgoing).first(record_size * out_count))) open = false;
  out_count = 0;
}

/// Waits for a block. Returns false if the file has ended.
bool refill() {
  in_next = in_count = 0;
  do {
    if (!read_fully(record(incoming, in_count))) return open = false;
  } while (record(incoming, in_count++)[of_block_at] != 0 && in_count < most_records);
  return true;
}

}  // namespace

void can_start(const CanSettings&) {
  static std::array<char, 512> text;
  std::array<const char*, 3> words{};
  if (semihosting::arguments(text, words) != words.size()) finish(bad_pipe);
  in = semihosting::open(words[1], semihosting::Open::read);
  out = semihosting::open(words[2], semihosting::Open::write);
  if (in < 0 || out < 0) finish(bad_pipe);
  open = true;
}

bool can_listening() { return open; }

bool can_send(const can::Frame& frame) {
  if (!open || out_count == most_records) return false;
  put(record(outgoing, out_count++), frame);
  return true;
}

bool can_receive(can::Frame& frame) {
  while (open) {
    if (in_next == in_count) {
      had_none = !had_none;
      if (had_none) return false;  // first the firmware does its work without a frame
      flush();
      if (!refill()) finish(0);
    }
    const auto from = record(incoming, in_next++);
    if (from[length_at] == tick) time_us = get_bytes<std::uint64_t>(from, data_at);
    if (from[length_at] > 8 || from[long_id_at] != 0) continue;
    frame = frame_of(from);
    return true;
  }
  return false;
}

CanHealth can_health() { return {.state = open ? CanState::active : CanState::starting}; }

void clock_start() {}
std::uint64_t now_us() { return time_us; }
std::uint32_t core_clock_hz() { return 0; }
void wait_for_interrupt() {}

}  // namespace bms::hal

extern "C" void clock_interrupt() {}  // no timer is running
