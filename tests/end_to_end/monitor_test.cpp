// bms monitor from the outside: logs, a serial adapter (a pseudo-terminal), the terminal it draws on, hostile input,
// files it writes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>
#include <utmp.h>

#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "hal/slcan/codec.hpp"
#include "monitor/candump_line.hpp"
#include "tests/end_to_end/run_tool.hpp"
#include "tests/host_sim/monitor/traffic.hpp"
#include "tests/pseudo_terminal.hpp"

namespace bms {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using tests::PseudoTerminal;

std::string dump_of(int samples) {
  monitor::Traffic traffic(1'000'000'000);
  std::string text;
  for (int k = 0; k < samples; ++k) {
    for (const monitor::BusFrame& frame : traffic.sample()) monitor::append_dump_line(text, frame, "can0");
  }
  return text;
}

class Monitor : public ::testing::Test {
 protected:
  std::string log(const std::string& text) const {
    std::ofstream(folder_.path() / "bus.log", std::ios::binary) << text;
    return "file:" + (folder_.path() / "bus.log").string();
  }
  std::string path(const char* name) const { return (folder_.path() / name).string(); }
  json picture(const std::string& arguments) const {
    const ToolRun run = run_tool("monitor " + arguments + " --json -");
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out, nullptr, false);
  }

  files::TemporaryFolder folder_;
};

TEST_F(Monitor, WritesALogAsOneJsonObject) {
  const json p = picture(log(dump_of(61)));
  EXPECT_EQ(p["command"], "monitor");
  EXPECT_EQ(p["frames"], 488);
  EXPECT_EQ(p["duration_s"], 60.0);
  EXPECT_EQ(p["complete"], true);
  EXPECT_EQ(p["pack"]["soc"], 0.79992);
  EXPECT_EQ(p["pack"]["soc_quality"], "carried by counting");
  EXPECT_EQ(p["pack"]["faults"], nullptr) << "no such message on this bus";
  EXPECT_EQ(p["messages"]["PackState"]["signals"]["Soc"]["value"], 79.992)
      << "a number of the DBC file's step, not of a float";
  EXPECT_EQ(p["messages"]["PackState"]["signals"]["Soc"]["unit"], "%");
  EXPECT_EQ(p["messages"]["Status"]["signals"]["ResetCause"]["words"], "power on");
  EXPECT_FALSE(p["messages"].contains("SensorErrors")) << "never received";
}

TEST_F(Monitor, PrintsALinePerSecondWithoutATerminal) {
  const ToolRun run = run_tool("monitor " + log(dump_of(61)));
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(std::count(run.out.begin(), run.out.end(), '\n'), 61);
  EXPECT_THAT(run.out, Not(HasSubstr("\x1b")));
  EXPECT_THAT(run.out, HasSubstr("0:00:59  79.9"));
  EXPECT_EQ(run_tool("monitor --quiet " + log(dump_of(61))).out, "");
}

TEST_F(Monitor, ReadsALogFromStandardInputAndCompressed) {
  const std::string file = log(dump_of(30));
  json expected = picture(file);
  ASSERT_EQ(std::system(("gzip -c " + path("bus.log") + " > " + path("bus.log.gz")).c_str()), 0);
  json packed = picture("file:" + path("bus.log.gz"));
  json piped = picture("file:- < " + path("bus.log.gz"));
  for (json* p : {&expected, &packed, &piped}) p->erase("source");
  EXPECT_EQ(packed, expected);
  EXPECT_EQ(piped, expected);
}

TEST_F(Monitor, OnceEndsWithTheFirstCompletePictureOrReportsThatItNeverCame) {
  const json p = picture("--once " + log(dump_of(61)));
  EXPECT_EQ(p["complete"], true);
  EXPECT_LT(p["duration_s"].get<double>(), 2.1);
  const ToolRun none = run_tool("monitor --quiet --once " + log(dump_of(1)));
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("no complete picture in 0.0 s and 8 frames"));
}

