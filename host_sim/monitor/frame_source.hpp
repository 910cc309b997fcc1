// Sources of CAN frames behind one interface, which can also send if they are a bus:
//
//   can0, vcan0, ...        SocketCAN: raw socket with kernel time stamps, error frames and the kernel's count of
//                           dropped frames
//   slcan:/dev/ttyACM0      a serial adapter or pseudo-terminal, hal/slcan/codec.hpp: set to 500 kbit/s (S6), opened
//                           (O), closed at the end (C); 921,600 baud if the port has a baud rate. The time of a frame
//                           is the time when it was read. slcan:/dev/ttyACM0,rate=250: 125, 250, 500 or 1,000 kbit/s.
//   file:DUMP.log           candump -L, plain or compressed by gzip; file:- is standard input. Times are those of the
//                           log.
//
// ,base=0x400 and ,stop=0x050 after any of them: the battery's messages and Stop have other identifiers on this bus
// than in firmware/can/greybox_bms.dbc (hal/identifiers.hpp). Frames are read and sent by those of the DBC file.
//
// Memory use is bounded for any input. Malformed lines are counted.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>

#include "monitor/bus_frame.hpp"

namespace bms::monitor {

/// The source does not exist or has the wrong type; what() says what was expected. `line` is 0 if no line applies.
struct SourceError : std::runtime_error {
  SourceError(const std::string& name, std::size_t at, const std::string& what)
      : std::runtime_error(what), source(name), line(at) {}
  std::string source;
  std::size_t line;
};

class FrameSource {
 public:
  virtual ~FrameSource() = default;

  /// Reads available frames into `room` and returns their number. Waits up to wait_ms for the first. Returns 0 after
  /// that time, after a signal, or at the end.
  virtual std::size_t read(std::span<BusFrame> room, int wait_ms) = 0;
  /// Returns true after the last frame: at the end of the file, or when the adapter was unplugged.
  virtual bool ended() const = 0;
  /// Returns true if times are those of this machine's clock, false if they are those of a log.
  virtual bool live() const = 0;

  /// Sends a frame. Returns false if the source cannot send: it is a log, or the bus does not take the frame.
  virtual bool send(const can::Frame&) { return false; }

  std::uint64_t malformed() const { return malformed_; }  ///< lines that are not frames
  std::uint64_t dropped() const { return dropped_; }      ///< frames that the kernel dropped

 protected:
  std::uint64_t malformed_ = 0, dropped_ = 0;
};

/// By the notation above. Throws SourceError.
std::unique_ptr<FrameSource> open_source(const std::string& name);

/// This machine's time since 1970, the clock of SocketCAN's time stamps.
std::int64_t clock_us();

// Each throws SourceError.
std::unique_ptr<FrameSource> open_socketcan(const std::string& interface);
std::unique_ptr<FrameSource> open_slcan(const std::string& device, unsigned kbit_s = 500);
std::unique_ptr<FrameSource> open_dump(const std::string& path);

}  // namespace bms::monitor
