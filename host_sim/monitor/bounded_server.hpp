// An HTTP server with bounded memory and bounded waiting, on top of cpp-httplib.
//
// The library reads a header line of any length and any number of header lines, lets a client take its time for them,
// and queues any number of connections. This class therefore reads the head of a request itself and gives the library
// complete heads only:
//
//   head of a request       8,192 bytes at most, else 431 and the connection is closed
//   time for the head       2 s in total, else the connection is closed
//   body of a request       is not read
//   requests                one per connection
//   connections at once     24, further ones are closed immediately
//
// A program on this machine can still take all connections again and again. Memory is then constant: each connection
// has one thread and one head.
#pragma once

#include <httplib.h>

namespace bms::monitor {

class BoundedServer : public httplib::Server {
 public:
  static constexpr std::size_t longest_head = 8'192;  ///< bytes
  static constexpr int most_connections = 24;
  static constexpr int head_ms = 2'000, write_ms = 5'000;  ///< a client that takes longer is disconnected

  BoundedServer();

 private:
  /// Own: this class, whose base has another function in cpp-httplib 0.18 than in 0.11.
  template <class Own>
  static bool answer(Own& server, httplib::Stream& connection);
  bool process_and_close_socket(socket_t socket) override;
};

}  // namespace bms::monitor
