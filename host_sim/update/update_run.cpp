#include "update/update_run.hpp"

#include <algorithm>
#include <array>
#include <chrono>

#include <fmt/format.h>

#include "boot/flash_map.hpp"

namespace bms::update {

namespace {

using Clock = std::chrono::steady_clock;
using Bytes = Link::Bytes;

constexpr std::size_t piece_bytes = 1'024;
constexpr int most_tries = 5;
constexpr std::size_t earliest_state_bytes = 24;  // without the time since the start
constexpr std::uint8_t negative = 0x7F, pending = 0x78;

std::uint64_t now_us() {
  return static_cast<std::uint64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch()).count());
}

std::uint32_t big(const Bytes& bytes, std::size_t at, std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < size; ++k) value = value << 8 | bytes.at(at + k);
  return value;
}

void put(Bytes& to, std::uint32_t value, std::size_t size) {
  for (std::size_t k = size; k > 0; --k) to.push_back(static_cast<std::uint8_t>(value >> 8 * (k - 1)));
}

/// Bytes behind the service that a positive answer repeats. By them a late answer to a request that was sent again is
/// not taken for that to the next one.
std::size_t repeated(std::uint8_t service) {
  switch (service) {
    case 0x31:
      return 3;
    case 0x22:
      return 2;
    case 0x10:
    case 0x11:
    case 0x27:
    case 0x36:
      return 1;
    default:
      return 0;
  }
}
bool answers(const Bytes& answer, const Bytes& message) {
  const std::size_t n = repeated(message[0]);
  return answer[0] == (message[0] | 0x40) && answer.size() > n && message.size() > n &&
         std::equal(message.begin() + 1, message.begin() + 1 + static_cast<std::ptrdiff_t>(n), answer.begin() + 1);
}

/// What ends an update: the reason in words.
struct Refused {
  std::string reason;
};

class Update {
 public:
  Update(monitor::FrameSource& source, const UpdateWish& wish) : link_(source), wish_(wish) {}

  UpdateResult run() {
    const auto begin = Clock::now();
    try {
      const auto before = read_until_answered();  // it may be starting
      if (!before) throw Refused{"no battery answers, or it has no boot loader"};
      state_ = *before;
      result_.kind = kind();
      result_.from = version_text(state_.version);
      if (of_cell()) prepare_cell();
      choose();
      result_.to = of_cell() ? cell_text(chosen_->header.cell_hash) : version_text(chosen_->header.version);
      open_session();
      send();
      restart();
    } catch (const Refused& refused) {
      result_.reason = refused.reason;
    }
    result_.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    return result_;
  }

 private:
  boot::Kind kind() const { return wish_.containers.front().header.kind; }
  bool of_cell() const { return kind() == boot::Kind::cell; }
  static std::string cell_text(std::uint32_t hash) { return fmt::format("cell {:08x}", hash); }

  void prepare_cell() {
    const auto cell = read_cell_state(link_);
    if (!cell) throw Refused{"the firmware or the boot loader of this battery takes no cell constants by themselves"};
    cell_ = *cell;
    result_.from = cell_text(cell_.acting_hash);
    const boot::Header& header = wish_.containers.front().header;
    if (header.built_for_cell_hash != cell_.built_hash)
      throw Refused{fmt::format("{}: {:08x}, that of the battery {:08x}", words_for(boot::Refusal::other_cell_file),
                                header.built_for_cell_hash, cell_.built_hash)};
    if (header.cell_hash == cell_.acting_hash) throw Refused{"the battery uses these cell constants already"};
    if (const std::string why = wish_.gate(cell_.acting_hash); !why.empty()) throw Refused{why};
  }

  /// What no battery would accept is not sent.
  void choose() {
    const auto& running = of_cell() ? cell_.slot : state_.running;
    const std::uint8_t target = running == std::uint8_t{0} ? 1 : 0;
    for (const Container& c : wish_.containers) {
      if (c.header.slot == target) chosen_ = &c;
    }
    if (chosen_ == nullptr)
      throw Refused{fmt::format("the file has no image for slot {}, which is the free one", target == 0 ? "A" : "B")};
    if (chosen_->header.board_name() != state_.board)
      throw Refused{
          fmt::format("the image is for {}, the battery is a {}", chosen_->header.board_name(), state_.board)};
  }