TEST_F(Monitor, CsvIsARowForEachStatusMessageThatReplayReads) {
  const ToolRun run = run_tool("monitor --quiet --csv " + path("rows.csv") + " " + log(dump_of(100)));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string csv = content(path("rows.csv"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 101);
  const ToolRun replay = run_tool("replay " + path("rows.csv") + " --json -");
  ASSERT_EQ(replay.exit_code, 0) << replay.err;
  EXPECT_EQ(json::parse(replay.out)["samples"], 100);
}

/// The battery's own log is the easiest input.
TEST_F(Monitor, ALogIsImportedWithoutOptions) {
  log(dump_of(100));
  const ToolRun run = run_tool("import " + path("bus.log") + " --out " + path("rows.csv"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("with the battery's own messages"));
  const std::string csv = content(path("rows.csv"));
  EXPECT_THAT(csv, ::testing::StartsWith("time_s,current_a,voltage_v,temperature_c\n"));
  EXPECT_GT(std::count(csv.begin(), csv.end(), '\n'), 95);
}

TEST_F(Monitor, ALogOfTheSameFramesGivesTheSameJsonByteForByte) {
  std::string text = dump_of(100);
  text +=
      "(1200.000000) can0 12345678#0102\n(1200.000001) can0 123#R4\n(1200.000002) can0 "
      "123##3112233445566778899001122\n(1200.000003) can0 20000040#0000000000000000\n(1200.000004) can0 182#00\n";
  const std::string file = log(text);
  ASSERT_EQ(run_tool("monitor --quiet --record " + path("record.log") + " --json " + path("first.json") + " " + file)
                .exit_code,
            0);
  std::string first = content(path("first.json")),
              second = run_tool("monitor file:" + path("record.log") + " --json -").out;
  const auto without_source = [](std::string text_of) {
    return text_of.erase(text_of.find("\"source\""), text_of.find("\"frames\"") - text_of.find("\"source\""));
  };
  EXPECT_EQ(without_source(first), without_source(second));
  EXPECT_GT(first.size(), 1'000U);
  const json p = json::parse(first);
  EXPECT_EQ(p["other_kinds"]["fd"], 1);
  EXPECT_EQ(p["other_kinds"]["remote"], 1);
  EXPECT_EQ(p["other_kinds"]["error_reports"], 1);
  EXPECT_EQ(p["messages"]["Status"]["wrong_length"], 1);
}

TEST_F(Monitor, RefusesInvalidInputInOneLine) {
  for (const char* arguments :
       {"nonesuch0", "file:/nonesuch", "file:" BMS_SOURCE_DIR "/README.md", "file:/", "slcan:/dev/null",
        "file:x --record -", "file:x --serve 70000", "file:x --duration 0", "file:x --csv ''"}) {
    const ToolRun run = run_tool(std::string("monitor ") + arguments);
    EXPECT_EQ(run.exit_code, 2) << arguments;
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  }
  const std::string file = log(dump_of(3));
  for (const char* out : {"--record", "--csv", "--json"}) {
    const ToolRun run = run_tool("monitor --quiet " + file + " " + out + " /nonesuch/x");
    EXPECT_EQ(run.exit_code, 2) << out;
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  }
}

TEST_F(Monitor, CountsHostileLinesOfALogAndReadsTheValidOnes) {
  std::mt19937_64 random(5);
  std::string text;
  std::istringstream good(dump_of(200));
  std::uint64_t bad = 0;
  for (std::string line; std::getline(good, line);) {
    std::string noise;
    switch (random() % 4) {
      case 0:
        for (int k = 0; k < 40; ++k) noise += static_cast<char>(random());
        for (char& c : noise) c = c == '\n' ? '?' : c;
        noise += '?';
        break;
      case 1:
        noise = line.substr(0, line.size() / 2);
        break;
      case 2:
        noise = std::string(random() % 100'000 + 600, '#');
        break;
      default:
        noise = "(1.000000) can0 800#00";
        break;
    }
    ++bad;
    text += line + "\n" + noise + "\n";
  }
  const json p = picture(log(text));
  EXPECT_EQ(p["malformed"], bad);
  EXPECT_EQ(p["frames"], 1'600);
  EXPECT_EQ(p["messages"]["PackState"]["lost"], 0);
}

/// The tool on a terminal of its own, with an adapter that the test simulates.
class LiveScreen : public ::testing::Test {
 protected:
  ~LiveScreen() override {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
  }
  void start(std::vector<std::string> more = {}) {
    before_ = terminal_.settings();
    std::vector<std::string> words = {BMS_TOOL, "monitor", std::string("slcan:") + adapter_.name()};
    words.insert(words.end(), more.begin(), more.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    pid_ = fork();
    if (pid_ == 0) {
      login_tty(terminal_.slave());
      setenv("LC_ALL", "C.UTF-8", 1);
      execv(argv[0], argv.data());
      _exit(127);
    }
    adapter_.read_until("O\r");
  }
  /// Sends a sample every tenth of a second during the call.
  void talk() {
    const auto now = std::chrono::steady_clock::now();
    if (now < next_) return;
    next_ = now + std::chrono::milliseconds(100);
    for (const monitor::BusFrame& frame : traffic_.sample()) {
      std::array<char, hal::slcan::longest_frame> text;
      adapter_.write(std::string(hal::slcan::encode(to_can_frame(frame), text)));
    }
  }
  std::string shown_until(const std::string& what) {
    return terminal_.read_until(what, [this] { talk(); });
  }
  int end() {
    int status = -1;
    for (int tries = 0; tries < 12'000; ++tries) {
      if (waitpid(pid_, &status, WNOHANG) == pid_) {
        pid_ = -1;
        return status;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return -1;
  }
  void expect_terminal_as_before() const {
    const termios now = terminal_.settings();
    EXPECT_EQ(now.c_lflag, before_.c_lflag);
    EXPECT_EQ(now.c_iflag, before_.c_iflag);
    EXPECT_EQ(now.c_oflag, before_.c_oflag);
  }
  static constexpr const char* restored = "\x1b[?25h\x1b[?1049l";

  PseudoTerminal terminal_, adapter_;
  termios before_{};
  pid_t pid_ = -1;
  monitor::Traffic traffic_{0, 100'000};
  std::chrono::steady_clock::time_point next_{};
};

TEST_F(LiveScreen, DrawsOnTheAlternateScreenAndRestoresTheTerminalOnCtrlC) {
  start();
  const std::string first = shown_until("carried by counting");
  EXPECT_THAT(first, AllOf(HasSubstr("\x1b[?1049h\x1b[?25l"), HasSubstr("carried by counting")));
  EXPECT_EQ(terminal_.settings().c_lflag & (ICANON | ECHO), 0U) << "keys are not shown";
  terminal_.write("\x03");
  const std::string last = shown_until("\x1b[?1049l");
  EXPECT_THAT(last, HasSubstr(restored));
  std::string left = last.substr(std::min(last.find(restored), last.size()));
  if (left.find("Charge   ") == std::string::npos) left += terminal_.read_until("Charge   ");
  EXPECT_THAT(left, HasSubstr("Charge   "));
  EXPECT_EQ(end(), 0);
  expect_terminal_as_before();
  // what follows are frames that the terminal echoes once nobody reads it
  EXPECT_THAT(adapter_.read_until("C\r"), StartsWith("C\r")) << "the adapter's channel is closed";
}

TEST_F(LiveScreen, EndsWithQ) {
  start();
  shown_until("carried by counting");
  terminal_.write("q");
  EXPECT_THAT(shown_until("\x1b[?1049l"), HasSubstr(restored));
  EXPECT_EQ(end(), 0);
  expect_terminal_as_before();
}

TEST_F(LiveScreen, FollowsTheTerminalsSize) {
  start();
  shown_until("SocAnchor");
  terminal_.resize(40, 6);
  std::string text, frame;
  const auto is_small = [&] { return !frame.empty() && std::count(frame.begin(), frame.end(), '\n') <= 5; };
  for (int frames = 0; frames < 100 && !is_small(); ++frames) {  // some were drawn before the change of size
    text += shown_until("\x1b[?2026l");
    const std::size_t end = text.rfind("\x1b[?2026l"), begin = text.rfind("\x1b[?2026h", end);
    if (begin != std::string::npos) frame = text.substr(begin, end - begin);
  }
  EXPECT_TRUE(is_small()) << frame;
  EXPECT_THAT(frame, AllOf(HasSubstr("Charge"), Not(HasSubstr("SocAnchor"))));
}

TEST_F(LiveScreen, RestoresTheTerminalAfterACrash) {
  start();
  shown_until("carried by counting");
  kill(pid_, SIGSEGV);
  EXPECT_THAT(shown_until("\x1b[?1049l"), HasSubstr(restored));
  const int status = end();
  EXPECT_TRUE(WIFSIGNALED(status)) << "and still crashes";
  expect_terminal_as_before();
}

TEST_F(LiveScreen, ShowsStaleValuesInGrey) {
  start();
  shown_until("carried by counting");
  EXPECT_THAT(shown_until("\x1b[1m80.0 %"), HasSubstr("\x1b[1m80.0 %"));
  EXPECT_THAT(terminal_.read_until("\x1b[90m80.0 %"), HasSubstr("\x1b[90m80.0 %")) << "after three seconds of silence";
}

TEST_F(LiveScreen, EndsWithALineWhenTheAdapterIsUnplugged) {
  // the test closes the adapter's side, and the tool reads an error
  auto gone = std::make_unique<PseudoTerminal>();
  const files::TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const images::ChildProcess* child = nullptr;
  auto tool = std::make_unique<images::ChildProcess>(
      std::vector<std::string>{BMS_TOOL, "monitor", std::string("slcan:") + gone->name()}, out);
  child = tool.get();
  EXPECT_NE(child, nullptr);
  gone->read_until("O\r");
  gone.reset();
  EXPECT_EQ(tool->wait(), 1);
  EXPECT_THAT(content(out), HasSubstr("has gone away"));
}

/// Resident memory of a process [kB].
long memory_kb(pid_t pid) {
  std::ifstream in("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("VmRSS:")) return std::atol(line.c_str() + 6);
  }
  return 0;
}

TEST(MonitorLoad, ReadsTenThousandFramesPerSecondWithoutLossInConstantMemory) {
  // 4 s of traffic with 10,000 frames per second through a pipe, as fast as the tool reads; tests/vcan/load.sh sends
  // frames in real time
  const files::TemporaryFolder folder;
  const std::string json_file = (folder.path() / "p.json").string();
  int line[2];
  ASSERT_EQ(pipe2(line, O_CLOEXEC), 0);
  const pid_t tool = fork();
  if (tool == 0) {
    dup2(line[0], 0);
    execl(BMS_TOOL, BMS_TOOL, "monitor", "file:-", "--quiet", "--json", json_file.c_str(), nullptr);
    _exit(127);
  }
  close(line[0]);
  static_cast<void>(signal(SIGPIPE, SIG_IGN));
  constexpr std::int64_t begin_us = 1'700'000'000'000'000;
  monitor::Traffic traffic(begin_us, 400);
  std::size_t frames = 0;
  const auto send_until = [&](std::int64_t end_us) {  // the pipe holds about 1,000 frames; the tool has read all others
    while (traffic.now_us() < end_us) {
      std::string text;
      for (const monitor::BusFrame& frame : traffic.sample()) {
        monitor::append_dump_line(text, frame, "can0");
        ++frames;
      }
      ASSERT_EQ(::write(line[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
    }
  };
  send_until(begin_us + 1'000'000);
  const long early_kb = memory_kb(tool);
  send_until(begin_us + 4'000'000);
  const long late_kb = memory_kb(tool);
  close(line[1]);
  int status = 0;
  waitpid(tool, &status, 0);
  ASSERT_EQ(status, 0);
  const json p = json::parse(content(json_file));
  EXPECT_EQ(p["frames"], frames);
  EXPECT_GT(p["frames"], 40'000);
  for (const auto& [name, message] : p["messages"].items()) EXPECT_EQ(message["lost"], 0) << name;
  EXPECT_GT(early_kb, 1'000);
  EXPECT_LE(late_kb, early_kb + 256);
}

}  // namespace
}  // namespace bms
