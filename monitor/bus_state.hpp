// What a CAN bus has told so far: the last value of each signal of can/greybox_bms.dbc and can/j1939_profile.dbc, and
// what was wrong with the frames.
//
// Messages are those of the generated can_messages.hpp and j1939_messages.hpp: one that is added to a DBC file is here
// without further code. A frame of ours counts only if its length is right, and of a protected message its CRC and its
// counter (AUTOSAR end-to-end profile 1, can/codec.hpp):
//
//   wrong_length   not 8 bytes                            crc_errors   CRC does not fit, or a counter of 15, which is
//   none lost           frames that the counter says are missing; a sender that starts anew looks like a gap of up to
//   14 repeated       the same counter again: not taken as new, so that a sender that hangs goes stale
//
// Time is that of the frames; where it goes back by more than a second, a clock was set, and what has been counted goes
// on. A message is stale when its last good frame is older than three cycle times, or 3 s where it has none. Memory is
// fixed, whatever comes: ids that nobody knows go into a table of 64, what finds no place there is counted together.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "can/codec.hpp"
#include "monitor/bus_frame.hpp"

namespace bms::monitor {

/// A signal of the DBC file.
struct SignalInfo {
  const char* name;
  const char* unit;
  const char* comment;
  bool integer;  ///< its values are
  bool raw;      ///< the generated code gives the raw value, for want of bits in a float
  can::SignalLayout layout;
  std::span<const can::ValueName> names;  ///< of values, if they have any
  double factor, offset;                  ///< as the DBC file writes them: 0.002, not the float next to it
  int digits;                             ///< after the point that a step of factor needs
};

struct MessageInfo {
  const char* name;
  std::uint32_t id;
  bool long_id;            ///< 29 bits: of the J1939 profile, which an image may send beside the battery's own messages
  std::uint16_t data_id;   ///< 0: without CRC and counter
  std::uint32_t cycle_us;  ///< 0: not by time
  std::vector<SignalInfo> signals;
  void (*decode)(const can::Frame&, std::span<double> values);
};

/// All of both DBC files, in their order.
const std::vector<MessageInfo>& messages();

struct MessageState {
  std::uint64_t frames = 0;  ///< good ones
  std::uint64_t lost = 0, repeated = 0, crc_errors = 0, wrong_length = 0;
  std::int64_t last_us = 0;  ///< of the last good frame
  double period_us = 0;      ///< smoothed over some eight frames; 0: fewer than two frames
  std::uint8_t counter = 0;
  std::vector<double> values;  ///< NaN: not known

  double rate_hz() const { return period_us > 0 ? 1e6 / period_us : 0; }
};

/// A signal's value as it stands.
struct Reading {
  double value = std::numeric_limits<double>::quiet_NaN();  ///< in the DBC file's unit; NaN: not known, or never said
  double age_s = std::numeric_limits<double>::infinity();
  bool stale = true;
  bool known() const { return value == value; }
};

class BusState {
 public:
  BusState();

  /// The message that it was a good frame of; messages().size(): none.
  std::size_t receive(const BusFrame& frame);
  /// For sources whose time goes on without frames. Never goes back.
  void advance_time(std::int64_t now_us) { now_us_ = now_us > now_us_ ? now_us : now_us_; }

  const std::vector<MessageState>& states() const { return states_; }  ///< as messages()
  double age_s(std::size_t message) const;
  bool stale(std::size_t message) const;
  /// By names of the DBC file; what it does not have is not known.
  Reading reading(std::string_view message, std::string_view signal) const;
  /// Index into messages(); messages().size(): there is none.
  static std::size_t find(std::string_view message);

  struct Unknown {
    std::uint32_t id = 0;
    bool long_id = false;
    std::uint64_t frames = 0;
  };
  std::span<const Unknown> unknown_ids() const { return {unknown_.data(), unknown_count_}; }
  std::uint64_t unknown_frames() const { return unknown_frames_; }
  std::uint64_t unknown_overflow() const { return unknown_without_place_; }

  std::uint64_t frames() const { return frames_; }  ///< of any kind
  std::uint64_t good() const { return good_; }      ///< ours, and right
  std::uint64_t remote() const { return remote_; }
  std::uint64_t fd() const { return fd_; }
  std::uint64_t errors() const { return errors_; }
  std::uint32_t error_classes() const { return error_classes_; }  ///< or-ed, linux/can/error.h
  std::int64_t first_us() const { return first_us_; }
  std::int64_t last_us() const { return last_us_; }  ///< latest frame of any kind
  std::int64_t now_us() const { return now_us_; }
  double duration_s() const { return 1e-6 * static_cast<double>(last_us_ - first_us_); }

  /// All that the BMS tells has been heard once: each message of its own, or those of every sample and as long as the
  /// longest cycle takes, and a fifth.
  bool complete() const;

 private:
  void clock_set_back(std::int64_t to_us);
  std::size_t message_of(const BusFrame& frame) const;
  bool receive_known(std::size_t message, const can::Frame& frame, std::int64_t time_us);
  bool is_intact(const MessageInfo& info, MessageState& state, const can::Frame& frame) const;
  void count_unknown(const BusFrame& frame);

  static constexpr std::uint8_t none = 0xFF;
  std::array<std::uint8_t, 2048> index_of_standard_id_{};
  std::vector<std::size_t> index_of_extended_id_;
  std::vector<MessageState> states_;
  std::array<Unknown, 64> unknown_{};
  std::size_t unknown_count_ = 0;
  std::uint64_t unknown_frames_ = 0, unknown_without_place_ = 0, frames_ = 0, good_ = 0, remote_ = 0, fd_ = 0,
                errors_ = 0;
  std::uint32_t error_classes_ = 0;
  std::int64_t first_us_ = 0, last_us_ = 0, now_us_ = 0;
};

}  // namespace bms::monitor
