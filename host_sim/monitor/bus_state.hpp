// The state of a CAN bus: the last value of each signal of firmware/can/greybox_bms.dbc and
// firmware/can/j1939_profile.dbc, and the errors of their frames.
//
// The messages are those of the generated can_messages.hpp and j1939_messages.hpp, so a message that is added to a DBC
// file needs no code here. A frame is accepted if its length is right and, for a protected message, its CRC and its
// counter too (AUTOSAR end-to-end profile 1, firmware/can/codec.hpp). Otherwise it is counted:
//
//   wrong_length   the length is not 8 bytes
//   crc_errors     the CRC does not match, or the counter is 15
//   lost           frames that are missing according to the counter; a restart of the sender looks like up to 14
//   repeated       the counter has not changed; the frame is not accepted, so a sender that hangs becomes stale
//
// Time is the time of the frames. If it goes back by more than one second, a clock was set; the counts continue. A
// message is stale if its last accepted frame is older than three cycle times, or 3 s without a cycle time. Memory use
// is constant: a table counts 64 unknown ids, and the frames of all others are counted together.
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

/// A signal of a DBC file.
struct SignalInfo {
  const char* name;
  const char* unit;
  const char* comment;
  bool integer;  ///< its values are integers
  bool raw;      ///< the generated code gives the raw value, because a float has too few bits
  can::SignalLayout layout;
  std::span<const can::ValueName> names;  ///< names of values; may be empty
  double factor, offset;                  ///< decimal values of the DBC file: 0.002, not the nearest float
  int digits;                             ///< decimals that one step of `factor` needs
};

struct MessageInfo {
  const char* name;
  std::uint32_t id;
  bool long_id;            ///< 29 bits: a message of the J1939 profile, which not every image sends
  std::uint16_t data_id;   ///< of the CRC; 0: the message has no CRC and no counter
  std::uint32_t cycle_us;  ///< 0: not cyclic
  std::vector<SignalInfo> signals;
  void (*decode)(const can::Frame&, std::span<double> values);
};

/// The messages of both DBC files, in their order.
const std::vector<MessageInfo>& messages();

struct MessageState {
  std::uint64_t frames = 0;  ///< accepted
  std::uint64_t lost = 0, repeated = 0, crc_errors = 0, wrong_length = 0;
  std::int64_t last_us = 0;  ///< time of the last accepted frame
  double period_us = 0;      ///< smoothed over about eight frames; 0: fewer than two frames
  std::uint8_t counter = 0;
  std::vector<double> values;  ///< as MessageInfo::signals; NaN: invalid

  double rate_hz() const { return period_us > 0 ? 1e6 / period_us : 0; }
};

/// The last value of a signal.
struct Reading {
  double value =
      std::numeric_limits<double>::quiet_NaN();  ///< in the unit of the DBC file; NaN: invalid or never received
  double age_s = std::numeric_limits<double>::infinity();
  bool stale = true;
  bool known() const { return value == value; }
};

class BusState {
 public:
  BusState();

  /// Index of the message if the frame was accepted, else messages().size().
  std::size_t receive(const BusFrame& frame);
  /// For live sources, whose time advances without frames. Earlier times are ignored.
  void advance_time(std::int64_t now_us) { now_us_ = now_us > now_us_ ? now_us : now_us_; }

  const std::vector<MessageState>& states() const { return states_; }  ///< as messages()
  double age_s(std::size_t message) const;
  bool stale(std::size_t message) const;
  /// By the names of the DBC file. A name that it does not contain has no known value.
  Reading reading(std::string_view message, std::string_view signal) const;
  /// Index into messages(); messages().size() if the name does not exist.
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
  std::uint64_t accepted() const { return accepted_; }
  std::uint64_t remote() const { return remote_; }
  std::uint64_t fd() const { return fd_; }
  std::uint64_t errors() const { return errors_; }
  std::uint32_t error_classes() const { return error_classes_; }  ///< combined by OR; linux/can/error.h
  std::int64_t first_us() const { return first_us_; }
  std::int64_t last_us() const { return last_us_; }  ///< time of the last frame of any kind
  std::int64_t now_us() const { return now_us_; }
  double duration_s() const { return 1e-6 * static_cast<double>(last_us_ - first_us_); }

  /// Returns true if each message of the BMS was received once, or the messages of each sample were received and 1.2
  /// times the longest cycle has passed.
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
  std::uint64_t unknown_frames_ = 0, unknown_without_place_ = 0, frames_ = 0, accepted_ = 0, remote_ = 0, fd_ = 0,
                errors_ = 0;
  std::uint32_t error_classes_ = 0;
  std::int64_t first_us_ = 0, last_us_ = 0, now_us_ = 0;
};

}  // namespace bms::monitor
