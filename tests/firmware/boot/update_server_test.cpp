// Whole updates between the tool's client and the battery's server, on a bus in memory that can lose frames.
#include "boot/update_server.hpp"

#include <chrono>

#include "boot/flash_map.hpp"
#include "tests/firmware/boot/bench.hpp"
#include "update/update_run.hpp"

namespace bms::boot {
namespace {

constexpr authentication::Key device{9, 8, 7};

/// A battery that restarts, runs what its slots say, and confirms a healthy image at its next answer.
class VirtualBattery final : public monitor::FrameSource, public UpdateSurroundings {
 public:
  VirtualBattery() {
    bench_.produce({.version = 0x000200, .security_version = 5, .seed = 7});
    bench_.battery();
    start(true);
  }

  bool rest = true, healthy = true;
  int requests_until_restart = 0;  ///< it still answers so many; -1: it does not restart
  bool states_its_time = true;     ///< since its start; the first update server does not
  int states_lost = 0;             ///< so many answers about its state, once the image is complete
  int frames_until_lost = -1;      ///< then the connection is lost once
  bool erases_itself = true;       ///< otherwise its loader does, at a restart
  int asked_before_a_sample = 0;   ///< so often after a start it does not know yet that it rests
  Bench& bench() { return bench_; }
  const UpdateServer& server() const { return *server_; }

  std::size_t read(std::span<monitor::BusFrame> room, int) override {
    std::size_t n = 0;
    can::Frame frame;
    while (n < room.size() && !lost_ && node_->next_frame(frame, now_us())) {
      // the answer of 31 bytes, or of 27: the length in its first frame
      const bool about_its_state = frame.data[0] == 0x10 && frame.data[2] == 0x62 && frame.data[4] == 0xA1;
      if (about_its_state && complete_ && states_lost > 0 && states_lost-- > 0) continue;
      if (about_its_state && !states_its_time) frame.data[1] = 27;
      room[n++] = monitor::to_bus_frame(frame, 0);
    }
    return n;
  }
  bool ended() const override { return lost_; }
  bool live() const override { return true; }
  bool send(const can::Frame& frame) override {
    if (frames_until_lost >= 0 && frames_until_lost-- == 0) lost_ = true;
    if (!lost_) node_->receive(frame, now_us());
    complete_ =
        complete_ || (frame.data[0] == 4 && frame.data[1] == 0x31 && frame.data[3] == 0xFF && frame.data[4] == 1);
    if (restart_in_ > 0 && frame.data[0] < 0x10 && --restart_in_ == 0) start(false);
    return !lost_;
  }
  void connect_again() { lost_ = false; }
  void power_cut() { start(true); }

 private:
  using Clock = std::chrono::steady_clock;
  std::uint64_t now_us() const {
    return static_cast<std::uint64_t>(
        std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - started_at_).count());
  }
  // UpdateSurroundings
  bool at_rest() override { return unmeasured_-- <= 0 && rest; }
  std::uint64_t challenge() override { return ++challenge_; }
  void restart() override {
    unmeasured_ = asked_before_a_sample;
    if (requests_until_restart == 0) start(false);
    restart_in_ = requests_until_restart;
  }
  void start(bool power_on) {
    started_ = bench_.reset(power_on);
    if (started_.trial && healthy) {
      confirm(bench_.slots(), started_.slot, started_.header.security_version);
      started_ = bench_.reset(true);
    } else if (started_.trial) {
      started_ = bench_.reset(false);  // its watchdog
    }
    slots_.may_erase = true;
    if (started_.found) erase_if_asked(slots_, static_cast<std::uint8_t>(1 - started_.slot));
    slots_.may_erase = erases_itself;
    server_ = std::make_unique<UpdateServer>(slots_, bench_.battery(), started_,
                                             authentication::role_key(device, authentication::Role::service), *this);
    next_node_ = std::make_unique<UpdateNode>(*server_, *this);
    node_.swap(next_node_);                                               // the old one may be the caller
    started_at_ = Clock::now() - std::chrono::minutes(power_on ? 1 : 0);  // then it waits for an update
  }

