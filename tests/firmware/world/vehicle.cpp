#include "tests/firmware/world/vehicle.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc

namespace bms::world {

namespace {

constexpr std::array names{"cell overvoltage warning",
                           "cell overvoltage",
                           "cell overvoltage severe",
                           "cell undervoltage warning",
                           "cell undervoltage",
                           "cell undervoltage severe",
                           "pack overvoltage",
                           "pack undervoltage",
                           "charge overcurrent",
                           "discharge overcurrent",
                           "short circuit",
                           "overtemperature warning",
                           "overtemperature",
                           "charge overtemperature",
                           "undertemperature",
                           "charge undertemperature",
                           "open wire",
                           "imbalance",
                           "current implausible",
                           "sum mismatch",
                           "voltage missing",
                           "voltage stuck",
                           "current missing",
                           "temperature lost",
                           "temperature stuck",
                           "deep discharge",
                           "precharge failed",
                           "contactor welded",
                           "contactor not closed",
                           "samples missing",
                           "internal fault",
                           "storage fault",
                           "second line tripped",
                           "second line failed",
                           "current sensors differ",
                           "temperature unknown",
                           "current unrequested",
                           "allowed current exceeded",
                           "charge limit exceeded",
                           "discharge limit exceeded",
                           "limit not obeyed",
                           "supply dip",
                           "thermistor shorted",
                           "second current missing",
                           "interlock open",
                           "crash",
                           "insulation low",
                           "insulation unknown",
                           "front end hot",
                           "group incomplete"};
constexpr std::uint32_t faults_id = 0x196, more_faults_id = 0x1A2, state_id = 0x197, allowed_id = 0x19F,
                        pack_state_id = 0x180, board_id = 0x1B9, inputs_id = 0x1BA;
constexpr std::uint32_t dbc_base = 0x180, block = 0x40;
constexpr double request_period_ms = 1'000;
constexpr std::size_t most_seen = 4'096;

std::uint64_t field(const can::Frame& frame, unsigned first, unsigned bits) {
  std::uint64_t all = 0;
  for (unsigned k = 0; k < 8; ++k) all |= static_cast<std::uint64_t>(frame.data[k]) << 8 * k;
  return all >> first & ((std::uint64_t{1} << bits) - 1);
}

}  // namespace

std::string fault_names(std::uint64_t faults) {
  std::string text;
  for (unsigned bit = 0; bit < 64; ++bit) {
    if ((faults >> bit & 1) == 0) continue;
    if (!text.empty()) text += ", ";
    text += bit < names.size() ? names[bit] : fmt::format("fault {}", bit);
  }
  return text.empty() ? "none" : text;
}

void Vehicle::send(can::Frame frame) {
  if (!frame.long_id && frame.id >= dbc_base && frame.id < dbc_base + block) frame.id = frame.id - dbc_base + base;
  board_.can.others.push_back({firmware::wire_frame(frame), 0, true});
}

void Vehicle::send(std::uint32_t code, std::uint32_t argument) {
  can::Command command;
  command.code = code;
  command.argument = argument;
  counter_ = can::next(counter_);
  send(command.frame(counter_));
}

void Vehicle::clear_faults(bool service) { send(can::Command::code_clear_faults, service ? 1 : 0); }

double Vehicle::silent_ms() const { return board_.now_ms() - received_ms_; }

void Vehicle::publish(std::uint64_t faults, double at_ms) {
  if (faults == faults_) return;
  changes_.push_back({at_ms, faults & ~faults_, faults_ & ~faults});
  faults_ = faults;
  seen_ |= faults;
}

void Vehicle::read(can::Frame frame, double at_ms) {
  if (!frame.long_id && frame.id >= base && frame.id < base + block) frame.id = frame.id - base + dbc_base;
  ++frames[frame.id & 0x7FF];
  if (on_frame) on_frame(frame);
  switch (frame.id) {
    case faults_id:
      received_ms_ = at_ms;
      first_cause_ = static_cast<unsigned>(field(frame, 48, 6));
      publish((faults_ & ~std::uint64_t{0xFFFFFFFF}) | field(frame, 16, 32), at_ms);
      break;
    case more_faults_id:
      publish((faults_ & 0xFFFFFFFF) | field(frame, 16, 32) << 32, at_ms);
      break;
    case state_id:
      state_ = static_cast<unsigned>(field(frame, 12, 4));
      charge_enabled_ = field(frame, 19, 1) != 0;
      break;
    case allowed_id:
      allowed_charge_a_ = 0.02 * static_cast<double>(field(frame, 16, 16));
      allowed_discharge_a_ = 0.02 * static_cast<double>(field(frame, 32, 16));
      break;
    case pack_state_id:
      if (pack_state_ms_ >= 0) {
        shortest_cycle_ms = std::min(shortest_cycle_ms, at_ms - pack_state_ms_);
        longest_cycle_ms = std::max(longest_cycle_ms, at_ms - pack_state_ms_);
      }
      pack_state_ms_ = at_ms;
      soc_percent_ = 0.002 * static_cast<double>(field(frame, 16, 16));
      soc_sigma_percent_ = 0.002 * static_cast<double>(field(frame, 32, 16));
      break;
    case board_id:
      longest_sample_ms_ = 0.01 * static_cast<double>(field(frame, 48, 16));
      break;
    case inputs_id:
      coils_dead_seen_ = coils_dead_seen_ || field(frame, 22, 2) == 0;
      insulation_kohm_ = field(frame, 32, 16) == 65'535 ? -1 : 0.1 * static_cast<double>(field(frame, 32, 16));
      break;
    default:
      break;
  }
}

void Vehicle::update() {
  auto& seen = board_.can.seen;
  for (; read_ < seen.size(); ++read_) {
    if (seen[read_].from_board) read(seen[read_].frame, board_.ms_at_bit(seen[read_].end_bit));
  }
  if (seen.size() > most_seen) {
    seen.clear();
    read_ = 0;
  }
  if (!talks) return;
  const double now_ms = board_.now_ms();
  if (request == sent_ && now_ms < next_request_ms_) return;
  next_request_ms_ = now_ms + request_period_ms;
  sent_ = request;
  send(can::Command::code_request, static_cast<std::uint32_t>(request));
}

double Vehicle::raised_ms(unsigned bit, double from_ms) const {
  for (const Change& change : changes_) {
    if (change.at_ms >= from_ms && (change.raised >> bit & 1) != 0) return change.at_ms;
  }
  return -1;
}

}  // namespace bms::world
