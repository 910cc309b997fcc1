#include "files/logs/frame_log.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/dbc.hpp"
#include "files/logs/frame_signals.hpp"
#include "files/logs/frame_text.hpp"
#include "files/logs/own_frames.hpp"
#include "files/logs/paired_column.hpp"
#include "files/logs/recording_columns.hpp"
#include "files/logs/shipped_dbc.hpp"
#include "files/logs/table_layout.hpp"
#include "files/logs/table_reader.hpp"
#include "files/logs/text_lines.hpp"
#include "measurement/recording_checks.hpp"

namespace bms::files {

namespace {

constexpr std::size_t sniffed_lines = 20;
constexpr double longest_without_voltage_s = 1;

/// The mean of the readings that are there.
struct MeanReading {
  double sum = 0;
  std::size_t rows = 0, readings = 0;

  void add(double value) {
    ++rows;
    if (std::isnan(value)) return;
    sum += value;
    ++readings;
  }
  double mean() const {
    return readings == 0 ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(readings);
  }
};

class FrameLog {
 public:
  FrameLog(std::string path, const ReadOptions& options) : path_(std::move(path)), options_(options) {
    if (!options.steps.empty() || !options.cycles.empty())
      throw BadInput(path_, 1, "a log of CAN frames has no steps and cycles, expected neither --steps nor --cycles");
    std::vector<std::string> mapped = options.map;
    if (options.dbc.empty()) {
      const std::vector<std::string> own =
          own_map_of(path_, is_frame_format(options.format) ? options.format : "", options.channel);
      if (own.empty()) {
        throw BadInput(path_, 1,
                       "a log of CAN frames, expected --dbc with the file that describes them, and --map "
                       "current_a=SIGNAL, --map voltage_v=SIGNAL");
      }
      own_ = true;
      if (mapped.empty()) mapped = own;
      by_samples_ = options.map.empty();
    }
    dbc_name_ = own_ ? own_dbc_name : options.dbc;
    dbc_ = own_ ? own_signals() : signals_of(options.dbc);
    if (mapped.empty()) mapped = shipped_map_of(options.dbc);
    for (const std::string& text : mapped) signals_.push_back(mapped_signal(text, dbc_, dbc_name_, options));
    if (index_of(Quantity::current) == signals_.size())
      throw BadInput("--map", 1, "no signal for current_a, expected --map current_a=SIGNAL with a signal of the DBC");
  }

  measurement::Recording read(std::size_t& bytes) {
    TextLines lines(path_);
    FrameText text(is_frame_format(options_.format) ? options_.format : std::string{});
    std::string_view line;
    TextFrame frame;
    while (lines.next(line)) {
      if (!text.parse(line, frame)) continue;
      if (senders_.is_read(frame)) receive(frame);
    }
    senders_.check();
    bytes = lines.bytes();
    return finish(text.format(), lines.encoding());
  }

  static bool is_frame_format(const std::string& name) {
    return std::find(frame_formats.begin(), frame_formats.end(), name) != frame_formats.end();
  }

 private:
  std::size_t index_of(Quantity quantity) const {
    return static_cast<std::size_t>(std::find_if(signals_.begin(), signals_.end(),
                                                 [&](const MappedSignal& s) { return s.target.quantity == quantity; }) -
                                    signals_.begin());
  }

  void receive(const TextFrame& frame) {
    if (own_ && !is_own_frame(frame)) return;
    const std::span<const std::uint8_t> data(frame.data.data(), frame.length);
    bool current = false;
    for (MappedSignal& m : signals_) {
      if (!is_of(m.signal, frame.id, frame.long_id) || !is_sent(m.signal, m.multiplexors, data)) continue;
      if (!senders_.is_one(m, frame) || is_late(frame.time_s)) return;
      const bool missing = is_missing(m.signal, data);
      m.missing += missing ? 1 : 0;
      m.value = missing ? std::numeric_limits<double>::quiet_NaN() : m.scale(value_of(m.signal, data));
      if (std::abs(m.value) > largest_reading) {
        throw BadInput(path_, 1,
                       fmt::format("{} = {:g} at {:g} s is impossible, expected values from -{:g} to {:g}",
                                   in_quotes(m.signal.name), m.value, frame.time_s, largest_reading, largest_reading));
      }
      if (!by_samples_ || m.target.quantity != Quantity::current) m.column.receive(frame.time_s, m.value);
      current = current || m.target.quantity == Quantity::current;
      voltage_ = voltage_ || m.target.quantity == Quantity::voltage || m.target.quantity == Quantity::cell_voltage;
    }
    if (by_samples_) {
      if (current) mean_current_.add(signals_[index_of(Quantity::current)].value);
      end_sample(frame);
    } else if (current) {
      add_row(frame.time_s);
    }
  }

  /// Of the battery's own frames a row is what belongs to one sample: its voltages, and the mean current since the row
  /// before. Without voltages there is a row a second.
  void end_sample(const TextFrame& frame) {
    if (!ends_a_sample(frame) || mean_current_.rows == 0) return;
    if (!voltage_ && !time_s_.empty() && frame.time_s - time_s_.back() < longest_without_voltage_s) return;
    MappedSignal& current = signals_[index_of(Quantity::current)];
    current.value = mean_current_.mean();
    current.column.receive(frame.time_s, current.value);
    add_row(frame.time_s);
    mean_current_ = {};
    voltage_ = false;
  }

