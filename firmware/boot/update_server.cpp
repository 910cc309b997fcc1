#include "boot/update_server.hpp"

#include "boot/flash_map.hpp"

namespace bms::boot {

namespace {

enum Code : std::uint8_t {  // ISO 14229-1, annex A
  service_unknown = 0x11,
  sub_function_unknown = 0x12,
  wrong_length = 0x13,
  conditions_not_correct = 0x22,
  wrong_order = 0x24,
  out_of_range = 0x31,
  access_denied = 0x33,
  wrong_key = 0x35,
  too_many_attempts = 0x36,
  delay_not_over = 0x37,
  not_accepted = 0x70,
  wrong_sequence = 0x73,
  pending = 0x78,
};

constexpr std::uint8_t negative = 0x7F, positive = 0x40, silent = 0x80;

std::uint32_t big(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < size; ++k) value = value << 8 | bytes[at + k];
  return value;
}

}  // namespace

class UpdateServer::Answer {
 public:
  Answer(std::span<std::uint8_t> room, std::uint8_t service) : room_(room), service_(service) {
    put(service | positive);
  }
  Answer& put(std::uint32_t value, std::size_t size = 1) {
    for (std::size_t k = size; k > 0; --k) room_[size_++] = static_cast<std::uint8_t>(value >> 8 * (k - 1));
    return *this;
  }
  void reject(Code code) {
    size_ = 0;
    put(negative).put(service_).put(code);
  }
  void nothing() { size_ = 0; }
  std::span<const std::uint8_t> bytes() const { return room_.first(size_); }

 private:
  std::span<std::uint8_t> room_;
  std::uint8_t service_;
  std::size_t size_ = 0;
};

bool UpdateServer::takes_long(std::span<const std::uint8_t> request) {
  if (request.size() < 4 || request[0] != 0x31) return false;
  return big(request, 2, 2) == 0xFF00 || big(request, 2, 2) == 0xFF01;
}

std::span<const std::uint8_t> UpdateServer::answer(std::span<const std::uint8_t> request, std::span<std::uint8_t> room,
                                                   std::uint64_t now_us) {
  if (request.empty()) return {};
  if (programming_ && now_us - since_us_ > session_us) {
    programming_ = unlocked_ = download_ = false;  // what was received stays: routine 0203
    challenge_ = 0;
  }
  since_us_ = now_us;
  Answer answer(room, request[0]);
  switch (request[0]) {
    case 0x10:
      session(request, answer, now_us);
      break;
    case 0x27:
      security(request, answer, now_us);
      break;
    case 0x22:
      read(request, answer);
      break;
    case 0x3E:
      if (request.size() != 2 || (request[1] & ~silent) != 0)
        answer.reject(sub_function_unknown);
      else if ((request[1] & silent) != 0)
        answer.nothing();
      else
        answer.put(0);
      break;
    case 0x31:
    case 0x34:
    case 0x36:
    case 0x37:
    case 0x11:
      if (!unlocked()) {
        refusal_ = Refusal::no_session;
        answer.reject(access_denied);
      } else {
        transfer(request, answer);
      }
      break;
    default:
      answer.reject(service_unknown);
  }
  return answer.bytes();
}

void UpdateServer::session(std::span<const std::uint8_t> request, Answer& answer, std::uint64_t) {
  if (request.size() != 2) return answer.reject(wrong_length);
  const std::uint8_t wanted = request[1] & static_cast<std::uint8_t>(~silent);
  if (wanted != 1 && wanted != 2) return answer.reject(sub_function_unknown);
  programming_ = wanted == 2;
  unlocked_ = download_ = false;
  challenge_ = 0;
  answer.put(wanted).put(50, 2).put(500, 2);  // P2 50 ms, P2* 5 s
  if ((request[1] & silent) != 0) answer.nothing();
}

