// bms monitor --serve: the server from the outside, and the page in a real browser.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <regex>
#include <thread>

#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

/// The tool serving a log of five minutes.
class ServedPage : public ::testing::Test {
 protected:
  ServedPage() {
    const std::string log = (folder_.path() / "bus.log").string();
    EXPECT_EQ(std::system((BMS_WRITE_TRAFFIC " dump 0 300 2>/dev/null > " + log).c_str()), 0);
    tool_ = std::make_unique<images::ChildProcess>(
        std::vector<std::string>{BMS_TOOL, "monitor", "file:" + log, "--quiet", "--serve"}, folder_.path() / "out");
    std::smatch match;
    for (int tries = 0; tries < 12'000; ++tries) {
      const std::string out = content(folder_.path() / "out");
      if (std::regex_search(out, match, std::regex("Page: (http://127\\.0\\.0\\.1:([0-9]+)/)\n"))) {
        url_ = match[1];
        port_ = std::stoi(match[2]);
        break;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EXPECT_GT(port_, 0) << content(folder_.path() / "out");
  }
  std::string own_host() const { return "127.0.0.1:" + std::to_string(port_); }

  int connect() const {
    const int line = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port_));
    inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
    EXPECT_EQ(::connect(line, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    return line;
  }
  /// The answer until the connection is closed, up to `most` bytes.
  std::string answer(const std::string& request, std::size_t most = 4'000) const {
    const int line = connect();
    const timeval wait{120, 0};  // a limit for a failure, not for a slow machine
    setsockopt(line, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
    EXPECT_EQ(send(line, request.data(), request.size(), MSG_NOSIGNAL), static_cast<ssize_t>(request.size()));
    std::string text;
    char bytes[4096];
    while (text.size() < most) {
      const ssize_t n = recv(line, bytes, sizeof bytes, 0);
      if (n <= 0) break;
      text.append(bytes, static_cast<std::size_t>(n));
    }
    close(line);
    return text;
  }

  files::TemporaryFolder folder_;
  std::unique_ptr<images::ChildProcess> tool_;
  std::string url_;
  int port_ = 0;
};

TEST_F(ServedPage, ServesOnlyThisComputerAndOnlyReads) {
  const auto get = [&](const std::string& method, const std::string& path, const std::string& host) {
    return answer(method + " " + path + " HTTP/1.1\r\n" + (host.empty() ? "" : "Host: " + host + "\r\n") +
                  "Connection: close\r\n\r\n");
  };
  const std::string own = own_host();
  EXPECT_THAT(get("GET", "/", own),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("default-src 'none'"), HasSubstr("frame-ancestors 'none'"),
                    Not(HasSubstr("Access-Control-Allow-Origin"))));
  EXPECT_THAT(get("GET", "/", "localhost:" + std::to_string(port_)), StartsWith("HTTP/1.1 200"));
  for (const std::string& host : {std::string("evil.example"), "evil.example:" + std::to_string(port_),
                                  std::string("127.0.0.1"), "127.0.0.1:" + std::to_string(port_ + 1), std::string()}) {
    EXPECT_THAT(get("GET", "/", host), StartsWith("HTTP/1.1 403")) << host;
    EXPECT_THAT(get("GET", "/events", host), StartsWith("HTTP/1.1 403")) << host;
  }
  EXPECT_THAT(get("GET", "/", own + "\r\nHost: evil.example"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(get("GET", "/", "evil.example\r\nHost: " + own), StartsWith("HTTP/1.1 400"));
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "HEAD", "PATCH"})
    EXPECT_THAT(get(method, "/", own), StartsWith("HTTP/1.1 405")) << method;
  EXPECT_THAT(get("GET", "/../etc/passwd", own), StartsWith("HTTP/1.1 404"));
}

TEST_F(ServedPage, APageOfAnotherSiteCannotTakeAStream) {
  const auto stream = [&](const std::string& header) {
    return answer("GET /events HTTP/1.1\r\nHost: " + own_host() + "\r\n" + header + "\r\n\r\n", 100);
  };
  EXPECT_THAT(stream("Origin: http://evil.example"), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(stream("Origin: null"), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(stream("Sec-Fetch-Site: cross-site"), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(stream("Origin: http://" + own_host()), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(stream("Sec-Fetch-Site: same-origin"), StartsWith("HTTP/1.1 200"));
}

/// Resident memory of the tool in kB.
long resident_kb(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return std::stol(line.substr(6));
  }
  return -1;
}

TEST_F(ServedPage, AnEndlessHeadIsRefusedAndTakesNoMemory) {
  const long before_kb = resident_kb(tool_->pid());
  const std::string block(1'000'000, 'A');
  for (const std::string& begin : {std::string("GET / HTTP/1.1\r\nX: "), std::string("GET /")}) {
    const int line = connect();
    send(line, begin.data(), begin.size(), MSG_NOSIGNAL);
    std::size_t sent = 0;
    while (sent < 100 * block.size()) {
      const ssize_t n = send(line, block.data(), block.size(), MSG_NOSIGNAL);
      if (n <= 0) break;
      sent += static_cast<std::size_t>(n);
    }
    EXPECT_LT(sent, 20 * block.size()) << "the connection is closed";
    close(line);
  }
  EXPECT_LT(resident_kb(tool_->pid()), before_kb + 10'000);
}

TEST_F(ServedPage, SlowConnectionsDoNotStopThePage) {
  std::vector<int> slow;
  for (int k = 0; k < 12; ++k) {
    slow.push_back(connect());
    send(slow.back(), "GET / HTTP/1.1\r\nX", 17, MSG_NOSIGNAL);
  }
  EXPECT_THAT(answer("GET / HTTP/1.1\r\nHost: " + own_host() + "\r\n\r\n", 100), StartsWith("HTTP/1.1 200"));
  // each is closed although it sends a byte from time to time
  char byte = 0;
  const auto begin = std::chrono::steady_clock::now();
  const timeval wait{1, 0};
  setsockopt(slow[0], SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
  bool closed = false;
  while (!closed && std::chrono::steady_clock::now() - begin < std::chrono::seconds(120)) {
    send(slow[0], "a", 1, MSG_NOSIGNAL);
    const ssize_t n = recv(slow[0], &byte, 1, 0);
    closed = n == 0 || (n < 0 && errno != EAGAIN);
  }
  EXPECT_TRUE(closed);
  for (const int line : slow) close(line);
}

TEST_F(ServedPage, AStreamBeginsWithTheWholeHistoryAndTheSeventhIsRefused) {
  const std::string request = "GET /events HTTP/1.1\r\nHost: " + own_host() + "\r\n\r\n";
  const std::string first = answer(request, 60'000);
  EXPECT_THAT(first, AllOf(HasSubstr("text/event-stream"), HasSubstr("data: {\"picture\":{ \"command\": \"monitor\""),
                           HasSubstr("\"points\":[[0.000,")));
  std::vector<int> lines;
  for (int k = 0; k < 6; ++k) {
    lines.push_back(connect());
    send(lines.back(), request.data(), request.size(), MSG_NOSIGNAL);
    char byte = 0;
    EXPECT_EQ(recv(lines.back(), &byte, 1, 0), 1);
  }
  const std::string last_request = "GET /events HTTP/1.1\r\nHost: " + own_host() + "\r\nConnection: close\r\n\r\n";
  std::string seventh;
  for (int tries = 0; tries < 100 && !seventh.starts_with("HTTP/1.1 503"); ++tries)
    seventh = answer(last_request, 1'000);
  EXPECT_THAT(seventh, StartsWith("HTTP/1.1 503"));
  for (const int line : lines) close(line);
}

TEST_F(ServedPage, APortThatIsTakenIsRefused) {
  const ToolRun run = run_tool("monitor file:" + (folder_.path() / "bus.log").string() +
                               " --quiet --duration 1 --serve " + std::to_string(port_));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("is in use"));
}

/// A browser, controlled by its debugging protocol through pipes (--remote-debugging-pipe: JSON objects, each ended
/// by a zero).
class Browser {
 public:
  explicit Browser(const std::filesystem::path& profile) {
    int in[2], out[2];
    EXPECT_EQ(pipe2(in, O_CLOEXEC), 0);
    EXPECT_EQ(pipe2(out, O_CLOEXEC), 0);
    const std::string folder = "--user-data-dir=" + profile.string();
    pid_ = fork();
    if (pid_ == 0) {
      const int quiet = open("/dev/null", O_RDWR), from = fcntl(in[0], F_DUPFD, 10), to = fcntl(out[1], F_DUPFD, 10);
      for (int k = 0; k < 3; ++k) dup2(quiet, k);
      dup2(from, 3);
      dup2(to, 4);
      execlp("chromium", "chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
             "--disable-background-networking", "--disable-component-update", "--disable-sync",
             "--remote-debugging-pipe", "--window-size=1400,1100", folder.c_str(), "about:blank", nullptr);
      _exit(127);
    }
    close(in[0]);
    close(out[1]);
    to_ = in[1];
    from_ = out[0];
    const json page = ask("Target.createTarget", {{"url", "about:blank"}});
    session_ = ask("Target.attachToTarget", {{"targetId", page["targetId"]}, {"flatten", true}})["sessionId"];
    for (const char* domain : {"Network.enable", "Runtime.enable", "Page.enable"}) ask(domain, json::object());
  }
  ~Browser() {
    close(to_);
    close(from_);
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  Browser(const Browser&) = delete;
  Browser& operator=(const Browser&) = delete;

  json ask(const std::string& method, const json& parameters) {
    json request = {{"id", ++asked_}, {"method", method}, {"params", parameters}};
    if (!session_.empty()) request["sessionId"] = session_;
    const std::string text = request.dump();
    EXPECT_EQ(::write(to_, text.c_str(), text.size() + 1), static_cast<ssize_t>(text.size() + 1));
    while (true) {
      const json answer = next();
      if (answer.is_null()) {
        ADD_FAILURE() << "no answer to " << method;
        return json::object();
      }
      if (answer.value("id", 0) == asked_) return answer.value("result", json::object());
    }
  }
  /// A script's value in the page.
  json value_of(const std::string& script) {
    const json result = ask("Runtime.evaluate", {{"expression", script}, {"returnByValue", true}});
    return result.value("result", json::object()).value("value", json());
  }
  const std::vector<std::string>& requests() const { return requests_; }
  const std::vector<std::string>& errors() const { return errors_; }

 private:
  json next() {
    while (true) {
      const std::size_t end = held_.find('\0');
      if (end != std::string::npos) {
        json message = json::parse(held_.substr(0, end), nullptr, false);
        held_.erase(0, end + 1);
        const std::string method = message.value("method", "");
        if (method == "Network.requestWillBeSent") requests_.push_back(message["params"]["request"]["url"]);
        if (method == "Runtime.exceptionThrown") errors_.push_back(message.dump());
        return message;
      }
      pollfd p{from_, POLLIN, 0};
      char bytes[65536];
      const ssize_t n = poll(&p, 1, 120'000) > 0 ? ::read(from_, bytes, sizeof bytes) : 0;
      if (n <= 0) return {};
      held_.append(bytes, static_cast<std::size_t>(n));
    }
  }

  pid_t pid_ = -1;
  int to_ = -1, from_ = -1, asked_ = 0;
  std::string session_, held_;
  std::vector<std::string> requests_, errors_;
};

TEST_F(ServedPage, ShowsValuesAndPlotsInABrowserAndLoadsNothingElse) {
  if (!images::in_path("chromium")) GTEST_SKIP() << "no chromium";
  Browser browser(folder_.path() / "profile");
  browser.ask("Page.navigate", {{"url", url_}});
  const auto soon = [&](const std::string& script) {
    for (int tries = 0; tries < 2'400; ++tries) {
      if (browser.value_of(script) == true) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return false;
  };
  ASSERT_TRUE(soon("window.points && points.length > 500 && charts.soc.numRows() === points.length"))
      << browser.value_of("document.body.innerText");
  // the last sample, as tests/host_sim/monitor/traffic.hpp makes it: 50 + 30 cos(29,999 / 2,700) %
  EXPECT_EQ(browser.value_of("document.getElementById('soc').textContent"), "53.4\u202f%");
  EXPECT_EQ(browser.value_of("document.getElementById('quality').textContent"), "carried by counting");
  EXPECT_NEAR(browser.value_of("points[0][1]").get<double>(), 80, 0.01);
  EXPECT_NEAR(browser.value_of("charts.soc.getValue(charts.soc.numRows() - 1, 1)[1]").get<double>(), 52.906, 0.003)
      << "a point each half second: the last is of 299.5 s";
  EXPECT_GT(browser.value_of("charts.current.yAxisRange()[1] - charts.current.yAxisRange()[0]").get<double>(), 20);
  EXPECT_EQ(browser.value_of("document.querySelectorAll('#messages tr').length"), 9) << "a head and eight messages";
  EXPECT_EQ(browser.value_of("document.getElementById('figure-cells').hidden"), true)
      << "this bus has no cell voltages";
  EXPECT_EQ(
      browser.value_of("document.body.innerText.includes('NaN') || document.body.innerText.includes('undefined')"),
      false);
  for (const char* elsewhere : {"fetch('http://127.0.0.1:1/')", "fetch('https://example.org/')"}) {
    EXPECT_EQ(browser.ask("Runtime.evaluate",
                          {{"expression", std::string(elsewhere) + ".then(() => 'let through', e => 'refused')"},
                           {"awaitPromise", true}})["result"]["value"],
              "refused");
  }
  EXPECT_TRUE(browser.errors().empty()) << browser.errors().front();
  EXPECT_THAT(browser.requests(), ::testing::UnorderedElementsAre(url_, url_ + "events"));

  // after the monitor has ended, the page says so and keeps its values
  tool_.reset();
  EXPECT_TRUE(soon("document.getElementById('state').textContent === 'The monitor has ended'"));
  EXPECT_EQ(browser.value_of("document.getElementById('soc').textContent"), "53.4\u202f%");
}

}  // namespace
}  // namespace bms
