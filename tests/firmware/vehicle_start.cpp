// What can/messages.md says of times and bytes, as the firmware's application does it: a truck that is switched on,
// drives, is switched off, meets a fault and clears it. Sixteen cells table9 at rest, a sample each 0.1 s, pre-charge
// of 0.5 s (resistor times capacitance). One JSON object on standard output; cmake/dbc_page.py makes the page with it.
#include <cmath>
#include <cstdio>
#include <string>

#include <fmt/format.h>

#include "tests/firmware/host_hal.hpp"

namespace bms::firmware {
namespace {

using namespace host_hal;

constexpr double period_s = 0.1, precharge_s = 0.5;

struct Board : Table9Board<16> {
  static const protection::ProtectionPlan& plan() {
    static const auto plan = [] {
      auto design = Table9Board<16>::design(period_s);
      design.precharge_time_constant_s = precharge_s;
      return protection::protection_plan(design);
    }();
    return plan;
  }
};

/// The truck's side: hears what is on the bus, asks once a second.
class Truck {
 public:
  void command(std::uint32_t code, std::uint32_t with) {
    can::Command c;
    c.code = code;
    c.argument = with;
    requests.push_back(c.frame(counter_));
    counter_ = can::next(counter_);
  }
  /// A sample passes.
  void pass() {
    ++samples_;
    if (asks && samples_ % 10 == 0) command(can::Command::code_request, argument);
    measurement::PackSample<16> sample;
    sample.time_us = 100'000U * static_cast<std::uint64_t>(samples_);
    sample.current_ua = 0;
    double pack_v = 0;
    for (std::size_t k = 0; k < 16; ++k) {
      const double v = k == 0 ? first_cell_v : 3.28;
      sample.cell_uv[k] =
          static_cast<std::int32_t>(1e6 * v) +
          static_cast<std::int32_t>((static_cast<std::size_t>(samples_) * 7 + 3 * k) % 11) * 50;  // a converter's steps
      pack_v += v;
    }
    sample.pack_uv = static_cast<std::int32_t>(1e6 * pack_v);
    for (std::size_t k = 0; k < 4; ++k)
      sample.temperature_cdegc[k] =
          static_cast<std::int16_t>(2'500 + static_cast<int>((static_cast<std::size_t>(samples_) + k) % 3));
    const double target_v = switched.main_plus || (switched.precharge && switched.main_minus) ? pack_v : 0;
    dc_link_v_ = switched.main_plus && switched.main_minus
                     ? pack_v
                     : target_v + (dc_link_v_ - target_v) * std::exp(-period_s / precharge_s);
    dc_link_reading_uv = static_cast<std::int32_t>(1e6 * dc_link_v_);
    application_.process_sample(sample);
    receive();
  }
  double now_s() const { return period_s * samples_; }
  /// Samples pass until it is so; after a minute it is none of this firmware.
  template <class So>
  double until(So&& so) {
    const double begin_s = now_s();
    while (!so()) {
      pass();
      if (now_s() - begin_s > 60) throw std::runtime_error("what can/messages.md tells does not come within a minute");
    }
    return now_s() - begin_s;
  }
  double until_state(std::uint32_t state) {
    return until([&] { return contactors.state == state; });
  }
  void drives() { asks = true, argument = 1, command(can::Command::code_request, 1); }

  can::ContactorState contactors;
  can::AllowedCurrent allowed;
  can::Faults faults;
  can::CommandAnswer answer;
  bool received = false, asks = false;
  std::uint32_t argument = 0;
  double first_cell_v = 3.28;

 private:
  void receive() {
    for (const can::Frame& f : sent) {
      if (f.id == can::ContactorState::id) contactors = can::ContactorState::of(f);
      if (f.id == can::AllowedCurrent::id) allowed = can::AllowedCurrent::of(f);
      if (f.id == can::Faults::id) faults = can::Faults::of(f);
      if (f.id == can::CommandAnswer::id) answer = can::CommandAnswer::of(f);
      received = true;
    }
    sent.clear();
  }

  storage::Persistence persistence_;
  Application<Board> application_{measurement::StartingPoint{500'000'000, 10'000'000}, {}, 6, persistence_};
  std::uint8_t counter_ = 0;
  int samples_ = 0;
  double dc_link_v_ = 0;
};

void tell() {
  using S = can::ContactorState;
  Truck truck;
  std::string json;
  const auto say = [&](const char* name, double seconds) { json += fmt::format(",\n  \"{}\": {:.1f}", name, seconds); };
  say("first_frames_s", truck.until([&] { return truck.received; }));
  truck.drives();
  const double asked_s = truck.now_s();
  const auto since_asked_s = [&] { return truck.now_s() - asked_s; };
  truck.until_state(S::state_self_test), say("self_test_s", since_asked_s());
  truck.until_state(S::state_precharge), say("precharge_s", since_asked_s());
  truck.until_state(S::state_drive), say("drive_s", since_asked_s());
  truck.until([&] { return truck.allowed.discharge > 0; }), say("allowed_s", since_asked_s());
  truck.until([&] { return truck.allowed.discharge >= 3; }), say("half_allowed_s", since_asked_s());
  truck.asks = false;
  truck.command(can::Command::code_request, 1);
  say("silent_until_open_s", truck.until([&] { return truck.contactors.main_plus == 0; }));
  truck.until_state(S::state_off);

  truck.drives();
  truck.until_state(S::state_drive);
  truck.first_cell_v = 3.9;
  say("severe_until_open_s", truck.until([&] { return truck.contactors.main_plus == 0; }));
  truck.first_cell_v = 3.28;
  truck.until_state(S::state_safe);
  const double safe_at_s = truck.now_s();
  truck.asks = true, truck.argument = 0;  // what the truck has to ask for: nothing
  truck.until([&] { return truck.now_s() - safe_at_s > 1; });
  truck.command(can::Command::code_clear_faults, 0);
  truck.pass();
  truck.pass();
  json += fmt::format(",\n  \"clear_too_early\": {}", truck.faults.cell_overvoltage_severe);
  truck.until([&] { return truck.now_s() - safe_at_s > 12; });
  truck.command(can::Command::code_clear_faults, 0);
  say("clear_until_off_s", truck.until_state(S::state_off));
  truck.drives();
  say("drive_again_s", truck.until_state(S::state_drive));

  can::Command command;
  command.code = can::Command::code_request;
  command.argument = 1;
  const can::Frame frame = command.frame(5);
  std::string data,
      protected_bytes = fmt::format("{:02X} {:02X}", can::Command::data_id & 0xFF, can::Command::data_id >> 8);
  for (std::size_t k = 0; k < frame.length; ++k) data += fmt::format("{}{:02X}", k > 0 ? " " : "", frame.data[k]);
  for (std::size_t k = 1; k < frame.length; ++k) protected_bytes += fmt::format(" {:02X}", frame.data[k]);
  fmt::print(
      "{{\n  \"example_id\": {}, \"example_data_id\": {}, \"example_counter\": 5, \"example_bytes\": \"{}\", "
      "\"example_crc_over\": \"{}\", \"example_crc\": {}{},\n  \"request_lasts_s\": {:g}, \"grace_s\": {:g}\n}}\n",
      frame.id, can::Command::data_id, data, protected_bytes, frame.data[0], json,
      1e-6 * static_cast<double>(Requested::request_timeout_us), 1e-6 * protection::Contactors::grace_us);
}

}  // namespace
}  // namespace bms::firmware

int main() {
  try {
    bms::firmware::tell();
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "vehicle_start: {}\n", e.what());
    return 3;
  }
}