void UpdateServer::security(std::span<const std::uint8_t> request, Answer& answer, std::uint64_t now_us) {
  if (!programming_) return answer.reject(conditions_not_correct);
  if (request.size() < 2) return answer.reject(wrong_length);
  if (wrong_ >= most_wrong_keys && now_us - locked_since_us_ < locked_us) return answer.reject(delay_not_over);
  if (request[1] == 1) {
    if (request.size() != 2) return answer.reject(wrong_length);
    challenge_ = key_ && !unlocked_ ? surroundings_.challenge() & authentication::challenge_mask : 0;
    answer.put(1).put(static_cast<std::uint32_t>(challenge_ >> 32), 2).put(static_cast<std::uint32_t>(challenge_), 4);
    return;
  }
  if (request[1] != 2) return answer.reject(sub_function_unknown);
  if (request.size() != 8) return answer.reject(wrong_length);
  if (challenge_ == 0) return answer.reject(wrong_order);
  const auto operator_number = static_cast<std::uint16_t>(big(request, 2, 2));
  const bool right = authentication::equal_codes(
      authentication::session_code(authentication::Cmac(*key_), challenge_, operator_number), big(request, 4, 4));
  challenge_ = 0;  // used once
  if (right) {
    unlocked_ = true;
    wrong_ = 0;
    answer.put(2);
  } else if (++wrong_ >= most_wrong_keys) {
    locked_since_us_ = now_us;
    answer.reject(too_many_attempts);
  } else {
    answer.reject(wrong_key);
  }
}

