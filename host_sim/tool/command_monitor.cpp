// bms monitor: the CAN messages of the BMS, shown, logged and served as a page (host_sim/monitor/).
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "monitor/bus_state.hpp"
#include "monitor/candump_line.hpp"
#include "monitor/frame_source.hpp"
#include "monitor/live_page.hpp"
#include "monitor/results.hpp"
#include "monitor/screen.hpp"
#include "monitor/terminal.hpp"
#include "reports/embedded_files.hpp"
#include "reports/report_page.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

using namespace monitor;
using Clock = std::chrono::steady_clock;

constexpr double screen_s = 0.2, page_s = 0.5, line_s = 1, rate_s = 1;  ///< intervals of updates
constexpr std::size_t buffer_bytes = 64 << 10;

struct MonitorOptions {
  std::string source;  ///< host_sim/monitor/frame_source.hpp
  bool once = false;
  std::optional<double> duration_s;  ///< by this computer's clock; for a log without a page by the log's own time
  std::string csv, record;
  std::optional<int> serve_port;  ///< 0: any free port
  Output output;
};

/// A file that is written while the monitor runs, so that a power cut loses at most a second of it. An older file of
/// that name is emptied by the first write(): a source without frames costs nothing.
class GrowingFile {
 public:
  explicit GrowingFile(const std::string& name) : name_(name) {
    if (name.empty()) return;
    is_new_ = name != "-" && access(name.c_str(), F_OK) != 0;
    file_ = name == "-" ? stdout : std::fopen(name.c_str(), "ae");
    if (file_ == nullptr) refuse();
  }
  ~GrowingFile() {
    if (file_ == nullptr || file_ == stdout) return;
    std::fclose(file_);
    if (is_new_ && !written_) unlink(name_.c_str());
  }
  GrowingFile(const GrowingFile&) = delete;
  GrowingFile& operator=(const GrowingFile&) = delete;

  bool is_open() const { return file_ != nullptr; }
  std::string& text() { return text_; }
  /// Writes the text so far; unless `all` is set, only once the buffer is full.
  void write(bool all) {
    if (file_ == nullptr || (!all && text_.size() < buffer_bytes)) return;
    if (!written_ && file_ != stdout && ftruncate(fileno(file_), 0) != 0 && errno != EINVAL)
      refuse();  // not of a device
    written_ = true;
    if (std::fwrite(text_.data(), 1, text_.size(), file_) != text_.size() || std::fflush(file_) != 0) refuse();
    text_.clear();
  }

 private:
  [[noreturn]] void refuse() const {
    throw files::BadInput(name_, 1,
                          fmt::format("cannot be written ({}), expected a place to write to", std::strerror(errno)));
  }
  std::string name_, text_;
  std::FILE* file_ = nullptr;
  bool is_new_ = false, written_ = false;
};

/// A timer that is due once per period. The time is passed in: of this computer or of a log.
class Timer {
 public:
  explicit Timer(double period_s) : period_s_(period_s) {}
  bool due(double now_s) {
    if (begun_ && now_s >= last_s_ && now_s - last_s_ < period_s_) return false;
    last_s_ = now_s;
    begun_ = true;
    return true;
  }

 private:
  double period_s_, last_s_ = 0;
  bool begun_ = false;
};

std::string live_page_html() {
  const std::string body =
      "<style>\n" + std::string(reports::embedded::live_css) + "</style>\n" + std::string(reports::embedded::live_html);
  return reports::page(body, reports::embedded::live_js, "bms monitor", "null", reports::Connections::own_server);
}

std::unique_ptr<LivePage> serve(const std::string& html, int port) {
  return std::make_unique<LivePage>(html, reports::policy_in(html), port);
}

