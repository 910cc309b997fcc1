#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "monitor/frame_source.hpp"

namespace bms::monitor {

namespace {

constexpr int receive_buffer_bytes = 8 << 20;  // about 10,000 frames, one second of a fully loaded bus
constexpr std::uint8_t fd_flag_mask = 15;

/// A raw socket that reads many frames per system call.
class SocketCan : public FrameSource {
 public:
  explicit SocketCan(const std::string& interface) {
    const unsigned index = interface.size() < IFNAMSIZ ? if_nametoindex(interface.c_str()) : 0;
    if (index == 0)
      throw SourceError(
          interface, 1,
          "no such network interface, expected a CAN interface that is up (ip link), slcan:DEVICE or file:DUMP.log");
    fd_ = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    if (fd_ < 0) reject(interface, "this machine has no CAN sockets, expected a kernel with can_raw");
    const int on = 1, bytes = receive_buffer_bytes;
    const can_err_mask_t all_errors = CAN_ERR_MASK;
    setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &all_errors, sizeof all_errors);
    setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    setsockopt(fd_, SOL_SOCKET, SO_TIMESTAMP, &on, sizeof on);
    setsockopt(fd_, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    if (setsockopt(fd_, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) != 0)
      setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(index);
    if (bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      reject(interface, "is not a CAN interface, expected one (ip -details link)");
    for (std::size_t k = 0; k < batch; ++k) {
      parts_[k] = {&frames_[k], sizeof frames_[k]};
      messages_[k].msg_hdr.msg_iov = &parts_[k];
      messages_[k].msg_hdr.msg_iovlen = 1;
    }
  }
  ~SocketCan() override { close(fd_); }
  SocketCan(const SocketCan&) = delete;
  SocketCan& operator=(const SocketCan&) = delete;

  std::size_t read(std::span<BusFrame> room, int wait_ms) override {
    pollfd p{fd_, POLLIN, 0};
    if (poll(&p, 1, wait_ms) <= 0) return 0;
    for (std::size_t k = 0; k < batch; ++k) {
      messages_[k].msg_hdr.msg_control = control_[k].data();
      messages_[k].msg_hdr.msg_controllen = control_[k].size();
    }
    const int n =
        recvmmsg(fd_, messages_.data(), static_cast<unsigned>(std::min(batch, room.size())), MSG_DONTWAIT, nullptr);
    if (n < 0 && errno == ENODEV) ended_ = true;  // the interface was removed; one that is down may come up again
    std::size_t taken = 0;
    for (int k = 0; k < n; ++k) taken += receive(static_cast<std::size_t>(k), room[taken]) ? 1U : 0U;
    return taken;
  }
  bool ended() const override { return ended_; }
  bool send(const can::Frame& frame) override {
    can_frame raw{};
    raw.can_id = frame.id | (frame.long_id ? CAN_EFF_FLAG : 0U);
    raw.can_dlc = frame.length;
    std::memcpy(raw.data, frame.data.data(), frame.length);
    return write(fd_, &raw, sizeof raw) == static_cast<ssize_t>(sizeof raw);
  }
  bool live() const override { return true; }

 private:
  static constexpr std::size_t batch = 64;

  [[noreturn]] void reject(const std::string& interface, const char* what) const {
    const std::string why = std::generic_category().message(errno);
    if (fd_ >= 0) close(fd_);
    throw SourceError(interface, 1, std::string(what) + " (" + why + ")");
  }

  static FrameKind kind_of(canid_t id, std::size_t bytes) {
    if ((id & CAN_ERR_FLAG) != 0) return FrameKind::error;
    if (bytes == CANFD_MTU) return FrameKind::fd;
    if ((id & CAN_RTR_FLAG) != 0) return FrameKind::remote;
    return (id & CAN_EFF_FLAG) != 0 ? FrameKind::extended : FrameKind::standard;
  }

  /// Returns false if message `k` is not a frame.
  bool receive(std::size_t k, BusFrame& frame) {
    const canfd_frame& raw = frames_[k];
    const std::size_t bytes = messages_[k].msg_len;
    if (bytes != CAN_MTU && bytes != CANFD_MTU) return false;
    frame = {};
    frame.time_us = time_and_drops(messages_[k].msg_hdr);
    const bool long_id = (raw.can_id & CAN_EFF_FLAG) != 0;
    frame.kind = kind_of(raw.can_id, bytes);
    frame.long_id = long_id && frame.kind != FrameKind::error;
    frame.id = raw.can_id & (long_id || frame.kind == FrameKind::error ? CAN_EFF_MASK : CAN_SFF_MASK);
    const bool is_fd = frame.kind == FrameKind::fd;
    frame.fd_flags = is_fd ? raw.flags & fd_flag_mask : 0;
    frame.length = std::min<std::uint8_t>(raw.len, is_fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN);
    if (frame.kind != FrameKind::remote) std::memcpy(frame.data.data(), raw.data, frame.length);
    return true;
  }

  std::int64_t time_and_drops(msghdr& header) {
    std::int64_t time_us = 0;
    for (cmsghdr* c = CMSG_FIRSTHDR(&header); c != nullptr; c = CMSG_NXTHDR(&header, c)) {
      if (c->cmsg_level != SOL_SOCKET) continue;
      if (c->cmsg_type == SO_TIMESTAMP) {
        timeval t{};
        std::memcpy(&t, CMSG_DATA(c), sizeof t);
        time_us = static_cast<std::int64_t>(t.tv_sec) * 1'000'000 + t.tv_usec;
      } else if (c->cmsg_type == SO_RXQ_OVFL) {
        std::uint32_t now = 0;
        std::memcpy(&now, CMSG_DATA(c), sizeof now);
        dropped_ += now - drops_seen_;  // unsigned: the kernel's counter wraps around
        drops_seen_ = now;
      }
    }
    return time_us != 0 ? time_us : clock_us();
  }

  int fd_ = -1;
  bool ended_ = false;
  std::uint32_t drops_seen_ = 0;
  std::array<canfd_frame, batch> frames_{};
  std::array<iovec, batch> parts_{};
  std::array<mmsghdr, batch> messages_{};
  struct alignas(cmsghdr) Control : std::array<char, 128> {};
  std::array<Control, batch> control_{};
};

}  // namespace

std::unique_ptr<FrameSource> open_socketcan(const std::string& interface) {
  return std::make_unique<SocketCan>(interface);
}

}  // namespace bms::monitor
