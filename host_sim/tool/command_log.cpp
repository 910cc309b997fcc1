// bms log: the data that a battery has stored, read over CAN (host_sim/monitor/stored_data.hpp).
#include <array>
#include <chrono>
#include <memory>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "monitor/bus_state.hpp"
#include "monitor/frame_source.hpp"
#include "monitor/stored_data_request.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

using namespace monitor;

constexpr int wait_ms = 50;

struct LogOptions {
  std::string source;  ///< host_sim/monitor/frame_source.hpp
  std::string out;
  Output output;
};

class LogReader {
 public:
  explicit LogReader(const std::string& name) : name_(name), source_(open_source(name)) {}

  /// Returns false, after one line on standard error, if the data are not complete.
  bool read() {
    const auto progress = progress_on_stderr(0.2, [](double, double, const std::string& what) { return what; });
    while (request_.state() == StoredDataRequest::State::waiting && !source_->ended()) {
      if (source_->live() && !ask()) return false;
      receive();
      if (progress) {
        const double done = 1 - static_cast<double>(data().missing_parts()) / StoredData::parts;
        progress(done, fmt::format("reading the stored data: {:.0f} %", 100 * done));
      }
    }
    if (progress) progress(1, "");
    if (request_.state() == StoredDataRequest::State::complete) return true;
    if (!source_->live() && data().complete_but_for_actions()) return true;
    fmt::print(stderr, "{}: {}\n", name_, failure());
    return false;
  }
  const StoredData& data() const { return request_.data(); }

 private:
  bool ask() {
    const auto command = request_.due(now_s());
    if (!command || source_->send(*command)) return true;
    fmt::print(stderr, "{}: the request cannot be sent; check that the interface is up and not in listen-only mode\n",
               name_);
    return false;
  }
  void receive() {
    const std::size_t n = source_->read(room_, wait_ms);
    for (std::size_t k = 0; k < n; ++k) request_.receive(bus_, bus_.receive(room_[k]), now_s());
  }

  std::string failure() const {
    if (request_.state() == StoredDataRequest::State::unsupported)
      return "the firmware of this battery cannot send its stored data; update the firmware";
    if (request_.state() == StoredDataRequest::State::refused)
      return "the battery refused the request; use the version of this tool that belongs to its firmware";
    if (bus_.frames() == 0)
      return "no frames received; check that the battery is switched on, the wiring and the bit rate";
    if (bus_.accepted() == 0)
      return fmt::format("{} frames received, but no message of the battery; check which bus this is", bus_.frames());
    if (!source_->live() && !request_.answered())
      return "this recording has no stored data; record while bms log reads them";
    if (!request_.answered())
      return "the battery does not answer; its firmware may be too old, or its receiver is disconnected";
    if (source_->live() && source_->ended()) return "has gone away";
    return fmt::format("{} of {} parts of the stored data are missing; check the wiring and try again",
                       data().missing_parts(), StoredData::parts);
  }

  double now_s() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  }

  std::string name_;
  std::unique_ptr<FrameSource> source_;
  BusState bus_;
  StoredDataRequest request_;
  std::array<BusFrame, 256> room_{};
};

class LogCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "log",
        "Read what a battery has stored: fault history with readings, use, extremes, resets, CAN errors, service "
        "sessions");
    c.footer("Example: bms log can0 --out faults.csv");
    c.add_option("source", o_.source,
                 "can0, vcan0: SocketCAN; slcan:/dev/ttyACM0: a serial adapter; file:DUMP.log: a log of candump -L "
                 "that was recorded while the stored data were read")
        ->required();
    c.add_option("--out", o_.out, "write a row for each stored fault, oldest first, as CSV")
        ->check(not_empty())
        ->type_name("FILE");
    add_json(c, o_.output);
    return &c;
  }

  int run() override {
    o_.output.set_own(o_.out);
    try {
      LogReader reader(o_.source);
      if (!reader.read()) return 1;
      if (!o_.out.empty()) write_output(o_.out, csv_of(reader.data()));
      if (!o_.output.json.empty()) write_output(o_.output.json, json_of(reader.data(), o_.source));
      print_summary(o_.output, summary_of(reader.data()));
      return 0;
    } catch (const SourceError& error) {
      throw files::BadInput(error.source, error.line, error.what());
    }
  }

 private:
  LogOptions o_;
};

}  // namespace

std::unique_ptr<Command> log_command() { return std::make_unique<LogCommand>(); }

}  // namespace bms::tool
