// The live page: a small HTTP server on 127.0.0.1 that hands out one page and a stream of events (cpp-httplib).
//
//   GET /          the page, all inside
//   GET /events    server-sent events: {"picture": what json_of() says, "points": [[time_s, soc, two sigma, A, V,
//   degrees C, cells...]]};
//                  the first event of a connection brings the whole history, each later one what is new, twice a second
//                  at most
//
// Only for this machine and its user: anything but GET is refused (405), so is a Host that is not ours (403: a foreign
// page whose name was pointed at 127.0.0.1), other pages may neither read nor frame it, and the page itself may fetch
// from nowhere else (its Content-Security-Policy). Six streams at most, the next is told to wait (503).
#pragma once

#include <memory>
#include <string>

#include "monitor/history.hpp"

namespace bms::monitor {

class LivePage {
 public:
  /// port 0: any that is free. Throws SourceError when it is taken.
  LivePage(std::string html, int port);
  ~LivePage();
  LivePage(const LivePage&) = delete;
  LivePage& operator=(const LivePage&) = delete;

  std::string url() const;
  /// A point for the plots, if the history wants one now.
  void add(const BusState& bus);
  /// The picture as JSON, and what was added since.
  void publish(std::string picture);

 private:
  struct Server;
  std::unique_ptr<Server> server_;
};

}  // namespace bms::monitor
