// The live page: an HTTP server on 127.0.0.1 (cpp-httplib) that serves one page and a stream of events.
//
//   GET /          the page, self-contained
//   GET /events    server-sent events: {"picture": output of json_of(),
//                  "points": [[time_s, soc, two sigma, A, V, degrees C, cells...]]}
//                  The first event of a connection contains the whole history, each later one the new points. At most
//                  two events per second.
//
// Only this machine and its user have access. Methods other than GET are rejected (405), and so is a foreign Host
// header (403), which a page of another domain that resolves to 127.0.0.1 would send. Other pages can neither read nor
// frame the page nor open the stream (403), and its Content-Security-Policy lets it fetch only from this server. At
// most six streams; the next gets 503. Memory and waiting are bounded: host_sim/monitor/bounded_server.hpp.
#pragma once

#include <memory>
#include <string>

#include "monitor/history.hpp"

namespace bms::monitor {

class LivePage {
 public:
  /// Starts the server. policy: Content-Security-Policy of the page. Port 0: any free port. Throws SourceError if the
  /// port is in use.
  LivePage(std::string html, std::string policy, int port);
  ~LivePage();
  LivePage(const LivePage&) = delete;
  LivePage& operator=(const LivePage&) = delete;

  std::string url() const;
  /// Adds a point to the history if one is due.
  void add(const BusState& bus);
  /// Sends `picture`, the output of json_of(), and the new points to all streams.
  void publish(std::string picture);

 private:
  struct Server;
  std::unique_ptr<Server> server_;
};

}  // namespace bms::monitor