class Monitor {
 public:
  explicit Monitor(const MonitorOptions& options)
      : options_(options),
        source_(open_source(options.source)),
        record_(options.record),
        csv_(options.csv),
        status_(BusState::find("Status")) {
    facts_.source = options.source;
    facts_.blocks = Terminal::shows_utf8();
    csv_.text() += csv_.is_open() ? csv_head() : "";
    shown_ = !options.output.quiet && !options.output.uses_standard_output();
    if (options.serve_port) page_ = serve(live_page_html(), *options.serve_port);
    if (page_) fmt::print(options.output.uses_standard_output() ? stderr : stdout, "Page: {}\n", page_->url());
    std::fflush(stdout);
    if (shown_ && isatty(STDOUT_FILENO)) terminal_ = std::make_unique<Terminal>();
  }

  int run() {
    while (!done()) {
      const std::size_t n = source_->ended() ? 0 : source_->read(room_, wait_ms);
      if (n == 0 && source_->ended()) poll(nullptr, 0, wait_ms);  // only the page is left
      for (std::size_t k = 0; k < n && !satisfied(); ++k) receive(room_[k]);
      show(false);
    }
    finish();
    if (options_.once && !bus_.complete()) {
      fmt::print(stderr, "{}: no complete picture in {:.1f} s and {} frames, {} of them valid frames of the BMS\n",
                 options_.source, bus_.duration_s(), bus_.frames(), bus_.accepted());
      return 1;
    }
    if (source_->live() && source_->ended()) {
      fmt::print(stderr, "{}: has gone away\n", options_.source);
      return 1;
    }
    return 0;
  }

 private:
  static constexpr int wait_ms = 100;

  double elapsed_s() const { return std::chrono::duration<double>(Clock::now() - begin_).count(); }

  bool satisfied() const {
    return (options_.once && bus_.complete()) ||
           (options_.duration_s && !source_->live() && !page_ && bus_.duration_s() >= *options_.duration_s);
  }
  bool done() const {
    if (stop_.requested() || (terminal_ && terminal_->quit_pressed())) return true;
    if (options_.duration_s && source_->live() && elapsed_s() >= *options_.duration_s) return true;
    if (page_ && !source_->live()) return page_done();
    return satisfied() || source_->ended();
  }
  /// The page of a log stays up after the log has been read; --duration then counts this computer's time.
  bool page_done() const {
    return options_.once ? satisfied() || source_->ended() : options_.duration_s && elapsed_s() >= *options_.duration_s;
  }

  void receive(const BusFrame& frame) {
    const std::size_t message = bus_.receive(frame);
    if (record_.is_open()) append_dump_line(record_.text(), frame, "can0");
    if (message == status_) {
      if (csv_.is_open()) csv_.text() += csv_row(bus_);
      if (page_) page_->add(bus_);
    }
    record_.write(false);
    csv_.write(false);
    if (!terminal_ && shown_ && !source_->live() && line_.due(bus_.duration_s())) print_line();
  }

  void show(bool at_end) {
    facts_.malformed = source_->malformed();
    facts_.dropped = source_->dropped();
    const double now_s = elapsed_s();
    if (rate_.due(now_s) || at_end) {
      const double since_s = now_s - rated_s_;
      if (!source_->live())
        facts_.frames_per_second = mean_rate();
      else if (since_s > 0.1)
        facts_.frames_per_second = static_cast<double>(bus_.frames() - rated_) / since_s;
      rated_ = bus_.frames();
      rated_s_ = now_s;
      if (bus_.frames() > 0) {
        record_.write(true);
        csv_.write(true);
      }
    }
    if (page_ && page_timer_.due(now_s)) page_->publish(json_of(as_of_now(), facts_, silent_s()));
    if (terminal_) {
      if (screen_.due(now_s) || stop_.resized())
        terminal_->show(ansi_frame(screen(as_of_now(), facts_, Terminal::size())));
    } else if (shown_ && source_->live() && line_.due(now_s)) {
      print_line();
    }
  }