void UpdateServer::read(std::span<const std::uint8_t> request, Answer& answer) const {
  if (request.size() != 3) return answer.reject(wrong_length);
  const std::uint32_t what = big(request, 1, 2);
  answer.put(what, 2);
  switch (what) {
    case 0xF1A0:
      for (const char c : battery_.board) answer.put(static_cast<std::uint8_t>(c));
      return;
    case 0xF1A1:
      answer.put(started_.found ? started_.slot : 0xFF).put(started_.trial).put(started_.returned);
      answer.put(started_.header.version, 4).put(started_.header.cell_hash, 4).put(battery_.security_counter, 4);
      answer.put(battery_.loader_version, 4).put(receiver_.active() ? receiver_.received() : 0, 4);
      answer.put((started_.header.development() ? 1U : 0U) | (battery_.product ? 0U : 2U));
      answer.put(static_cast<std::uint32_t>(since_us_ / 1'000), 4);
      return;
    case 0xF1A2: {
      if (!cells_) return answer.reject(out_of_range);
      const Start& cell = cells_->started;
      answer.put(cell.found ? cell.slot : 0xFF).put(cell.trial).put(cell.returned);
      answer.put(cell.found ? cell.header.version : 0, 4);
      answer.put(cell.found ? cell.header.cell_hash : cells_->battery.cell_hash, 4).put(cells_->battery.cell_hash, 4);
      answer.put(cells_->battery.security_counter, 4).put(static_cast<std::uint8_t>(cell.refusal));
      return;
    }
    case 0xF1A4:
      answer.put(static_cast<std::uint8_t>(refusal_));
      return;
    default:
      answer.reject(out_of_range);
  }
}

void UpdateServer::refuse(Answer& answer, Refusal why) {
  refusal_ = why;
  const bool waits = why == Refusal::not_at_rest || why == Refusal::not_confirmed;
  answer.reject(waits ? conditions_not_correct : not_accepted);
}

/// Nothing if this battery has no slots of that kind.
std::optional<ReceiverTarget> UpdateServer::target_of(Kind kind) const {
  if (kind == Kind::application) return application_;
  if (kind != Kind::cell || !cells_) return std::nullopt;
  return ReceiverTarget{&cells_->flash, &cells_->battery, running_slot(cells_->started)};
}

Refusal UpdateServer::erase(Kind kind) {
  const auto to = target_of(kind);
  if (!to) return Refusal::other_kind;
  if (!surroundings_.at_rest()) return Refusal::not_at_rest;
  if (may_not_begin(kind)) return Refusal::not_confirmed;
  download_ = exited_ = false;
  if (kind != receiver_.kind()) receiver_.aim_at(*to);
  completed_.reset();
  return receiver_.prepare();
}

void UpdateServer::routine(std::span<const std::uint8_t> request, Answer& answer) {
  if (request.size() < 4) return answer.reject(wrong_length);
  if (request[1] != 1) return answer.reject(sub_function_unknown);
  const std::uint32_t which = big(request, 2, 2);
  answer.put(1).put(which, 2);
  if (which == 0x0203) {
    if (request.size() != 36) return answer.reject(wrong_length);
    Digest digest{};
    std::ranges::copy(request.subspan(4), digest.begin());
    answer.put(receiver_.resume(digest), 4);
    return;
  }
  if (request.size() != 4 && (request.size() != 5 || which != 0xFF00)) return answer.reject(wrong_length);
  Refusal why = Refusal::none;
  if (which == 0xFF00) {
    why = erase(request.size() == 5 ? static_cast<Kind>(request[4]) : Kind::application);
  } else if (which == 0xFF01) {
    if (!exited_) return answer.reject(wrong_order);
    if (!surroundings_.at_rest()) return refuse(answer, Refusal::not_at_rest);
    exited_ = false;
    why = receiver_.finish();
    if (why == Refusal::none) completed_ = receiver_.kind();
  } else {
    return answer.reject(out_of_range);
  }
  restart_ = why == Refusal::erase_at_restart;
  if (why != Refusal::none && !restart_) return refuse(answer, why);
  answer.put(restart_ ? 1 : 0);
}

void UpdateServer::request_download(std::span<const std::uint8_t> request, Answer& answer) {
  if (request.size() != 11 || request[1] != 0 || request[2] != 0x44) return answer.reject(out_of_range);
  if (!surroundings_.at_rest()) return refuse(answer, Refusal::not_at_rest);
  const std::uint32_t address = big(request, 3, 4), bytes = big(request, 7, 4);
  const Kind kind = address >= cell_slots[0] ? Kind::cell : Kind::application;
  const auto to = target_of(kind);
  if (!to) return refuse(answer, Refusal::other_kind);
  const std::uint32_t begin = slot_begin(kind, to->slot());
  const bool goes_on = kind == receiver_.kind() && receiver_.active() && receiver_.received() > 0 &&
                       address == begin + receiver_.received();
  if (address == begin) {
    if (may_not_begin(kind)) return refuse(answer, Refusal::not_confirmed);
    if (kind != receiver_.kind()) receiver_.aim_at(*to);
    if (const Refusal why = receiver_.begin(bytes); why != Refusal::none) return refuse(answer, why);
  } else if (!goes_on) {
    const bool other = address == slot_begin(kind, static_cast<std::uint8_t>(1 - to->slot()));
    return refuse(answer, other ? Refusal::not_from_the_other_slot : Refusal::incomplete);
  }
  exited_ = false;
  download_ = true;
  blocks_ = 0;
  answer.put(0x20).put(IsoTp::longest, 2);
}

void UpdateServer::transfer(std::span<const std::uint8_t> request, Answer& answer) {
  switch (request[0]) {
    case 0x31:
      return routine(request, answer);
    case 0x34:
      return request_download(request, answer);
    case 0x36: {
      if (!download_) return answer.reject(wrong_order);
      if (request.size() < 3) return answer.reject(wrong_length);
      // A drive always comes first. What was received stays: the transfer goes on when the truck rests again.
      if (!surroundings_.at_rest()) return refuse(answer, Refusal::not_at_rest);
      if (blocks_ > 0 &&
          request[1] == static_cast<std::uint8_t>(blocks_)) {  // the answer was lost: sent again, written once
        answer.put(request[1]);
        return;
      }
      if (request[1] != static_cast<std::uint8_t>(blocks_ + 1)) return answer.reject(wrong_sequence);
      if (const Refusal why = receiver_.take(request.subspan(2)); why != Refusal::none) {
        download_ = false;
        return refuse(answer, why);
      }
      ++blocks_;
      answer.put(request[1]);
      return;
    }
    case 0x37:
      if (!download_ || request.size() != 1) return answer.reject(wrong_order);
      download_ = false;
      exited_ = true;
      return;
    default:
      if (request.size() != 2 || request[1] != 1) return answer.reject(sub_function_unknown);
      if (!surroundings_.at_rest()) return refuse(answer, Refusal::not_at_rest);
      restart_ = true;
      answer.put(1);
  }
}

bool UpdateNode::next_frame(can::Frame& frame, std::uint64_t now_us) {
  if (transport_.next_frame(frame, now_us)) return true;
  if (transport_.sending()) return false;
  if (server_.take_restart()) {
    surroundings_.restart();
    return false;
  }
  const auto request = transport_.message();
  if (request.empty()) return false;
  if (UpdateServer::takes_long(request) && !pending_sent_) {
    const std::array<std::uint8_t, 3> wait{negative, request[0], pending};
    pending_sent_ = transport_.send(wait);
    return transport_.next_frame(frame, now_us);
  }
  pending_sent_ = false;
  std::array<std::uint8_t, UpdateServer::longest_answer> room{};
  const auto bytes = server_.answer(request, room, now_us);
  transport_.taken();
  transport_.send(bytes);
  return transport_.next_frame(frame, now_us);
}

}  // namespace bms::boot
