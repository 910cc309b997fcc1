#include "monitor/live_page.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <iterator>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "monitor/bounded_server.hpp"
#include "monitor/frame_source.hpp"

namespace bms::monitor {

namespace {

constexpr int most_streams = 6;
constexpr int bad_request = 400, forbidden = 403, method_not_allowed = 405, service_unavailable = 503;  // HTTP

void append(std::string& text, const HistoryPoint& p) {
  auto out = std::back_inserter(text);
  fmt::format_to(out, "[{:.3f}", p.time_s);
  const auto field = [&](float value) {
    if (std::isfinite(value))
      fmt::format_to(out, ",{}", value);
    else
      text += ",null";
  };
  for (const float value : {p.soc_percent, 2 * p.soc_sigma_percent, p.current_a, p.voltage_v, p.temperature_c})
    field(value);
  for (std::size_t k = 0; k < p.cell_count; ++k) field(p.cells_v[k]);
  text += ']';
}

}  // namespace

struct LivePage::Server {
  std::string html, policy;
  int port = 0;
  BoundedServer http;
  std::thread thread;
  std::atomic<int> streams{0};

  std::mutex guard;  // of the members below
  std::condition_variable changed;
  History history;
  std::string picture;
  std::uint64_t version = 0;
  bool stopping = false;

  /// How much a stream has sent.
  struct Position {
    std::uint64_t version = 0, points = 0;
  };

  /// Waits for news and writes them to `event`, or a comment after one second without news. Returns false at the end.
  bool next(Position& at, std::string& event) {
    std::unique_lock lock(guard);
    changed.wait_for(lock, std::chrono::seconds(1), [&] { return stopping || version != at.version; });
    if (stopping) return false;
    if (version == at.version) {
      event = ":\n\n";
      return true;
    }
    event = "data: {\"picture\":";
    for (const char c : picture) {
      if (c != '\n') event += c;
    }
    event += ",\"points\":[";
    bool first = true;
    for (std::uint64_t k = std::max(at.points, history.first()); k < history.count(); ++k, first = false) {
      if (!first) event += ',';
      append(event, history.at(k));
    }
    event += "]}\n\n";
    at = {version, history.count()};
    return true;
  }

  bool is_own_host(const std::string& host) const {
    return host == fmt::format("127.0.0.1:{}", port) || host == fmt::format("localhost:{}", port);
  }

  /// Sets the headers of the response. Returns true if the request is rejected. Two Host headers are rejected, because
  /// another program on the way may have checked the other one (RFC 9112, section 3.2).
  bool reject(const httplib::Request& request, httplib::Response& response) const {
    response.set_header("Content-Security-Policy", policy + "; frame-ancestors 'none'");
    response.set_header("Cross-Origin-Resource-Policy", "same-origin");
    response.set_header("X-Content-Type-Options", "nosniff");
    response.set_header("Referrer-Policy", "no-referrer");
    response.set_header("Cache-Control", "no-store");
    if (request.get_header_value_count("Host") > 1)
      response.status = bad_request;
    else if (!is_own_host(request.get_header_value("Host")))
      response.status = forbidden;
    else if (request.method != "GET")
      response.status = method_not_allowed;
    else
      return false;
    return true;
  }

  /// Returns true if the page of another site sent the request: it could not read the events, but take the streams.
  bool is_foreign(const httplib::Request& request) const {
    const std::string origin = request.get_header_value("Origin"), site = request.get_header_value("Sec-Fetch-Site");
    constexpr std::string_view scheme = "http://";
    const bool own_origin = origin.starts_with(scheme) && is_own_host(origin.substr(scheme.size()));
    return (!origin.empty() && !own_origin) || !(site.empty() || site == "same-origin" || site == "none");
  }

  void stream(const httplib::Request& request, httplib::Response& response) {
    if (is_foreign(request)) {
      response.status = forbidden;
      return;
    }
    if (streams.fetch_add(1) >= most_streams) {
      --streams;
      response.status = service_unavailable;
      return;
    }
    auto at = std::make_shared<Position>();
    response.set_chunked_content_provider(
        "text/event-stream",
        [this, at](std::size_t, httplib::DataSink& sink) {
          std::string event;
          if (!next(*at, event)) {
            sink.done();
            return true;
          }
          return sink.write(event.data(), event.size());
        },
        [this](bool) { --streams; });
  }
};

LivePage::LivePage(std::string html, std::string policy, int port) : server_(std::make_unique<Server>()) {
  Server& s = *server_;
  s.html = std::move(html);
  s.policy = std::move(policy);
  s.http.set_socket_options([](socket_t socket) {
    const int on = 1;
    // not SO_REUSEPORT: binding to a port in use must fail
    setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  });
  s.http.set_pre_routing_handler([&s](const httplib::Request& request, httplib::Response& response) {
    return s.reject(request, response) ? httplib::Server::HandlerResponse::Handled
                                       : httplib::Server::HandlerResponse::Unhandled;
  });
  s.http.Get("/", [&s](const httplib::Request&, httplib::Response& response) {
    response.set_content(s.html, "text/html; charset=utf-8");
  });
  s.http.Get("/events",
             [&s](const httplib::Request& request, httplib::Response& response) { s.stream(request, response); });
  if (port <= 0)
    s.port = s.http.bind_to_any_port("127.0.0.1");
  else
    s.port = s.http.bind_to_port("127.0.0.1", port) ? port : -1;
  if (s.port < 0)
    throw SourceError("--serve", 1, fmt::format("port {} of 127.0.0.1 is in use, expected a free port", port));
  s.thread = std::thread([&s] { s.http.listen_after_bind(); });
}

LivePage::~LivePage() {
  {
    const std::lock_guard lock(server_->guard);
    server_->stopping = true;
  }
  server_->changed.notify_all();
  // stop() has no effect before the server listens
  while (!server_->http.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  server_->http.stop();
  server_->thread.join();
}

std::string LivePage::url() const { return fmt::format("http://127.0.0.1:{}/", server_->port); }

void LivePage::add(const BusState& bus) {
  if (!server_->history.is_due(bus.now_us())) return;  // no lock: only this thread writes the history
  const HistoryPoint point = point_of(bus);
  const std::lock_guard lock(server_->guard);
  server_->history.add(point, bus.now_us());
}

void LivePage::publish(std::string picture) {
  {
    const std::lock_guard lock(server_->guard);
    server_->picture = std::move(picture);
    ++server_->version;
  }
  server_->changed.notify_all();
}

}  // namespace bms::monitor
