// Two firmwares on one recording: what each publishes at every sample, and where they differ.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hil/session.hpp"

namespace bms::hil {

struct SentFrame {
  double time_s = 0;
  can::Frame frame;
};

/// A session of one firmware, with all that it has sent.
struct FirmwareRun {
  SessionResult session;
  std::vector<SentFrame> sent;
};

/// As run_session().
FirmwareRun run_firmware(BoardLink& link, const SessionPlan& plan, const std::function<void(double)>& progress);

/// A signal of the DBC file whose value differs between the firmwares. NaN: not published, or invalid.
struct SignalDifference {
  std::string message, signal, unit;
  std::uint64_t samples = 0;            ///< at which it differs
  double first_s = 0, last_s = 0;       ///< first and last of them
  double largest = 0, largest_s = 0;    ///< largest difference of two valid values, and its time
  double before = 0, after = 0;         ///< values at the first difference
  std::string before_text, after_text;  ///< the same, by the names of the DBC file if it has some
};

/// An interval of a fault that the other firmware does not publish, or at other times.
struct FaultDifference {
  std::string name;
  std::optional<FaultEvent> before, after;
};

struct FirstDifference {
  double time_s = 0;
  std::string what;
};

struct FirmwareComparison {
  std::uint64_t samples = 0;      ///< at which the firmwares were compared
  std::uint64_t differences = 0;  ///< samples at which any signal differs
  std::optional<FirstDifference> first;
  std::vector<SignalDifference> signals;  ///< in the order of the DBC file
  std::vector<FaultDifference> faults;    ///< by time
  /// Time for which the current was above the one that the firmware allowed.
  double above_allowed_before_s = 0, above_allowed_after_s = 0;
};

/// Compares all signals but those that say which firmware it is and how much of the processor it needs.
FirmwareComparison compare(const FirmwareRun& before, const FirmwareRun& after);

}  // namespace bms::hil