  void add_row(double time_s) {
    if (time_s - first_s(time_s) > longest_s)
      throw BadInput(path_, 1, fmt::format("a time of {:g} s, expected a recording of less than ten years", time_s));
    if (time_s_.size() == measurement::most_rows) {
      throw BadInput(path_, 1,
                     fmt::format("more rows, expected at most {}: split the recording", measurement::most_rows));
    }
    time_s_.push_back(time_s);
    for (MappedSignal& m : signals_) m.column.add_row(time_s, !by_samples_);
  }

  double first_s(double time_s) {
    if (std::isnan(first_s_)) first_s_ = time_s;
    return first_s_;
  }

  /// Returns true if the time is a little before that of an earlier frame: such a frame is left out. Throws if it is
  /// much earlier.
  bool is_late(double time_s) {
    if (time_s >= last_s_) {
      last_s_ = time_s;
      return false;
    }
    if (last_s_ - time_s >= largest_step_back_s) {
      throw BadInput(
          path_, 1,
          fmt::format("time goes back from {:g} s to {:g} s, expected times that do not decrease", last_s_, time_s));
    }
    ++late_;
    return true;
  }

  measurement::Recording finish(const std::string& format, const std::string& encoding) {
    measurement::Recording r;
    r.path = path_;
    r.read_as = format + (encoding.empty() ? "" : ", " + encoding) + " with " + dbc_name_;
    refuse_absent(signals_, path_, dbc_name_);
    if (!options_.channel.empty()) r.read_as += ", channel " + printable(options_.channel);
    for (const MappedSignal& m : signals_) {
      r.read_as += fmt::format("; {} from {}.{} in {}", name_of(m.target), m.signal.message, m.signal.name,
                               m.signal.unit.empty() ? "a unit that is not stated" : m.signal.unit);
    }
    const auto dropped = static_cast<std::ptrdiff_t>(end_columns(signals_, time_s_));
    time_s_.erase(time_s_.begin(), time_s_.begin() + dropped);
    if (time_s_.size() < fewest_rows)
      throw BadInput(path_, 1, fmt::format("{} rows, expected {} or more", time_s_.size(), fewest_rows));
    if (time_s_.back() <= time_s_.front())
      throw BadInput(path_, 1, "all rows have the same time, expected times that increase");
    if (!by_samples_) r.read_as += delays_text(signals_, time_s_.back() - time_s_.front());
    r.time_s = std::move(time_s_);
    for (MappedSignal& m : signals_) {
      std::vector<double>& values = m.column.values();
      values.erase(values.begin(), values.begin() + dropped);
      put_column(r, m.target, std::move(values));
    }
    const bool inverted = options_.sign == CurrentSign::discharge_positive;
    for (double& a : r.current_a.edit()) a = inverted ? -a : a;
    r.read_as += inverted ? "; a discharge is positive, inverted" : "; > 0 charges";
    complete_pack(r, options_);
    if (r.voltage_v.empty())
      throw BadInput("--map", 1, "no signal for voltage_v, expected --map voltage_v=SIGNAL, or v_1, v_2 and so on");
    if (!own_) warn_of_missing(signals_, r);
    if (late_ > 0) {
      r.warnings.push_back({"repair_time_back", fmt::format("frames whose time is a little before that of the frame "
                                                            "above: {}; they are left out",
                                                            late_)});
    }
    return r;
  }

  std::string path_;
  const ReadOptions& options_;
  bool own_ = false;         ///< the battery's own frames
  bool by_samples_ = false;  ///< a row for each of its samples
  bool voltage_ = false;     ///< one was received since the last row
  MeanReading mean_current_;
  std::string dbc_name_;
  std::vector<DbcSignal> dbc_;
  std::vector<MappedSignal> signals_;
  std::vector<double> time_s_;
  std::size_t late_ = 0;
  double last_s_ = -std::numeric_limits<double>::infinity();
  Senders senders_{path_, options_.channel};
  double first_s_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace

std::optional<std::string> frame_format_of(const std::string& path, const ReadOptions& options) {
  if (FrameLog::is_frame_format(options.format)) return options.format;
  if (!options.format.empty()) return std::nullopt;
  TextLines lines(path);
  FrameText text;
  TextFrame frame;
  std::string_view line;
  for (std::size_t k = 0; k < sniffed_lines && text.format().empty() && lines.next(line); ++k) text.parse(line, frame);
  return text.format().empty() ? std::nullopt : std::optional(text.format());
}

measurement::Recording read_frame_log(const std::string& path, const ReadOptions& options, std::size_t& bytes) {
  return FrameLog(path, options).read(bytes);
}

std::vector<std::string> read_map_file(const std::string& path) {
  TextLines lines(path);
  std::vector<std::string> map;
  std::string_view line;
  while (lines.next(line)) {
    const std::string_view content = trimmed(line);
    if (content.empty() || content.front() == '#') continue;
    const std::size_t equals = content.find('=');
    if (equals == std::string_view::npos)
      throw BadInput(path, lines.number(), in_quotes(content) + " has no '=', expected NAME=COLUMN");
    map.push_back(std::string(trimmed(content.substr(0, equals))) + "=" +
                  std::string(trimmed(content.substr(equals + 1))));
  }
  return map;
}

}  // namespace bms::files
