// A battery that loses its power during erase, transfer, check, start on trial and confirmation: one of the two images
// runs after every reset, completely as it was signed. The test knows what was sent; it asks neither the marks nor the
// checks of the code under test whether a slot is right.
#include "tests/firmware/boot/bench.hpp"

#if defined(BMS_UPDATE_POWER_CUTS)
constexpr int wanted_cuts = BMS_UPDATE_POWER_CUTS;  // tests/mutants
#elif defined(__SANITIZE_ADDRESS__)
constexpr int wanted_cuts = 300;  // with sanitizers: each cut checks signatures several times
#else
constexpr int wanted_cuts = 2'000;
#endif

namespace bms::boot {
namespace {

/// Images by version, signed once: signing and checking take most of the time.
const std::string& release(std::uint8_t slot, std::uint32_t version) {
  static std::map<std::pair<std::uint8_t, std::uint32_t>, std::string> all;
  auto& container = all[{slot, version}];
  if (container.empty())
    container = image({.slot = slot, .version = version, .security_version = version, .bytes = 4'500, .seed = version});
  return container;
}

/// Parts of an update and the steps of the flash in each: a cut hits each part equally often.
struct Phase {
  const char* name;
  unsigned steps;
};
constexpr Phase phases[] = {
    {"erase", 5}, {"transfer", 1 + (2'048 + 4'500) / 4}, {"complete", 2}, {"start", 2}, {"confirm", 2}};

class InterruptedUpdate {
 public:
  explicit InterruptedUpdate(unsigned seed) : random_(seed), bench_(seed) {
    bench_.produce(release(0, 1), 1);
    in_slot_[0] = release(0, 1);
    bench_.flash().reseed(seed);
  }

  void run(int& cuts, std::map<std::string, int>& by_phase) {
    for (std::uint32_t version = 2; version < 6 && !::testing::Test::HasFailure(); ++version) {
      for (int attempts = 0; attempts < 60 && running_version_ != version; ++attempts) {
        planned_ = phases[random_() % (std::size(phases) + 1) % std::size(phases)].name;
        try {
          update_to(version);
        } catch (const PowerCut&) {
          ++cuts;
          ++by_phase[std::string(phase_)];
        }
        bench_.flash().no_cut();
        // starts, some of which lose their power as well
        for (int boots = 0; boots < 2; ++boots) start(cuts, by_phase);
      }
      EXPECT_EQ(running_version_, version) << "the update never succeeded";
    }
  }

 private:
  void enter(std::string_view phase) {
    phase_ = phase;
    for (const Phase& p : phases) {
      if (phase == planned_ && phase == p.name) bench_.flash().cut_in(random_() % p.steps);
    }
  }

  void update_to(std::uint32_t version) {
    const auto target = static_cast<std::uint8_t>(1 - running_slot_);
    const std::string& container = release(target, version);
    Receiver receiver(bench_.slots(), bench_.battery(), running_slot_);
    enter("erase");
    const Refusal prepared = receiver.prepare();
    if (prepared == Refusal::not_confirmed) return;  // the trial goes on at the next start
    ASSERT_EQ(prepared, Refusal::none);
    enter("transfer");
    ASSERT_EQ(receiver.begin(static_cast<std::uint32_t>(container.size())), Refusal::none);
    ASSERT_EQ(receiver.take(bytes_of(container)), Refusal::none);
    in_slot_[target] = container;
    enter("complete");
    ASSERT_EQ(receiver.finish(), Refusal::none);
    enter("start");
    const Start start = bench_.reset(false);
    check_start(start);
    if (start.slot != target) return;
    enter("confirm");
    ASSERT_TRUE(confirm(bench_.slots(), target, version));
    confirmed_version_ = version;
  }

  void start(int& cuts, std::map<std::string, int>& by_phase) {
    phase_ = "start after a cut";
    if (random_() % 3 == 0) bench_.flash().cut_in(random_() % 3);
    Start start;
    try {
      start = bench_.reset(true);
      bench_.flash().no_cut();
    } catch (const PowerCut&) {
      ++cuts;
      ++by_phase[std::string(phase_)];
      return;
    }
    check_start(start);
    if (!start.trial || random_() % 4 == 0) return;  // this trial ends by a loss of power
    phase_ = "confirm after a cut";
    if (random_() % 3 == 0) bench_.flash().cut_in(random_() % 2);
    try {
      if (confirm(bench_.slots(), start.slot, start.header.security_version)) confirmed_version_ = running_version_;
    } catch (const PowerCut&) {
      ++cuts;
      ++by_phase[std::string(phase_)];
    }
    bench_.flash().no_cut();
  }

  /// What runs is byte for byte what was sent to this slot, and never older than what was confirmed. The test knows
  /// what was confirmed: a call of confirm() that came back.
  void check_start(const Start& start) {
    ASSERT_TRUE(start.found) << "no image runs after a cut in: " << phase_;
    const std::string& sent = in_slot_[start.slot];
    ASSERT_FALSE(sent.empty()) << "a slot runs that no transfer has filled";
    std::vector<std::uint8_t> bytes(sent.size());
    bench_.flash().read(start.slot, 0, bytes);
    ASSERT_TRUE(std::ranges::equal(bytes, bytes_of(sent)));
    running_slot_ = start.slot;
    running_version_ = start.header.version;
    ASSERT_GE(running_version_, confirmed_version_) << "older than the confirmed one, after a cut in: " << phase_;
  }

  std::mt19937 random_;
  Bench bench_;
  std::string in_slot_[2];
  std::uint8_t running_slot_ = 0;
  std::uint32_t running_version_ = 1, confirmed_version_ = 1;
  std::string_view phase_, planned_;
};

TEST(UpdatePowerCuts, OneOfTheTwoImagesRunsAfterEveryCut) {
  int cuts = 0;
  std::map<std::string, int> by_phase;
  for (unsigned seed = 1; cuts < wanted_cuts && !HasFailure(); ++seed) InterruptedUpdate(seed).run(cuts, by_phase);
  EXPECT_GE(cuts, wanted_cuts);
  for (const auto* phase : {"erase", "transfer", "complete", "start", "confirm", "start after a cut"})
    EXPECT_GT(by_phase[phase], 0) << phase;
  for (const auto& [phase, n] : by_phase) std::printf("%6d cuts: %s\n", n, phase.c_str());
}

}  // namespace
}  // namespace bms::boot