  /// The positive answer; otherwise ends the update with the battery's reason.
  Bytes expect(const Bytes& message, int wait_ms = 1'500) {
    for (int tries = 0; tries < most_tries; ++tries) {
      const auto answer = link_.request(message, wait_ms);
      if (!answer) continue;
      if (answer->at(0) == (message[0] | 0x40)) return *answer;
      if (answer->size() == 3 && (*answer)[0] == negative) throw Refused{reason((*answer)[2])};
    }
    throw Refused{"the battery does not answer any more; send again, the transfer resumes"};
  }

  std::string reason(std::uint8_t code) {
    if (code == 0x35) return "the key is not that of this battery";
    if (code == 0x36 || code == 0x37) return "too many wrong keys; the battery accepts the next one after ten minutes";
    if (code == 0x22 || code == 0x70) {
      const auto why = link_.request({0x22, 0xF1, 0xA4});
      if (why && why->size() == 4) return std::string(boot::words_for(static_cast<boot::Refusal>((*why)[3])));
    }
    return fmt::format("the battery refuses with UDS response code {:#04x}", code);
  }

  void open_session() {
    expect({0x10, 0x02});
    const Bytes seed = expect({0x27, 0x01});
    const std::uint64_t challenge = static_cast<std::uint64_t>(big(seed, 2, 2)) << 32 | big(seed, 4, 4);
    if (challenge == 0) return;
    if (!wish_.device_key) throw Refused{"the battery wants its key, give it with --key"};
    const authentication::Cmac service(authentication::role_key(*wish_.device_key, authentication::Role::service));
    Bytes answer{0x27, 0x02};
    put(answer, wish_.operator_number, 2);
    put(answer, authentication::session_code(service, challenge, wish_.operator_number), 4);
    expect(answer);
  }

  /// Bytes that the battery has of this container already, after a lost connection.
  std::uint32_t resumed() {
    Bytes ask{0x31, 0x01, 0x02, 0x03};
    const auto header = chosen_->header_bytes();
    for (const std::uint8_t byte : boot::sha256(header)) ask.push_back(byte);
    return big(expect(ask), 4, 4);
  }