  /// The state for display, in which ages grow while the bus is silent. Files use the time of the frames alone, so that
  /// a log of the same frames gives the same files.
  BusState as_of_now() const {
    BusState now = bus_;
    if (source_->live() && bus_.frames() > 0) now.advance_time(clock_us());
    return now;
  }
  double silent_s() const {
    const BusState now = as_of_now();
    return 1e-6 * static_cast<double>(now.now_us() - now.last_us());
  }
  double mean_rate() const {
    return bus_.duration_s() > 0 ? static_cast<double>(bus_.frames()) / bus_.duration_s() : 0;
  }

  void print_line() const {
    fmt::print("{}\n", status_line(as_of_now(), facts_));
    std::fflush(stdout);
  }

  void finish() {
    show(true);
    facts_.frames_per_second = mean_rate();
    record_.write(true);
    csv_.write(true);
    if (terminal_) {
      const auto picture = screen(as_of_now(), facts_, Terminal::size());
      terminal_.reset();
      fmt::print("{}", plain_text(picture));  // the last picture stays on the terminal
    }
    if (!options_.output.json.empty()) write_output(options_.output.json, json_of(bus_, facts_, silent_s()));
  }

  const MonitorOptions& options_;
  StopRequest stop_;
  std::unique_ptr<FrameSource> source_;
  GrowingFile record_, csv_;
  BusState bus_;
  ScreenFacts facts_;
  std::size_t status_;
  bool shown_ = false;
  std::unique_ptr<LivePage> page_;
  std::unique_ptr<Terminal> terminal_;
  std::array<BusFrame, 256> room_{};
  Clock::time_point begin_ = Clock::now();
  Timer screen_{screen_s}, page_timer_{page_s}, line_{line_s}, rate_{rate_s};
  std::uint64_t rated_ = 0;
  double rated_s_ = 0;
};

class MonitorCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "monitor", "Show and log the CAN messages of the BMS: a live screen on a terminal, else one line per second");
    c.footer("Example: bms monitor can0 --record monday.log    then: bms monitor file:monday.log --csv monday.csv");
    c.add_option("source", o_.source,
                 "can0, vcan0: SocketCAN; slcan:/dev/ttyACM0: a serial adapter; file:DUMP.log: a log of candump -L, "
                 "also gzip, '-' for standard input")
        ->required();
    c.add_flag("--once", o_.once, "stop after the first complete picture; exit code 1 if it never came");
    c.add_option("--duration", o_.duration_s, "stop after this many seconds")->check(Within(0.01, 1e9))->type_name("S");
    c.add_option("--csv", o_.csv, "write a row with every signal for each Status message, the last message of a sample")
        ->check(not_empty())
        ->type_name("FILE");
    c.add_option("--record", o_.record, "write every frame in the format of candump -L")
        ->check(not_empty())
        ->type_name("FILE");
    serve_ = c.add_option("--serve", o_.serve_port,
                          "serve a page with live plots on 127.0.0.1 at this port, or at any free one; the address is "
                          "printed")
                 ->expected(0, 1)
                 ->check(Within(0, 65'535))
                 ->type_name("PORT");
    add_json(c, o_.output, "no screen, no lines");
    return &c;
  }

  int run() override {
    o_.output.set_own(o_.csv);
    if (serve_->count() > 0 && !o_.serve_port) o_.serve_port = 0;
    constexpr std::string_view file = "file:";
    o_.output.protect({o_.source.starts_with(file) ? o_.source.substr(file.size()) : o_.source}, {o_.record});
    if (o_.record == "-") throw files::BadInput("--record", 1, "standard output is not supported, expected a file");
    try {
      return std::make_unique<Monitor>(o_)->run();
    } catch (const SourceError& error) {
      throw files::BadInput(error.source, error.line, error.what());
    }
  }

 private:
  MonitorOptions o_;
  CLI::Option* serve_ = nullptr;
};

}  // namespace

std::unique_ptr<Command> monitor_command() { return std::make_unique<MonitorCommand>(); }

}  // namespace bms::tool
