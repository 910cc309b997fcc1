// Signals of a CAN log that fill the columns of a recording: which, where from, and what was received.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "files/logs/dbc.hpp"
#include "files/logs/frame_text.hpp"
#include "files/logs/paired_column.hpp"
#include "files/logs/units.hpp"
#include "files/read_options.hpp"
#include "measurement/recording.hpp"

namespace bms::files {

/// Where a message comes from.
struct Sender {
  std::string channel;
  std::uint32_t id = 0;
};

/// A signal and the column that it fills.
struct MappedSignal {
  DbcSignal signal;
  std::vector<DbcSignal> multiplexors;
  Target target;
  Scale scale;
  double value = std::numeric_limits<double>::quiet_NaN();
  std::size_t missing = 0;  ///< values that mean "not available"
  std::optional<Sender> sender;
  PairedColumn column;
};

/// The signal that a line of --map names. Throws BadInput if it is missing or ambiguous.
MappedSignal mapped_signal(const std::string& line, const std::vector<DbcSignal>& dbc, const std::string& dbc_name,
                           const ReadOptions& options);

/// The channels of a log. A message that comes from two of them, or from two sources, is not mixed.
class Senders {
 public:
  /// channel: the only one that is read; empty: any.
  Senders(const std::string& path, const std::string& channel) : path_(path), channel_(channel) {}

  /// Returns true if the frame is of a channel that is read.
  bool is_read(const TextFrame& frame);
  /// Returns false if another channel or source has sent this message before.
  bool is_one(MappedSignal& signal, const TextFrame& frame);
  /// After the last frame: throws BadInput if a message has several senders, or if the channel has no frames.
  void check() const;

 private:
  std::string channels() const;

  const std::string& path_;
  const std::string& channel_;
  std::vector<std::string> channels_;
  std::string several_;  ///< what is sent more than once; empty: nothing
};

/// The columns after the last row. Returns the number of first rows to leave out, because a signal had not been sent.
std::size_t end_columns(std::vector<MappedSignal>& signals, const std::vector<double>& time_s);
/// Throws BadInput if a signal was not sent, or if the current never had a value.
void refuse_absent(const std::vector<MappedSignal>& signals, const std::string& path, const std::string& dbc_name);
/// "; a row has the values from 0.1 s before to 0.044 s after its current": empty if all are in one frame.
std::string delays_text(const std::vector<MappedSignal>& signals, double duration_s);
/// Warns of values that mean "not available", except of cells and sensors that have none at all.
void warn_of_missing(const std::vector<MappedSignal>& signals, measurement::Recording& recording);

}  // namespace bms::files
