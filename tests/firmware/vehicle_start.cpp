// Measures the times and bytes of firmware/can/messages.md with the application: a truck is switched on, drives, is
// switched off, gets a fault and clears it. Sixteen cells table9 at rest, a sample every 0.1 s, precharge time constant
// 0.5 s. Prints one JSON object; cmake/dbc_page.py puts it into the page.
#include <cmath>
#include <cstdio>
#include <string>

#include <fmt/format.h>

#include "tests/firmware/host_hal.hpp"
#include "tests/starting_point.hpp"

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

/// The truck: receives what is on the bus and sends its request once a second.
class Truck {
 public:
  void command(std::uint32_t code, std::uint32_t with) {
    can::Command c;
    c.code = code;
    c.argument = with;
    requests.push_back(c.frame(counter_));
    counter_ = can::next(counter_);
  }
  /// Processes one sample.
  void pass() {
    ++samples_;
    if (requests_power && samples_ % 10 == 0) command(can::Command::code_request, argument);
    measurement::PackSample<16> sample;
    sample.time_us = 100'000U * static_cast<std::uint64_t>(samples_);
    sample.current_ua = 0;
    double pack_v = 0;
    for (std::size_t k = 0; k < 16; ++k) {
      const double v = k == 0 ? first_cell_v : 3.28;
      sample.cell_uv[k] = static_cast<std::int32_t>(1e6 * v) +
                          static_cast<std::int32_t>((static_cast<std::size_t>(samples_) * 7 + 3 * k) % 11) *
                              50;  // quantisation of a converter
      pack_v += v;
    }
    sample.pack_uv = static_cast<std::int32_t>(1e6 * pack_v);
    for (std::size_t k = 0; k < 4; ++k)
      sample.temperature_cdegc[k] =
          static_cast<std::int16_t>(2'500 + static_cast<int>((static_cast<std::size_t>(samples_) + k) % 3));
    const double target_v = switched.precharge && switched.main_minus ? pack_v : 0;
    dc_link_v_ = switched.main_plus && switched.main_minus
                     ? pack_v
                     : target_v + (dc_link_v_ - target_v) * std::exp(-period_s / precharge_s);
    set_link(pack_v, dc_link_v_);
    application_.process_sample(sample);
    receive();
  }
  double now_s() const { return period_s * samples_; }
  /// Processes samples until the condition holds and returns the time. Throws std::runtime_error after a minute.
  template <class Condition>
  double until(Condition&& holds) {
    const double begin_s = now_s();
    while (!holds()) {
      pass();
      if (now_s() - begin_s > 60)
        throw std::runtime_error("an event of firmware/can/messages.md does not occur within a minute");
    }
    return now_s() - begin_s;
  }
  double until_state(std::uint32_t state) {
    return until([&] { return contactors.state == state; });
  }
  void request_drive() {
    requests_power = true;
    argument = 1;
    command(can::Command::code_request, 1);
  }

  can::ContactorState contactors;
  can::AllowedCurrent allowed;
  can::Faults faults;
  can::CommandAnswer answer;
  bool received = false, requests_power = false;
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
  Application<Board> application_{starting_at(0.5, 0.01), {}, 6, persistence_};
  std::uint8_t counter_ = 0;
  int samples_ = 0;
  double dc_link_v_ = 0;
};

/// Entries of the JSON object.
class Entries {
 public:
  void seconds(const char* name, double value) { add(name, fmt::format("{:.1f}", value)); }
  void add(const char* name, const std::string& value) { text_ += fmt::format(",\n  \"{}\": {}", name, value); }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

void start_and_stop(Truck& truck, Entries& entries) {
  using S = can::ContactorState;
  entries.seconds("first_frames_s", truck.until([&] { return truck.received; }));
  truck.request_drive();
  const double requested_s = truck.now_s();
  const auto add = [&](const char* name) { entries.seconds(name, truck.now_s() - requested_s); };
  truck.until_state(S::state_self_test);
  add("self_test_s");
  truck.until_state(S::state_precharge);
  add("precharge_s");
  truck.until_state(S::state_drive);
  add("drive_s");
  truck.until([&] { return truck.allowed.discharge > 0; });
  add("allowed_s");
  truck.until([&] { return truck.allowed.discharge >= 3; });
  add("half_allowed_s");
  truck.requests_power = false;
  truck.command(can::Command::code_request, 1);
  entries.seconds("silent_until_open_s", truck.until([&] { return truck.contactors.main_plus == 0; }));
  truck.until_state(S::state_off);
}

void fault_and_clear(Truck& truck, Entries& entries) {
  using S = can::ContactorState;
  truck.request_drive();
  truck.until_state(S::state_drive);
  truck.first_cell_v = 3.9;
  entries.seconds("severe_until_open_s", truck.until([&] { return truck.contactors.main_plus == 0; }));
  truck.first_cell_v = 3.28;
  truck.until_state(S::state_safe);
  const double safe_at_s = truck.now_s();
  truck.requests_power = true;
  truck.argument = 0;  // the truck withdraws its request
  truck.until([&] { return truck.now_s() - safe_at_s > 1; });
  truck.command(can::Command::code_clear_faults, 0);
  truck.pass();
  truck.pass();
  entries.add("clear_too_early", fmt::format("{}", truck.faults.cell_overvoltage_severe));
  truck.until([&] { return truck.now_s() - safe_at_s > 12; });
  truck.command(can::Command::code_clear_faults, 0);
  entries.seconds("clear_until_off_s", truck.until_state(S::state_off));
  truck.request_drive();
  entries.seconds("drive_again_s", truck.until_state(S::state_drive));
}

void print_page_values() {
  Truck truck;
  Entries entries;
  start_and_stop(truck, entries);
  fault_and_clear(truck, entries);

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
      frame.id, can::Command::data_id, data, protected_bytes, frame.data[0], entries.text(),
      1e-6 * static_cast<double>(PowerRequests::timeout_us), 1e-6 * protection::Contactors::grace_us);
}

}  // namespace
}  // namespace bms::firmware

int main() {
  try {
    bms::firmware::print_page_values();
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "vehicle_start: {}\n", e.what());
    return 3;
  }
}
