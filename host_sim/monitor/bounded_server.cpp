#include "monitor/bounded_server.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

namespace bms::monitor {

namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* local_address = "127.0.0.1";  // the only one that the server is bound to

thread_local bool refusing = false;  // the connection is one too many

using Enqueued = decltype(std::declval<httplib::TaskQueue&>().enqueue(nullptr));  // void in 0.11, bool in 0.18

/// A thread for each connection. A connection without a thread is run at once, and is then refused.
class BoundedQueue : public httplib::TaskQueue {
 public:
  Enqueued enqueue(std::function<void()> connection) override {
    if (active_.fetch_add(1) >= BoundedServer::most_connections) {
      --active_;
      refusing = true;
      connection();
      refusing = false;
    } else {
      threads_.enqueue([this, connection = std::move(connection)] {
        connection();
        --active_;
      });
    }
    return static_cast<Enqueued>(true);
  }
  void shutdown() override { threads_.shutdown(); }

 private:
  std::atomic<int> active_{0};
  httplib::ThreadPool threads_{BoundedServer::most_connections};
};

/// A request whose head has been read, and the connection for its response.
class Connection : public httplib::Stream {
 public:
  Connection(socket_t socket, std::string head) : socket_(socket), head_(std::move(head)) {}

  bool is_readable() const override { return used_ < head_.size(); }
  bool is_writable() const override {
    pollfd p{socket_, POLLOUT, 0};
    if (poll(&p, 1, BoundedServer::write_ms) <= 0 || (p.revents & (POLLERR | POLLHUP)) != 0) return false;
    char byte = 0;
    return recv(socket_, &byte, 1, MSG_PEEK | MSG_DONTWAIT) != 0;  // 0: the client has closed the connection
  }
  ssize_t read(char* room, size_t size) override {
    const std::size_t n = std::min(size, head_.size() - used_);
    std::copy_n(head_.data() + used_, n, room);
    used_ += n;
    return static_cast<ssize_t>(n);
  }
  ssize_t write(const char* bytes, size_t size) override {
    return is_writable() ? send(socket_, bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT) : -1;
  }
  void get_remote_ip_and_port(std::string& ip, int& port) const override { local(ip, port); }
  void get_local_ip_and_port(std::string& ip, int& port) const override { local(ip, port); }
  socket_t socket() const override { return socket_; }

 private:
  static void local(std::string& ip, int& port) {
    ip = local_address;
    port = 0;
  }

  socket_t socket_;
  std::string head_;
  std::size_t used_ = 0;
};

enum class Head { complete, too_long, missing };

/// Reads up to the empty line that ends the head. What follows it is dropped. server: becomes invalid when it stops.
Head read_head(socket_t socket, const std::atomic<socket_t>& server, std::string& head) {
  constexpr std::string_view end = "\r\n\r\n";
  constexpr int slice_ms = 50;  // so that stopping does not wait for a slow client
  const auto deadline = Clock::now() + std::chrono::milliseconds(BoundedServer::head_ms);
  std::string room(BoundedServer::longest_head + 1, '\0');
  while (Clock::now() < deadline && server != INVALID_SOCKET) {
    pollfd p{socket, POLLIN, 0};
    if (poll(&p, 1, slice_ms) == 0) continue;
    const ssize_t n = recv(socket, room.data(), room.size() - head.size(), MSG_DONTWAIT);
    if (n <= 0) return Head::missing;
    const std::size_t searched = std::max(head.size(), end.size()) - end.size();
    head.append(room, 0, static_cast<std::size_t>(n));
    const std::size_t at = head.find(end, searched);
    if (at != std::string::npos) {
      head.resize(at + end.size());
      return head.size() <= BoundedServer::longest_head ? Head::complete : Head::too_long;
    }
    if (head.size() > BoundedServer::longest_head) return Head::too_long;
  }
  return Head::missing;
}

}  // namespace

BoundedServer::BoundedServer() {
  new_task_queue = [] { return new BoundedQueue; };  // NOLINT(cppcoreguidelines-owning-memory): the server owns it
}

template <class Own>
bool BoundedServer::answer(Own& server, httplib::Stream& connection) {
  bool closed = false;
  if constexpr (requires { server.process_request(connection, true, closed, nullptr); })  // cpp-httplib 0.11
    return server.process_request(connection, true, closed, nullptr);
  else
    return server.process_request(connection, local_address, 0, local_address, 0, true, closed, nullptr);
}

bool BoundedServer::process_and_close_socket(socket_t socket) {
  bool done = false;
  std::string head;
  const Head read = refusing ? Head::missing : read_head(socket, svr_sock_, head);
  if (read == Head::complete) {
    Connection connection(socket, std::move(head));
    done = answer(*this, connection);
  } else if (read == Head::too_long) {
    constexpr std::string_view answer =
        "HTTP/1.1 431 Request Header Fields Too Large\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";
    send(socket, answer.data(), answer.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }
  ::shutdown(socket, SHUT_RDWR);
  close(socket);
  return done;
}

}  // namespace bms::monitor