  Bench bench_;
  SlotsOfAnImage slots_{bench_.slots()};
  Start started_;
  std::unique_ptr<UpdateServer> server_;
  std::unique_ptr<UpdateNode> node_, next_node_;
  std::uint64_t challenge_ = 41;
  Clock::time_point started_at_{};
  int restart_in_ = 0, unmeasured_ = 0;
  bool lost_ = false, complete_ = false;
};

class UpdateServerTest : public ::testing::Test {
 protected:
  static update::UpdateWish wish(ImageWish w = {.slot = 1, .version = 0x000300, .security_version = 5, .seed = 8}) {
    update::UpdateWish out;
    out.containers = sign({payload_of({.slot = 0,
                                       .version = w.version,
                                       .security_version = w.security_version,
                                       .seed = w.seed,
                                       .board = w.board}),
                           payload_of(w)},
                          key_of(w.key));
    out.device_key = device;
    out.start_wait_s = 2;
    return out;
  }
  update::UpdateResult run(const update::UpdateWish& wish) { return run_update(battery_, wish); }
  std::vector<std::uint8_t> ask(update::Link& link, const std::vector<std::uint8_t>& request) {
    return link.request(request).value_or(std::vector<std::uint8_t>{});
  }
  using Outcome = update::UpdateResult::Outcome;
  using Bytes = std::vector<std::uint8_t>;

