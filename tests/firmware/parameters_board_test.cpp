// The parameters in the forklift board's image, on the model of its CAN controller: the client of `bms parameters` sets
// them, and after the next start the board is on the bus with their bit rate and identifiers.
#include <array>

#include "monitor/parameters.hpp"
#include "monitor/service_client.hpp"
#include "tests/firmware/bxcan_board.hpp"

namespace bms::firmware {
namespace {

using monitor::ReceivedParameters;
using monitor::ServiceClient;

/// A board on a bus whose identifiers are those of these parameters; a sample every 100 ms.
class ParameterBench {
 public:
  ParameterBench(const std::vector<std::uint8_t>& flash, unsigned bit_rate, std::uint16_t base = 0x180,
                 std::uint16_t stop = 0x0A0)
      : base_(base), stop_(stop) {
    board_.flash.bytes = flash;
    board_.can.bits_per_second = bit_rate;
  }
  ~ParameterBench() { EXPECT_THAT(board_.can.violations, IsEmpty()); }
  ParameterBench(const ParameterBench&) = delete;
  ParameterBench& operator=(const ParameterBench&) = delete;

  bool listens() {
    return board_.run_until([&] { return board_.can.on_the_bus(); }, 400);
  }
  /// frames: with the identifiers of the DBC file.
  void sample(const std::vector<can::Frame>& frames = {}) {
    for (can::Frame f : frames) {
      f.id = f.id == 0x0A0 ? stop_ : f.id - 0x180 + base_;
      board_.can.others.push_back({wire_frame(f), board_.can.now_bit, true});
    }
    Pack pack;
    pack.time_us = 100'000 * ++samples_;
    pack.current_ua = current_ua;
    pack.cell_uv.fill(cell_uv + static_cast<std::int32_t>(samples_ % 3) * 300);
    pack.pack_uv = static_cast<std::int32_t>(Pack::cells) * pack.cell_uv[0];
    pack.temperature_cdegc.fill(2'500);
    for (const can::Frame& f : hal::frames_of(pack, 0, static_cast<std::uint16_t>(samples_), 0))
      board_.can.others.push_back({wire_frame(f), board_.can.now_bit, true});
    board_.run_for_ms(100);
  }
  /// New frames of the board since the last call, with the identifiers of the DBC file.
  std::vector<can::Frame> received() {
    std::vector<can::Frame> frames;
    for (; seen_ < board_.can.seen.size(); ++seen_) {
      const SeenFrame& s = board_.can.seen[seen_];
      if (!s.from_board) continue;
      frames.push_back(s.frame);
      EXPECT_TRUE(s.frame.id >= base_ && s.frame.id < base_ + 0x40U) << s.frame.id;
      frames.back().id = s.frame.id - base_ + 0x180;
    }
    return frames;
  }
  template <class Message>
  std::optional<Message> last() {
    std::optional<Message> found;
    for (const can::Frame& f : received()) {
      if (f.id == Message::id) found = Message::of(f);
    }
    return found;
  }
  std::vector<std::int32_t> read() {
    ReceivedParameters all;
    received();
    sample({ReceivedParameters::request(counter_ = can::next(counter_))});
    for (int k = 0; k < 40 && !all.complete(); ++k) {
      for (const can::Frame& f : received()) all.receive(f);
      sample();
    }
    EXPECT_TRUE(all.complete());
    return all.raw();
  }
  ServiceClient::State change(const std::vector<std::int32_t>& wanted) {
    ServiceClient client({}, 42, monitor::commands_to_set(read(), wanted));
    for (int k = 0; k < 200 && client.state() == ServiceClient::State::working; ++k) {
      sample(client.due(1e-3 * board_.now_ms()));
      for (const can::Frame& f : received()) client.receive(f, 1e-3 * board_.now_ms());
    }
    return client.state();
  }
  const std::vector<std::uint8_t>& flash() const { return board_.flash.bytes; }

  std::int32_t cell_uv = 3'280'000, current_ua = 0;

 private:
  UnicornBoard board_{image()};
  std::uint16_t base_, stop_;
  std::uint64_t samples_ = 0;
  std::size_t seen_ = 0;
  std::uint8_t counter_ = 0;
};

/// The flash of a new chip after its first start with the cell file of the image.
const std::vector<std::uint8_t>& new_flash() {
  table9();
  return started_once();
}

std::int32_t& at(std::vector<std::int32_t>& raw, const char* name) {
  return raw[monitor::find_parameter(name)->number - 1U];
}

TEST(ParametersBoard, SetsLimitsAndABitRateThatTheNextStartHas) {
  std::vector<std::uint8_t> flash = new_flash();
  unsigned bit_rate = 250'000;
  std::uint16_t base = 0x180, stop = 0x0A0;
  const struct {
    std::int32_t rate_kbit_s, base, stop;
  } steps[] = {{500, 0x500, 0x051}, {1'000, 0x180, 0x0A0}, {125, 0x680, 0x001}, {250, 0x180, 0x0A0}};
  for (const auto& next : steps) {
    ParameterBench bench(flash, bit_rate, base, stop);
    ASSERT_TRUE(bench.listens()) << bit_rate;
    for (int k = 0; k < 3; ++k) bench.sample();
    EXPECT_TRUE(bench.last<can::PackState>()) << bit_rate;
    auto wanted = bench.read();
    EXPECT_EQ(1'000U * static_cast<unsigned>(at(wanted, "can_bit_rate")), bit_rate);
    at(wanted, "can_bit_rate") = next.rate_kbit_s;
    at(wanted, "can_base") = next.base;
    at(wanted, "can_stop") = next.stop;
    at(wanted, "cell_voltage_max") -= 50;
    ASSERT_EQ(bench.change(wanted), ServiceClient::State::done);
    EXPECT_EQ(bench.read(), wanted) << "still with the old bit rate";
    flash = bench.flash();
    bit_rate = 1'000U * static_cast<unsigned>(next.rate_kbit_s);
    base = static_cast<std::uint16_t>(next.base);
    stop = static_cast<std::uint16_t>(next.stop);
  }
  ParameterBench bench(flash, bit_rate, base, stop);  // 3.65 V less 4 * 50 mV
  ASSERT_TRUE(bench.listens());
  bench.cell_uv = 3'520'000;
  for (int k = 0; k < 35; ++k) bench.sample();
  EXPECT_EQ(bench.last<can::Faults>()->cell_overvoltage, 1U);
  ParameterBench of_build(new_flash(), 250'000);
  ASSERT_TRUE(of_build.listens());
  of_build.cell_uv = 3'520'000;
  for (int k = 0; k < 35; ++k) of_build.sample();
  const auto faults = of_build.last<can::Faults>();
  EXPECT_EQ(faults->cell_overvoltage, 0U);
  EXPECT_EQ(faults->internal_fault, 0U);
}

/// On another base the identifiers of the DBC file belong to other nodes.
TEST(ParametersBoard, OnAnotherBaseFramesWithTheOldIdentifiersDoNothing) {
  std::vector<std::uint8_t> flash;
  {
    ParameterBench bench(new_flash(), 250'000);
    ASSERT_TRUE(bench.listens());
    bench.sample();
    auto wanted = bench.read();
    at(wanted, "can_base") = 0x500;
    ASSERT_EQ(bench.change(wanted), ServiceClient::State::done);
    flash = bench.flash();
  }
  can::Command command;
  command.code = can::Command::code_log_of_samples;
  for (const bool moved : {false, true}) {
    ParameterBench bench(flash, 250'000, 0x500);
    ASSERT_TRUE(bench.listens());
    bench.sample();
    can::Frame frame = command.frame(7);
    if (!moved) frame.id -= 0x500 - 0x180;  // so that it is 0x1A0 on the bus
    bench.sample({frame});
    bench.sample();
    EXPECT_EQ(bench.last<can::CommandAnswer>().has_value(), moved);
  }
}

}  // namespace
}  // namespace bms::firmware
