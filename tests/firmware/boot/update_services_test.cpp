// The update server request by request: answers as ISO 14229-1 has them, written as bytes. Time is the test's.
#include "boot/update_server.hpp"

#include "boot/flash_map.hpp"
#include "tests/firmware/boot/bench.hpp"

namespace bms::boot {
namespace {

using Bytes = std::vector<std::uint8_t>;

class UpdateServices : public ::testing::Test, public UpdateSurroundings {
 protected:
  void SetUp() override {
    bench_.produce({.version = 0x000200, .security_version = 5, .seed = 7});
    container_ = image({.slot = 1, .version = 0x010203, .security_version = 5, .seed = 8});
    serve({});
  }
  void serve(const std::optional<authentication::Key>& device) {
    started_ = bench_.reset();
    std::optional<authentication::Key> service;
    if (device) service = authentication::role_key(*device, authentication::Role::service);
    server_.emplace(slots_, bench_.battery(), started_, service, *this);
  }
  Bytes ask(const Bytes& request) {
    std::array<std::uint8_t, UpdateServer::longest_answer> room{};
    const auto answer = server_->answer(request, room, now_us_);
    return {answer.begin(), answer.end()};
  }
  static Bytes refused(std::uint8_t service, std::uint8_t code) { return {0x7F, service, code}; }
  Refusal reason() { return static_cast<Refusal>(ask({0x22, 0xF1, 0xA4}).at(3)); }
  void open() {
    ASSERT_EQ(ask({0x10, 2}), (Bytes{0x50, 2, 0, 50, 1, 0xF4}));
    ASSERT_EQ(ask({0x27, 1}), (Bytes{0x67, 1, 0, 0, 0, 0, 0, 0})) << "no key, nothing to prove";
  }
  Bytes download(std::uint32_t address, std::uint32_t bytes) {
    Bytes out{0x34, 0, 0x44};
    for (const std::uint32_t word : {address, bytes}) {
      for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::uint8_t>(word >> shift));
    }
    return out;
  }
  Bytes download() { return download(application_slots[1], static_cast<std::uint32_t>(container_.size())); }
  Bytes piece(std::uint8_t sequence, std::size_t at, std::size_t bytes) const {
    Bytes out{0x36, sequence};
    for (std::size_t k = at; k < std::min(at + bytes, container_.size()); ++k)
      out.push_back(static_cast<std::uint8_t>(container_[k]));
    return out;
  }
  void send_all() {
    for (std::size_t at = 0, n = 1; at < container_.size(); at += 1'024, ++n)
      ASSERT_EQ(ask(piece(static_cast<std::uint8_t>(n), at, 1'024)), (Bytes{0x76, static_cast<std::uint8_t>(n)}));
  }
  bool at_rest() override { return rest_; }
  std::uint64_t challenge() override { return challenge_; }
  void restart() override { ++restarts_; }

  static inline const Bytes erase{0x31, 1, 0xFF, 0}, check{0x31, 1, 0xFF, 1}, leave{0x37}, reset{0x11, 1};
  Bench bench_;
  SlotsOfAnImage slots_{bench_.slots()};
  Start started_;
  std::optional<UpdateServer> server_;
  std::string container_;
  bool rest_ = true;
  std::uint64_t now_us_ = 1'000'000, challenge_ = 0xABCD'1234'5678'9ABC;
  int restarts_ = 0;
};

struct Exchange {
  Bytes request, answer;
};

TEST_F(UpdateServices, WithoutASessionRequestsHaveTheirAnswers) {
  for (const auto& [request, answer] : std::vector<Exchange>{
           {{}, {}},
           {{0x99}, refused(0x99, 0x11)},
           {{0x10}, refused(0x10, 0x13)},
           {{0x10, 1, 0}, refused(0x10, 0x13)},
           {{0x10, 0}, refused(0x10, 0x12)},
           {{0x10, 3}, refused(0x10, 0x12)},
           {{0x10, 1}, {0x50, 1, 0, 50, 1, 0xF4}},
           {{0x10, 0x81}, {}},
           {{0x27, 1}, refused(0x27, 0x22)},
           {{0x22, 0xF1}, refused(0x22, 0x13)},
           {{0x22, 0xF1, 0xA0, 0}, refused(0x22, 0x13)},
           {{0x22, 0xF1, 0xA2}, refused(0x22, 0x31)},
           {{0x22, 0xF1, 0xA0}, {0x62, 0xF1, 0xA0, 'b', 'o', 'a', 'r', 'd'}},
           {{0x22, 0xF1, 0xA4}, {0x62, 0xF1, 0xA4, 0}},
           {{0x3E}, refused(0x3E, 0x12)},
           {{0x3E, 1}, refused(0x3E, 0x12)},
           {{0x3E, 0}, {0x7E, 0}},
           {{0x3E, 0x80}, {}},
           {{0x31, 1, 0xFF, 0}, refused(0x31, 0x33)},
           {{0x22, 0xF1, 0xA4}, {0x62, 0xF1, 0xA4, static_cast<std::uint8_t>(Refusal::no_session)}},
       })
    EXPECT_EQ(ask(request), answer) << ::testing::PrintToString(request);
}

TEST_F(UpdateServices, WhatIsWrittenWronglyHasItsCode) {
  open();
  Bytes other_format = download(), longer = download();
  other_format[2] = 0x24;
  longer.push_back(0);
  Bytes compressed = download();
  compressed[1] = 0x11;
  for (const auto& [request, answer] : std::vector<Exchange>{
           {{0x31, 1, 0xFF}, refused(0x31, 0x13)},
           {{0x31, 1, 0xFF, 0, 1, 0}, refused(0x31, 0x13)},
           {{0x31, 1, 0xFF, 0, 0}, refused(0x31, 0x70)},  // no such kind
           {{0x31, 1, 0xFF, 0, 3}, refused(0x31, 0x70)},
           {{0x31, 2, 0xFF, 0}, refused(0x31, 0x12)},
           {{0x31, 1, 0xFF, 2}, refused(0x31, 0x31)},
           {{0x31, 1, 2, 3}, refused(0x31, 0x13)},
           {check, refused(0x31, 0x24)},
           {other_format, refused(0x34, 0x31)},
           {longer, refused(0x34, 0x31)},
           {compressed, refused(0x34, 0x31)},
           {piece(1, 0, 100), refused(0x36, 0x24)},
           {leave, refused(0x37, 0x24)},
           {{0x11}, refused(0x11, 0x12)},
           {{0x11, 3}, refused(0x11, 0x12)},
           {{0x11, 1, 0}, refused(0x11, 0x12)},
           {{0x27}, refused(0x27, 0x13)},
           {{0x27, 3}, refused(0x27, 0x12)},
           {{0x27, 1, 0}, refused(0x27, 0x13)},
           {{0x27, 2, 0, 0, 0, 0, 0}, refused(0x27, 0x13)},
           {{0x27, 2, 0, 0, 0, 0, 0, 0}, refused(0x27, 0x24)},
       })
    EXPECT_EQ(ask(request), answer) << ::testing::PrintToString(request);
  EXPECT_FALSE(server_->take_restart());
  ASSERT_EQ(ask(erase), (Bytes{0x71, 1, 0xFF, 0, 0}));
  ASSERT_EQ(ask(download()), (Bytes{0x74, 0x20, 4, 2}));  // blocks of 1,026 bytes with service and sequence
  EXPECT_EQ(ask({0x36, 1}), refused(0x36, 0x13));
  EXPECT_EQ(ask(piece(2, 0, 100)), refused(0x36, 0x73));
  EXPECT_EQ(ask(piece(0, 0, 100)), refused(0x36, 0x73)) << "no piece was sent that it could repeat";
  EXPECT_EQ(ask({0x37, 0}), refused(0x37, 0x24));
  EXPECT_EQ(server_->receiver().received(), 0U);
}

TEST_F(UpdateServices, AStepInDriveIsRefusedAndChangesNothing) {
  open();
  const auto in_drive = [&](const Bytes& request) {
    const auto before = std::pair(bench_.flash().bytes(0), bench_.flash().bytes(1));
    const std::uint32_t received = server_->receiver().received();
    rest_ = false;
    EXPECT_EQ(ask(request), refused(request[0], 0x22)) << ::testing::PrintToString(request);
    EXPECT_EQ(reason(), Refusal::not_at_rest);
    rest_ = true;
    EXPECT_FALSE(server_->take_restart());
    EXPECT_TRUE(std::pair(bench_.flash().bytes(0), bench_.flash().bytes(1)) == before);
    EXPECT_EQ(server_->receiver().received(), received);
    EXPECT_FALSE(read_marks(slots_, 1).complete);
  };
  in_drive(erase);
  ASSERT_EQ(ask(erase), (Bytes{0x71, 1, 0xFF, 0, 0}));
  in_drive(download());
  ASSERT_EQ(ask(download()).at(0), 0x74);
  in_drive(piece(1, 0, 1'024));
  send_all();
  in_drive(piece(static_cast<std::uint8_t>(container_.size() / 1'024 + 1), 0, 1'024));
  ASSERT_EQ(ask(leave), Bytes{0x77});
  in_drive(check);
  ASSERT_EQ(ask(check), (Bytes{0x71, 1, 0xFF, 1, 0}));
  EXPECT_TRUE(read_marks(slots_, 1).complete);
  rest_ = false;
  EXPECT_EQ(ask(reset), refused(0x11, 0x22));
  EXPECT_FALSE(server_->take_restart());
  rest_ = true;
  EXPECT_EQ(ask(reset), (Bytes{0x51, 1}));
  EXPECT_TRUE(server_->take_restart());
  EXPECT_FALSE(server_->take_restart()) << "once";
}

TEST_F(UpdateServices, ARepeatedPieceIsWrittenOnceAlsoAfterTheSequenceHasWrapped) {
  open();
  ASSERT_EQ(ask(erase).at(0), 0x71);
  ASSERT_EQ(ask(download()).at(0), 0x74);
  std::size_t at = 0;
  for (std::size_t n = 1; at < container_.size(); ++n, at += 40) {
    const auto sequence = static_cast<std::uint8_t>(n);
    for (int times = 0; times < 2; ++times) ASSERT_EQ(ask(piece(sequence, at, 40)), (Bytes{0x76, sequence})) << n;
    ASSERT_EQ(server_->receiver().received(), std::min(at + 40, container_.size()));
  }
  ASSERT_GT(at / 40, 256U);
  EXPECT_EQ(ask(leave), Bytes{0x77});
  EXPECT_EQ(ask(leave), refused(0x37, 0x24));
  EXPECT_EQ(ask(check), (Bytes{0x71, 1, 0xFF, 1, 0}));
  EXPECT_EQ(ask(check), refused(0x31, 0x24)) << "checked once";
}

TEST_F(UpdateServices, ADownloadBeginsWhereTheFreeSlotOrTheTransferDoes) {
  const auto size = static_cast<std::uint32_t>(container_.size());
  open();
  ASSERT_EQ(ask(erase).at(0), 0x71);
  const auto not_accepted = [&](std::uint32_t address, Refusal why) {
    EXPECT_EQ(ask(download(address, size)), refused(0x34, 0x70)) << address;
    EXPECT_EQ(reason(), why) << address;
  };
  not_accepted(application_slots[0], Refusal::not_from_the_other_slot);
  not_accepted(application_slots[1] + 1, Refusal::incomplete);
  EXPECT_EQ(ask(download(application_slots[1], header_bytes)), refused(0x34, 0x70));
  EXPECT_EQ(reason(), Refusal::incomplete);
  ASSERT_EQ(ask(download()).at(0), 0x74);
  ASSERT_EQ(ask(piece(1, 0, 1'000)), (Bytes{0x76, 1}));
  not_accepted(application_slots[1] + 999, Refusal::incomplete);
  not_accepted(application_slots[0] + 1'000, Refusal::incomplete);
  ASSERT_EQ(ask(download(application_slots[1] + 1'000, size)).at(0), 0x74);
  for (std::size_t at = 1'000, n = 1; at < size; at += 1'000, ++n)
    ASSERT_EQ(ask(piece(static_cast<std::uint8_t>(n), at, 1'000)).at(0), 0x76);
  ASSERT_EQ(ask(leave), Bytes{0x77});
  EXPECT_EQ(ask(check), (Bytes{0x71, 1, 0xFF, 1, 0}));
}

TEST_F(UpdateServices, ARefusedPieceEndsTheTransfer) {
  container_[header_bytes + 5] ^= 1;
  open();
  ASSERT_EQ(ask(erase).at(0), 0x71);
  ASSERT_EQ(ask(download()).at(0), 0x74);
  Bytes answer;
  std::uint8_t n = 1;
  for (std::size_t at = 0; answer.empty() || answer[0] == 0x76; at += 1'024, ++n) answer = ask(piece(n, at, 1'024));
  EXPECT_EQ(answer, refused(0x36, 0x70));
  EXPECT_EQ(reason(), Refusal::block_damaged);
  EXPECT_EQ(ask(piece(n, 0, 1'024)), refused(0x36, 0x24));
  EXPECT_EQ(ask(leave), refused(0x37, 0x24));
  EXPECT_EQ(ask(check), refused(0x31, 0x24));
}

TEST_F(UpdateServices, ASessionEndsAfterFiveSecondsAndWhatArrivedStays) {
  open();
  ASSERT_EQ(ask(erase).at(0), 0x71);
  ASSERT_EQ(ask(download()).at(0), 0x74);
  for (std::uint8_t n = 1; n <= 3; ++n) {
    now_us_ += 5'000'000;
    ASSERT_EQ(ask(piece(n, 1'024 * (n - 1U), 1'024)), (Bytes{0x76, n}));
  }
  now_us_ += 5'000'001;
  EXPECT_EQ(ask(piece(4, 3'072, 1'024)), refused(0x36, 0x33));
  EXPECT_EQ(reason(), Refusal::no_session);
  open();
  EXPECT_EQ(ask(piece(4, 3'072, 1'024)), refused(0x36, 0x24)) << "the download ended with the session";
  Bytes resume{0x31, 1, 2, 3};
  for (const std::uint8_t byte : sha256(bytes_of(container_).first(header_bytes))) resume.push_back(byte);
  EXPECT_EQ(ask(resume), (Bytes{0x71, 1, 2, 3, 0, 0, 0x0C, 0}));
  resume.back() ^= 1;
  EXPECT_EQ(ask(resume), (Bytes{0x71, 1, 2, 3, 0, 0, 0, 0})) << "of another container nothing has arrived";
}

TEST_F(UpdateServices, AnImageThatCannotEraseAsksTheLoader) {
  slots_.may_erase = false;
  open();
  EXPECT_EQ(ask(erase), (Bytes{0x71, 1, 0xFF, 0, 1}));
  EXPECT_TRUE(server_->take_restart());
  EXPECT_FALSE(read_marks(slots_, 1).erased);
  slots_.may_erase = true;  // the loader
  EXPECT_FALSE(erase_if_asked(slots_, 0)) << "of the running slot nothing was asked";
  EXPECT_TRUE(erase_if_asked(slots_, 1));
  EXPECT_TRUE(read_marks(slots_, 1).erased);
  EXPECT_FALSE(erase_if_asked(slots_, 1)) << "the wish was erased with the slot";
  slots_.may_erase = false;
  EXPECT_EQ(ask(erase), (Bytes{0x71, 1, 0xFF, 0, 0}));
  EXPECT_FALSE(server_->take_restart());
}

TEST_F(UpdateServices, TheStateIsThatOfTheHeaderFile) {
  const Bytes state{0x22, 0xF1, 0xA1};
  now_us_ = std::uint64_t{0x0102'0304} * 1'000;
  EXPECT_EQ(ask(state), (Bytes{0x62, 0xF1, 0xA1, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0,
                               0,    5,    0,    0, 1, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4}));
  open();
  ASSERT_EQ(ask(erase).at(0), 0x71);
  ASSERT_EQ(ask(download()).at(0), 0x74);
  ASSERT_EQ(ask(piece(1, 0, 0x203)).at(0), 0x76);
  const Bytes receiving = ask(state);
  EXPECT_EQ(receiving.size(), 3 + state_record_bytes);
  EXPECT_EQ(Bytes(receiving.begin() + 22, receiving.begin() + 26), (Bytes{0, 0, 2, 3}));

  Start on_trial;
  on_trial.found = on_trial.trial = on_trial.returned = true;
  on_trial.slot = 1;
  on_trial.header.version = 0x0A0B'0C0D;
  on_trial.header.cell_hash = 0x1122'3344;
  on_trial.header.flags = flag_development;
  on_trial.refusal = Refusal::trial_failed;
  Battery development = bench_.battery();
  development.product = false;
  UpdateServer other(slots_, development, on_trial, std::nullopt, *this);
  std::array<std::uint8_t, UpdateServer::longest_answer> room{};
  const auto begin_of_state = [&](std::size_t bytes) {
    const auto answer = other.answer(state, room, now_us_);
    return Bytes(answer.begin() + 3, answer.begin() + 3 + static_cast<std::ptrdiff_t>(bytes));
  };
  EXPECT_EQ(begin_of_state(11), (Bytes{1, 1, 1, 10, 11, 12, 13, 0x11, 0x22, 0x33, 0x44}));
  EXPECT_EQ(begin_of_state(24).back(), 3);
  EXPECT_EQ(other.last_refusal(), Refusal::trial_failed);
  other.confirmed();
  EXPECT_EQ(begin_of_state(2), (Bytes{1, 0}));
  UpdateServer nothing_runs(slots_, development, {}, std::nullopt, *this);
  EXPECT_EQ(nothing_runs.answer(state, room, now_us_)[3], 0xFF);
  EXPECT_EQ(nothing_runs.receiver().target(), 0);
}

// ---- security access ----

class UpdateAccess : public UpdateServices {
 protected:
  static constexpr authentication::Key device{9, 8, 7};
  void SetUp() override {
    UpdateServices::SetUp();
    serve(device);
    ask({0x10, 2});
  }
  Bytes code(std::uint16_t operator_number, std::uint64_t challenge) {
    const authentication::Cmac service(authentication::role_key(device, authentication::Role::service));
    const std::uint32_t code = authentication::session_code(service, challenge, operator_number);
    Bytes out{0x27, 2, static_cast<std::uint8_t>(operator_number >> 8), static_cast<std::uint8_t>(operator_number)};
    for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::uint8_t>(code >> shift));
    return out;
  }
  Bytes wrong() {
    ask({0x27, 1});
    Bytes answer = code(0x0203, 0x1234'5678'9ABC);
    answer.back() ^= 1;
    return ask(answer);
  }
};

TEST_F(UpdateAccess, TheChallengeHas48BitsAndTheCodeOpensOnce) {
  EXPECT_EQ(ask({0x27, 1}), (Bytes{0x67, 1, 0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC}));
  EXPECT_EQ(ask(erase), refused(0x31, 0x33));
  EXPECT_EQ(ask(code(0x0203, 0x1234'5678'9ABC)), (Bytes{0x67, 2}));
  EXPECT_EQ(ask({0x27, 1}), (Bytes{0x67, 1, 0, 0, 0, 0, 0, 0})) << "it is open already";
  EXPECT_EQ(ask(code(0x0203, 0x1234'5678'9ABC)), refused(0x27, 0x24));
  EXPECT_EQ(ask(erase).at(0), 0x71);
  ask({0x10, 1});
  EXPECT_EQ(ask(erase), refused(0x31, 0x33)) << "the default session closes it";
}

TEST_F(UpdateAccess, ATestersPresenceKeepsTheChallengeAndTheEndOfTheSessionDoesNot) {
  ask({0x27, 1});
  now_us_ += 5'000'000;
  EXPECT_EQ(ask({0x3E, 0x80}), Bytes{});
  now_us_ += 5'000'000;
  EXPECT_EQ(ask(code(1, 0x1234'5678'9ABC)), (Bytes{0x67, 2}));
  now_us_ += 5'000'001;
  EXPECT_EQ(ask({0x27, 1}), refused(0x27, 0x22));
  ask({0x10, 2});
  ask({0x27, 1});
  ask({0x10, 2});
  EXPECT_EQ(ask(code(1, 0x1234'5678'9ABC)), refused(0x27, 0x24)) << "of the session before";
}

TEST_F(UpdateAccess, ThreeWrongCodesLockForTenMinutesThenEachFurtherOneDoes) {
  EXPECT_EQ(wrong(), refused(0x27, 0x35));
  EXPECT_EQ(wrong(), refused(0x27, 0x35));
  EXPECT_EQ(wrong(), refused(0x27, 0x36));
  const auto keep_open_until = [&](std::uint64_t us) {
    for (; us - now_us_ > 5'000'000; ask({0x3E, 0x80})) now_us_ += 5'000'000;
    now_us_ = us;
  };
  for (int times = 0; times < 2; ++times) {
    const std::uint64_t locked = now_us_;
    keep_open_until(locked + 599'999'999);
    EXPECT_EQ(ask({0x27, 1}), refused(0x27, 0x37));
    EXPECT_EQ(ask(code(1, 0x1234'5678'9ABC)), refused(0x27, 0x37));
    now_us_ = locked + 600'000'000;
    if (times == 0) {
      EXPECT_EQ(wrong(), refused(0x27, 0x36));
    } else {
      ask({0x27, 1});
      EXPECT_EQ(ask(code(1, 0x1234'5678'9ABC)), (Bytes{0x67, 2}));
    }
  }
  ask({0x10, 2});
  EXPECT_EQ(wrong(), refused(0x27, 0x35)) << "a right code forgets the wrong ones";
  EXPECT_EQ(wrong(), refused(0x27, 0x35));
}

// ---- server and transport together ----

TEST_F(UpdateServices, WhatTakesLongIsAnnouncedAndTheRestartFollowsItsAnswer) {
  UpdateNode node(*server_, *this);
  const auto first_bytes = [&](const Bytes& request) {
    can::Frame frame{update_request_id, static_cast<std::uint8_t>(request.size() + 1), {}};
    frame.data[0] = static_cast<std::uint8_t>(request.size());
    std::ranges::copy(request, frame.data.begin() + 1);
    node.receive(frame, now_us_);
    std::vector<Bytes> out;
    while (node.next_frame(frame, now_us_)) {
      EXPECT_EQ(frame.id, update_response_id);
      out.emplace_back(frame.data.begin() + 1, frame.data.begin() + 1 + std::min<int>(frame.data[0], 7));
    }
    return out;
  };
  using Answers = std::vector<Bytes>;
  open();
  EXPECT_EQ(first_bytes(erase), (Answers{refused(0x31, 0x78), {0x71, 1, 0xFF, 0, 0}}));
  EXPECT_EQ(first_bytes(check), (Answers{refused(0x31, 0x78), refused(0x31, 0x24)}));
  EXPECT_EQ(first_bytes({0x31, 1, 2, 3}), Answers{refused(0x31, 0x13)});
  EXPECT_EQ(first_bytes({0x3E, 0}), (Answers{{0x7E, 0}}));
  EXPECT_EQ(first_bytes({0x3E, 0x80}), Answers{});
  EXPECT_EQ(restarts_, 0);
  EXPECT_EQ(first_bytes(reset), (Answers{{0x51, 1}}));
  EXPECT_EQ(restarts_, 1);
}

}  // namespace
}  // namespace bms::boot
