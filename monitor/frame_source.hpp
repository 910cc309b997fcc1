// Where frames come from, behind one small interface:
//
//   can0, vcan0, ...        SocketCAN: raw socket, kernel time stamps, error frames, the kernel's count of what it had
//   to drop slcan:/dev/ttyACM0      a serial adapter or a pseudo-terminal, by hal/slcan/codec.hpp: set to 500 kbit/s
//   (S6), opened (O), closed at the end (C);
//                           921,600 baud where the line has a rate. Time is when the frame was read.
//   file:DUMP.log           candump -L, maybe compressed by gzip; file:- is standard input. Time is the log's.
//
// Memory is bounded whatever comes. What is no frame is counted.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>

#include "monitor/bus_frame.hpp"

namespace bms::monitor {

/// A source that is not there, or not what it should be; what() says what was expected. Line 0: none.
struct SourceError : std::runtime_error {
  SourceError(const std::string& name, std::size_t at, const std::string& what)
      : std::runtime_error(what), source(name), line(at) {}
  std::string source;
  std::size_t line;
};

class FrameSource {
 public:
  virtual ~FrameSource() = default;

  /// Frames that are there, at most room.size(); waits up to wait_ms for the first. 0: none in that time, a signal
  /// came, or ended().
  virtual std::size_t read(std::span<BusFrame> room, int wait_ms) = 0;
  /// Nothing will come any more: end of file, adapter unplugged.
  virtual bool ended() const = 0;
  /// Whether its time is this machine's clock; otherwise time is what its frames say.
  virtual bool live() const = 0;

  std::uint64_t malformed() const { return malformed_; }  ///< lines that are no frame
  std::uint64_t dropped() const { return dropped_; }      ///< frames that the kernel had no room for

 protected:
  std::uint64_t malformed_ = 0, dropped_ = 0;
};

/// Throws SourceError.
std::unique_ptr<FrameSource> open_source(const std::string& name);

/// Of this machine, as SocketCAN stamps frames.
std::int64_t clock_us();

// One each, for open_source().
std::unique_ptr<FrameSource> open_socketcan(const std::string& interface);
std::unique_ptr<FrameSource> open_slcan(const std::string& device);
std::unique_ptr<FrameSource> open_dump(const std::string& path);

}  // namespace bms::monitor