  VirtualBattery battery_;
};

TEST_F(UpdateServerTest, AnUpdateIsSentStartedAndConfirmed) {
  const auto result = run(wish());
  EXPECT_EQ(result.outcome, Outcome::done) << result.reason;
  EXPECT_EQ(result.from, "0.2.0");
  EXPECT_EQ(result.to, "0.3.0");
  const auto again = run(wish({.slot = 1, .version = 0x000400, .security_version = 5, .seed = 9}));
  EXPECT_EQ(again.outcome, Outcome::done) << again.reason << ": the next one goes to the other slot";
}

TEST_F(UpdateServerTest, AnImageThatDoesNotConfirmItselfIsReportedAsReturned) {
  battery_.healthy = false;
  const auto result = run(wish());
  EXPECT_EQ(result.outcome, Outcome::returned);
  EXPECT_EQ(battery_.bench().reset(true).slot, 0);
}

TEST_F(UpdateServerTest, AnswersFromBeforeTheRestartSayNothingAboutTheNewImage) {
  battery_.requests_until_restart = 5;
  auto w = wish();
  w.start_wait_s = 10;  // one answer is lost in the restart
  const auto result = run(w);
  EXPECT_EQ(result.outcome, Outcome::done) << result.reason;
}

TEST_F(UpdateServerTest, AnAnswerThatIsLostBeforeTheRestartIsNotTheRestart) {
  battery_.requests_until_restart = 9;
  battery_.states_lost = 1;
  auto w = wish();
  w.start_wait_s = 10;
  const auto result = run(w);
  EXPECT_EQ(result.outcome, Outcome::done) << result.reason;
}

TEST_F(UpdateServerTest, ABatteryThatDoesNotStateItsTimeIsUpdated) {
  battery_.states_its_time = false;
  EXPECT_EQ(run(wish()).outcome, Outcome::done);
  battery_.healthy = false;
  const auto result = run(wish({.slot = 0, .version = 0x000400, .security_version = 5, .seed = 9}));
  EXPECT_EQ(result.outcome, Outcome::returned) << result.reason;
}

TEST_F(UpdateServerTest, ABatteryThatDoesNotRestartIsNotSaidToHaveReturned) {
  battery_.requests_until_restart = -1;
  auto w = wish();
  w.start_wait_s = 10;
  const auto result = run(w);
  EXPECT_EQ(result.outcome, Outcome::refused);
  EXPECT_EQ(result.reason, "the battery has not restarted: the image is complete and starts at its next restart");
}

TEST_F(UpdateServerTest, ALostConnectionIsResumedWhereItEnded) {
  battery_.frames_until_lost = 900;
  const auto lost = run(wish());  // another signature, but the same container is sent again below
  EXPECT_EQ(lost.outcome, Outcome::refused);
  const auto w = wish({.slot = 1, .version = 0x000300, .security_version = 5, .seed = 10});
  battery_.connect_again();
  battery_.frames_until_lost = 900;
  EXPECT_EQ(run(w).outcome, Outcome::refused);
  battery_.connect_again();
  const auto resumed = run(w);
  EXPECT_EQ(resumed.outcome, Outcome::done) << resumed.reason;
  EXPECT_GE(resumed.resumed_at, 3'000U);
}

TEST_F(UpdateServerTest, ALossOfPowerDuringATransferBeginsItAgain) {
  const auto w = wish();
  battery_.frames_until_lost = 900;
  EXPECT_EQ(run(w).outcome, Outcome::refused);
  battery_.connect_again();
  battery_.power_cut();
  const auto result = run(w);
  EXPECT_EQ(result.outcome, Outcome::done) << result.reason;
  EXPECT_EQ(result.resumed_at, 0U);
}

TEST_F(UpdateServerTest, ATransferInDriveIsRefusedAndNothingChanges) {
  battery_.rest = false;
  const auto before = battery_.bench().flash().bytes(1);
  const auto result = run(wish());
  EXPECT_EQ(result.outcome, Outcome::refused);
  EXPECT_EQ(result.reason, words_for(Refusal::not_at_rest));
  EXPECT_EQ(battery_.bench().flash().bytes(1), before);
}

/// Before its first sample a battery does not know that it rests. A refusal right after the restart that erases
/// does not mean a drive.
TEST_F(UpdateServerTest, ABatteryThatRestartsToEraseIsWaitedForUntilItHasMeasured) {
  auto earlier = wish({.slot = 1, .version = 0x000250, .security_version = 5, .seed = 11});
  battery_.frames_until_lost = 1'200;
  EXPECT_EQ(run(earlier).outcome, Outcome::refused);
  battery_.connect_again();
  ASSERT_FALSE(read_marks(battery_.bench().slots(), 1).erased) << "nothing was written";
  battery_.erases_itself = false;
  battery_.power_cut();
  battery_.asked_before_a_sample = 3;
  const auto result = run(wish());
  EXPECT_EQ(result.outcome, Outcome::done) << result.reason;
}

TEST_F(UpdateServerTest, ADriveDuringATransferPausesItAndItIsResumedAtRest) {
  auto w = wish();
  w.progress = [&](std::uint32_t done, std::uint32_t) { battery_.rest = done < 5'000; };
  const auto paused = run(w);
  EXPECT_EQ(paused.outcome, Outcome::refused);
  EXPECT_EQ(paused.reason, words_for(Refusal::not_at_rest));
  battery_.rest = true;
  w.progress = [](std::uint32_t, std::uint32_t) {};
  const auto resumed = run(w);
  EXPECT_EQ(resumed.outcome, Outcome::done) << resumed.reason;
  EXPECT_GE(resumed.resumed_at, 5'000U);
}

TEST_F(UpdateServerTest, NoImageIsMadeTheNextOneToStartInDrive) {
  auto w = wish();
  w.progress = [&](std::uint32_t done, std::uint32_t of) { battery_.rest = done < of; };
  const auto paused = run(w);
  EXPECT_EQ(paused.outcome, Outcome::refused);
  EXPECT_EQ(paused.reason, words_for(Refusal::not_at_rest));
  EXPECT_FALSE(read_marks(battery_.bench().slots(), 1).complete);
  battery_.rest = true;
  const auto resumed = run(w);  // all bytes are there already
  EXPECT_EQ(resumed.outcome, Outcome::done) << resumed.reason;
  EXPECT_EQ(resumed.sent, 0U);
}

TEST_F(UpdateServerTest, EachRefusalArrivesInWords) {
  EXPECT_EQ(run(wish({.slot = 1, .security_version = 5, .seed = 8, .key = "somebody"})).reason,
            words_for(Refusal::unknown_key));
  EXPECT_EQ(run(wish({.slot = 1, .security_version = 4, .seed = 8})).reason, words_for(Refusal::older_security));
  EXPECT_NE(run(wish({.slot = 1, .security_version = 5, .board = "other"})).reason.find("the image is for other"),
            std::string::npos);
  auto keyless = wish();
  keyless.device_key.reset();
  EXPECT_NE(run(keyless).reason.find("--key"), std::string::npos);
  keyless.device_key = authentication::Key{1};
  EXPECT_NE(run(keyless).reason.find("not that of this battery"), std::string::npos);
  auto only_a = wish();
  only_a.containers.pop_back();
  EXPECT_NE(run(only_a).reason.find("slot B"), std::string::npos);
}

TEST_F(UpdateServerTest, NothingIsWrittenWithoutASession) {
  update::Link link(battery_);
  const auto before = battery_.bench().flash().bytes(1);
  for (const Bytes& request : {Bytes{0x31, 1, 0xFF, 0}, Bytes{0x34, 0, 0x44, 8, 6, 0, 0, 0, 0, 0x40, 0},
                               Bytes{0x36, 1, 1}, Bytes{0x37}, Bytes{0x11, 1}}) {
    EXPECT_EQ(ask(link, request), (Bytes{0x7F, request[0], 0x33}));
    ask(link, {0x10, 2});
    EXPECT_EQ(ask(link, request), (Bytes{0x7F, request[0], 0x33})) << "a session alone is not enough";
    ask(link, {0x10, 1});
  }
  EXPECT_EQ(battery_.bench().flash().bytes(1), before);
}

TEST_F(UpdateServerTest, AReplayedResponseOpensNothing) {
  update::Link link(battery_);
  ask(link, {0x10, 2});
  const Bytes seed = ask(link, {0x27, 1});
  ASSERT_EQ(seed.size(), 8U);
  const authentication::Cmac service(authentication::role_key(device, authentication::Role::service));
  const std::uint32_t code = authentication::session_code(service, seed[7], 0);  // challenges of this bench are small
  const Bytes response{0x27,
                       2,
                       0,
                       0,
                       static_cast<std::uint8_t>(code >> 24),
                       static_cast<std::uint8_t>(code >> 16),
                       static_cast<std::uint8_t>(code >> 8),
                       static_cast<std::uint8_t>(code)};
  EXPECT_EQ(ask(link, response), (Bytes{0x67, 2}));
  ask(link, {0x10, 2});
  ask(link, {0x27, 1});
  EXPECT_EQ(ask(link, response), (Bytes{0x7F, 0x27, 0x35}));
  EXPECT_EQ(ask(link, response), (Bytes{0x7F, 0x27, 0x24})) << "a challenge is used once";
}

TEST_F(UpdateServerTest, ThreeWrongKeysLockForTenMinutes) {
  update::Link link(battery_);
  ask(link, {0x10, 2});
  for (const std::uint8_t expected : {std::uint8_t{0x35}, std::uint8_t{0x35}, std::uint8_t{0x36}}) {
    ask(link, {0x27, 1});
    EXPECT_EQ(ask(link, {0x27, 2, 0, 0, 1, 2, 3, 4}), (Bytes{0x7F, 0x27, expected}));
  }
  EXPECT_EQ(ask(link, {0x27, 1}), (Bytes{0x7F, 0x27, 0x37}));
}

}  // namespace
}  // namespace bms::boot
