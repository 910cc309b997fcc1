// Any frames to the command handler, 12 bytes each: id, length, how the CRC is made, data. Nothing crashes. Only an
// intact command with a new counter is answered. All settings have valid values. A rejected command changes nothing.
#include <cstdint>

#include "firmware/commands.hpp"
#include "tests/fuzz/require.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bms;
  firmware::Commands commands;
  firmware::Requested requested;
  std::uint64_t now_us = 0;
  int last_counter = -1;
  for (; size >= 12; data += 12, size -= 12) {
    can::Frame frame;
    frame.id = static_cast<std::uint16_t>((data[0] & 0x80) != 0 ? can::Command::id : (data[0] << 8 | data[1]) & 0x7FF);
    frame.length = data[2] % 16;
    for (std::size_t k = 0; k < 8; ++k) frame.data[k] = data[4 + k];
    now_us += static_cast<std::uint64_t>(data[1]) << data[3] % 40;
    if ((data[3] & 0xC0) != 0) {  // most commands have a valid CRC
      can::Command c = can::Command::of(frame);
      c.code %= 10;
      if ((data[3] & 0x40) != 0) c.argument %= 4;
      const auto id = frame.id;
      frame = c.frame(data[2] >> 4);
      frame.id = id;
    }
    const firmware::Requested before = requested;
    const bool allowed = (data[3] & 0x20) != 0;
    const auto answer = commands.handle(frame, now_us, requested, [allowed](firmware::Privilege) { return allowed; });
    require(requested.stored_end <= firmware::stored_parts);
    const auto power_at = [&requested](std::uint64_t us) {
      return firmware::PowerRequests(requested.power).active({}, us);
    };
    require(static_cast<unsigned>(power_at(now_us)) <= 2 && static_cast<unsigned>(requested.clear) <= 2);
    const bool same = requested.log_samples == before.log_samples && requested.unix_time_s == before.unix_time_s &&
                      requested.clear == before.clear && requested.power == before.power &&
                      requested.stored_next == before.stored_next && requested.stored_end == before.stored_end;
    if (!answer) {  // request 0 counts also if it is not answered
      const auto command = can::Command::of(frame);
      require(same || (command.code == can::Command::code_request && command.argument == 0 &&
                       power_at(now_us) == protection::Request::none));
      continue;
    }
    require(frame.id == can::Command::id && can::intact(frame, can::Command::data_id) &&
            can::counter_of(frame) != last_counter);
    last_counter = can::counter_of(frame);
    require(answer->code == can::Command::of(frame).code &&
            answer->command_counter == static_cast<std::uint32_t>(last_counter));
    require(same || answer->result == can::CommandAnswer::result_done);
    if (answer->code == can::Command::code_request && answer->result == can::CommandAnswer::result_done) {
      const auto wanted = static_cast<protection::Request>(can::Command::of(frame).argument);
      require(power_at(now_us + firmware::PowerRequests::timeout_us - 1) == wanted);
      require(power_at(now_us + firmware::PowerRequests::timeout_us) == protection::Request::none);
    }
  }
  return 0;
}
