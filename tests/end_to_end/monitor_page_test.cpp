// bms monitor --serve: the server as a stranger finds it, and the page in a real browser.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <regex>
#include <thread>

#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

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
    tool_ = std::make_unique<ChildProcess>(std::vector<std::string>{BMS_TOOL, "monitor", "file:" + log, "--quiet", "--serve"}, folder_.path() / "out");
    std::smatch match;
    for (int tries = 0; tries < 500; ++tries) {
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
  /// What comes back within a second and a half, up to so many bytes.
  std::string answer(const std::string& request, std::size_t most = 4'000) const {
    const int line = connect();
    const timeval wait{1, 500'000};
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

  TemporaryFolder folder_;
  std::unique_ptr<ChildProcess> tool_;
  std::string url_;
  int port_ = 0;
};

TEST_F(ServedPage, IsOnlyForThisMachineByItsOwnNameAndOnlyToRead) {
  const auto get = [&](const std::string& method, const std::string& path, const std::string& host) {
    return answer(method + " " + path + " HTTP/1.1\r\n" + (host.empty() ? "" : "Host: " + host + "\r\n") + "Connection: close\r\n\r\n");
  };
  const std::string own = own_host();
  EXPECT_THAT(get("GET", "/", own), AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("default-src 'none'"), HasSubstr("frame-ancestors 'none'"), Not(HasSubstr("Access-Control-Allow-Origin"))));
  EXPECT_THAT(get("GET", "/", "localhost:" + std::to_string(port_)), StartsWith("HTTP/1.1 200"));
  for (const std::string& host : {std::string("evil.example"), "evil.example:" + std::to_string(port_), std::string("127.0.0.1"), "127.0.0.1:" + std::to_string(port_ + 1), std::string()}) {
    EXPECT_THAT(get("GET", "/", host), StartsWith("HTTP/1.1 403")) << host;
    EXPECT_THAT(get("GET", "/events", host), StartsWith("HTTP/1.1 403")) << host;
  }
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "HEAD", "PATCH"}) EXPECT_THAT(get(method, "/", own), StartsWith("HTTP/1.1 405")) << method;
  EXPECT_THAT(get("GET", "/../etc/passwd", own), StartsWith("HTTP/1.1 404"));
}

TEST_F(ServedPage, AStreamBeginsWithTheWholeHistoryAndTheSeventhIsToldToWait) {
  const std::string request = "GET /events HTTP/1.1\r\nHost: " + own_host() + "\r\n\r\n";
  const std::string first = answer(request, 60'000);
  EXPECT_THAT(first, AllOf(HasSubstr("text/event-stream"), HasSubstr("data: {\"picture\":{ \"command\": \"monitor\""), HasSubstr("\"points\":[[0.000,")));
  std::vector<int> lines;
  for (int k = 0; k < 6; ++k) {
    lines.push_back(connect());
    send(lines.back(), request.data(), request.size(), MSG_NOSIGNAL);
    char byte = 0;
    EXPECT_EQ(recv(lines.back(), &byte, 1, 0), 1);
  }
  std::string seventh;
  for (int tries = 0; tries < 3 && !seventh.starts_with("HTTP/1.1 503"); ++tries) seventh = answer(request, 1'000);
  EXPECT_THAT(seventh, StartsWith("HTTP/1.1 503"));
  for (const int line : lines) close(line);
}

TEST_F(ServedPage, APortThatIsTakenIsRefused) {
  const ToolRun run = run_tool("monitor file:" + (folder_.path() / "bus.log").string() + " --quiet --duration 1 --serve " + std::to_string(port_));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("is not to be had"));
}

TEST_F(ServedPage, ShowsLiveValuesAndPlotsInABrowserAndAsksNobodyElse) {
  if (!in_path("chromium")) GTEST_SKIP() << "no chromium";
  const auto dom_file = folder_.path() / "dom", net = folder_.path() / "net.json";
  // every other name leads nowhere; the log has each request that was tried
  const std::string command = "chromium --headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking --disable-component-update --disable-sync "
                              "--window-size=1400,1100 --timeout=4000 --log-net-log=" + net.string() + " --user-data-dir=" + (folder_.path() / "profile").string() + " --dump-dom " + url_ + " > " + dom_file.string() + " 2>/dev/null";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const std::string dom = content(dom_file);
  EXPECT_THAT(dom, std::regex_search(dom, std::regex("<span id=\"soc\">[0-9]+\\.[0-9]")) ? HasSubstr("<span id=\"soc\">") : HasSubstr("a state of charge"));
  EXPECT_THAT(dom, HasSubstr("carried by counting"));
  EXPECT_THAT(dom, HasSubstr("<td>PackElectrical</td>"));
  EXPECT_THAT(dom, Not(HasSubstr("NaN")) ) << "no value is lost";
  std::size_t canvases = 0;
  for (std::size_t at = dom.find("<canvas"); at != std::string::npos; at = dom.find("<canvas", at + 1)) ++canvases;
  EXPECT_GE(canvases, 8U);
  const std::string log = content(net);
  EXPECT_THAT(log, HasSubstr("/events"));
  const std::regex asked("\"url\":\"((https?|wss?)://[^\"]*)\"");
  std::size_t own = 0;
  for (std::sregex_iterator at(log.begin(), log.end(), asked), end; at != end; ++at) {
    const std::string url = (*at)[1];
    EXPECT_THAT(url, StartsWith("http://" + own_host() + "/"));
    ++own;
  }
  EXPECT_GE(own, 2U);
}

}  // namespace
}  // namespace bms