  /// After its start a battery does not know that it rests before its first sample.
  Bytes expect_at_rest(const Bytes& message) {
    for (const auto end = Clock::now() + std::chrono::duration<double>(wish_.sample_wait_s);;) {
      try {
        return expect(message, 10'000);
      } catch (const Refused& refused) {
        if (refused.reason != boot::words_for(boot::Refusal::not_at_rest) || Clock::now() > end) throw;
      }
      link_.request({0x3E, 0x80}, 200);  // has no answer, and keeps the session
    }
  }

  /// A battery that protects cannot erase: it restarts, its loader erases, and the request is repeated.
  void erase() {
    Bytes ask{0x31, 0x01, 0xFF, 0x00};
    if (of_cell()) ask.push_back(static_cast<std::uint8_t>(boot::Kind::cell));
    for (int tries = 0; tries < 2; ++tries) {
      if ((tries == 0 ? expect(ask, 10'000) : expect_at_rest(ask)).at(4) == 0) return;
      const auto end = Clock::now() + std::chrono::seconds(20);
      auto back = read_state(link_);
      while (!back && Clock::now() < end) back = read_state(link_);
      if (!back) throw Refused{"the battery does not answer after its restart"};
      open_session();
    }
    throw Refused{"the battery could not erase the slot"};
  }

  void send() {
    const auto size = static_cast<std::uint32_t>(chosen_->bytes.size());
    std::uint32_t at = resumed();
    result_.resumed_at = at;
    if (at == 0) erase();
    Bytes download{0x34, 0x00, 0x44};
    put(download, boot::slot_begin(kind(), chosen_->header.slot) + at, 4);
    put(download, size, 4);
    expect(download);
    std::uint8_t sequence = 0;
    while (at < size) {
      const std::size_t bytes = std::min<std::size_t>(piece_bytes, size - at);
      Bytes piece{0x36, ++sequence};
      piece.insert(piece.end(), chosen_->bytes.begin() + at, chosen_->bytes.begin() + at + static_cast<long>(bytes));
      expect(piece);
      at += static_cast<std::uint32_t>(bytes);
      result_.sent += static_cast<std::uint32_t>(bytes);
      wish_.progress(at, size);
    }
    expect({0x37});
    expect({0x31, 0x01, 0xFF, 0x01}, 10'000);
  }

  std::optional<BatteryState> read_until_answered() {
    auto state = read_state(link_);
    for (int tries = 1; !state && tries < most_tries; ++tries) state = read_state(link_);
    return state;
  }

  /// Restarts the battery and reads what runs until the trial is over. A battery may answer before it restarts, and a
  /// drive that begins then keeps it from restarting: only a time since its start that went back shows the next one. Of
  /// a battery that does not state it another slot, a trial or a return shows it.
  void restart() {
    const auto before = read_until_answered();
    std::optional<CellState> cell_before;
    if (before && of_cell()) cell_before = read_cell_state(link_);
    if (!before || (of_cell() && !cell_before))
      throw Refused{"the battery does not answer any more; send again, the transfer resumes"};
    expect({0x11, 0x01});
    const auto begin = Clock::now();
    const auto end = begin + std::chrono::duration<double>(wish_.start_wait_s);
    const auto differs = [&](const BatteryState& now) {
      return now.running != before->running || now.trial != before->trial || now.returned != before->returned;
    };
    bool restarted = false;
    for (auto up_ms = before->up_ms; Clock::now() < end;) {
      const auto now = read_state(link_);
      restarted = restarted || (now && (up_ms && now->up_ms ? *now->up_ms < *up_ms : differs(*now)));
      if (now) up_ms = now->up_ms;
      if (now && cell_before) {
        if (const auto cell = read_cell_state(link_)) {
          restarted = restarted || differ(*cell_before, *cell);
          if (restarted && !cell->trial) return decide(*cell);
        }
      }
      if (now && !restarted && Clock::now() - begin > std::chrono::duration<double>(wish_.restart_wait_s))
        throw Refused{"the battery has not restarted: the image is complete and starts at its next restart"};
      if (now && restarted && !now->trial && !of_cell()) return decide(*now);
      wish_.pause();
    }
    throw Refused{restarted ? "the new image was started and has not confirmed itself yet"
                            : "the battery does not answer after its restart"};
  }

  /// Cell constants are sent within seconds after a restart, so the time since the next one may not be less.
  static bool differ(const CellState& a, const CellState& b) {
    return a.slot != b.slot || a.trial != b.trial || a.returned != b.returned || a.refusal != b.refusal;
  }

  void decide(const CellState& now) {
    if (now.acting_hash == chosen_->header.cell_hash) {
      result_.outcome = UpdateResult::Outcome::done;
      return;
    }
    result_.outcome = UpdateResult::Outcome::returned;
    result_.reason = now.refusal == boot::Refusal::none || now.refusal == boot::Refusal::trial_failed
                         ? "the battery did not confirm itself with the new cell constants"
                         : fmt::format("the new cell constants were not used: {}", boot::words_for(now.refusal));
    result_.reason += now.slot ? "; the old ones act again" : "; those of the firmware act again";
  }

  /// No image is on trial any more.
  void decide(const BatteryState& now) {
    if (now.running == chosen_->header.slot && now.version == chosen_->header.version) {
      result_.outcome = UpdateResult::Outcome::done;
      return;
    }
    result_.outcome = UpdateResult::Outcome::returned;
    const auto why = link_.request({0x22, 0xF1, 0xA4});
    const auto refusal = static_cast<boot::Refusal>(why && why->size() == 4 ? (*why)[3] : 0);
    result_.reason = refusal == boot::Refusal::none || refusal == boot::Refusal::trial_failed
                         ? "the new image did not confirm itself"
                         : fmt::format("the new image was not started: {}", boot::words_for(refusal));
    result_.reason += now.running ? "; the old one runs again" : "; no image runs";
  }

  Link link_;
  const UpdateWish& wish_;
  BatteryState state_;
  CellState cell_;
  const Container* chosen_ = nullptr;
  UpdateResult result_;
};

}  // namespace

const char* name_of(UpdateResult::Outcome outcome) {
  switch (outcome) {
    case UpdateResult::Outcome::done:
      return "done";
    case UpdateResult::Outcome::returned:
      return "returned";
    default:
      return "refused";
  }
}

void Link::pump(int wait_ms) {
  can::Frame frame;
  while (transport_.next_frame(frame, now_us())) {
    if (!source_.send(frame)) break;
  }
  if (arrived_.empty()) {
    std::array<monitor::BusFrame, 64> room{};
    const std::size_t n = source_.read(room, wait_ms);
    for (std::size_t k = 0; k < n; ++k) {
      if (room[k].kind == monitor::FrameKind::standard) arrived_.push_back(to_can_frame(room[k]));
    }
  }
  // "Response pending" and the response may come in one reading, and the transport has room for one message.
  for (; !arrived_.empty() && transport_.message().empty(); arrived_.pop_front())
    transport_.receive(arrived_.front(), now_us());
}

std::optional<Bytes> Link::request(const Bytes& message, int wait_ms) {
  transport_.taken();  // of an earlier request that was given up
  auto until = Clock::now() + std::chrono::milliseconds(wait_ms);
  transport_.send(message);
  while (Clock::now() < until && !source_.ended()) {
    pump(5);
    const auto answer = transport_.message();
    if (answer.empty()) continue;
    const Bytes bytes(answer.begin(), answer.end());
    transport_.taken();
    const bool negative_answer = bytes.size() == 3 && bytes[0] == negative;
    if (negative_answer && bytes[1] == message[0] && bytes[2] == pending) {
      until = Clock::now() + std::chrono::seconds(10);
      continue;
    }
    const bool ours = negative_answer ? bytes[1] == message[0] : answers(bytes, message);
    if (ours) return bytes;
  }
  return std::nullopt;
}

std::optional<BatteryState> read_state(Link& link) {
  const auto board = link.request({0x22, 0xF1, 0xA0});
  if (!board || board->size() < 4 || (*board)[0] != 0x62) return std::nullopt;
  const auto state = link.request({0x22, 0xF1, 0xA1});
  if (!state || state->size() < 3 + earliest_state_bytes || (*state)[0] != 0x62) return std::nullopt;
  BatteryState s;
  s.board.assign(board->begin() + 3, board->end());
  if ((*state)[3] < 2) s.running = (*state)[3];
  s.trial = (*state)[4] != 0;
  s.returned = (*state)[5] != 0;
  s.version = big(*state, 6, 4);
  s.cell_hash = big(*state, 10, 4);
  s.security_counter = big(*state, 14, 4);
  s.loader = big(*state, 18, 4);
  s.received = big(*state, 22, 4);
  s.development_image = ((*state)[26] & 1) != 0;
  s.accepts_development = ((*state)[26] & 2) != 0;
  if (state->size() >= 3 + boot::state_record_bytes) s.up_ms = big(*state, 27, 4);
  return s;
}

std::optional<CellState> read_cell_state(Link& link) {
  std::optional<Bytes> answer;
  for (int tries = 0; !answer && tries < most_tries; ++tries) answer = link.request({0x22, 0xF1, 0xA2});
  if (!answer || answer->size() < 3 + boot::cell_record_bytes || (*answer)[0] != 0x62) return std::nullopt;
  CellState s;
  if ((*answer)[3] < 2) s.slot = (*answer)[3];
  s.trial = (*answer)[4] != 0;
  s.returned = (*answer)[5] != 0;
  s.version = big(*answer, 6, 4);
  s.acting_hash = big(*answer, 10, 4);
  s.built_hash = big(*answer, 14, 4);
  s.security_counter = big(*answer, 18, 4);
  s.refusal = static_cast<boot::Refusal>((*answer)[22]);
  return s;
}

UpdateResult run_update(monitor::FrameSource& source, const UpdateWish& wish) { return Update(source, wish).run(); }

}  // namespace bms::update
