#include "monitor/stored_data_request.hpp"

#include <string_view>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc

namespace bms::monitor {

std::optional<can::Frame> StoredDataRequest::due(double now_s) {
  if (state_ != State::waiting || (begun_ && now_s < next_s_)) return std::nullopt;
  if (tries_ == most_tries) {
    state_ = State::given_up;
    return std::nullopt;
  }
  const auto missing = data_.missing();
  if (!missing) return std::nullopt;
  ++tries_;
  begun_ = true;
  next_s_ = now_s + silence_s;
  counter_ = can::next(counter_);
  can::Command command;
  command.code = can::Command::code_stored_data;
  const bool all = missing->count == StoredData::parts;
  command.argument = all ? 0 : static_cast<std::uint32_t>(missing->first | missing->count << 8);
  return command.frame(counter_);
}

void StoredDataRequest::receive(const BusState& bus, std::size_t message, double now_s) {
  if (message >= messages().size() || state_ != State::waiting) return;
  if (std::string_view(messages()[message].name) == can::CommandAnswer::name) return receive_answer(bus);
  if (!data_.receive(bus, message)) return;
  answered_ = true;
  tries_ = 0;
  next_s_ = now_s + silence_s;
  if (data_.complete()) state_ = State::complete;
}

void StoredDataRequest::receive_answer(const BusState& bus) {
  const auto value = [&](std::string_view signal) { return bus.reading(can::CommandAnswer::name, signal).value; };
  if (value("Code") != can::Command::code_stored_data || value("CommandCounter") != counter_) return;
  answered_ = true;
  if (value("Result") == can::CommandAnswer::result_no_such_command) state_ = State::unsupported;
  // firmware without service sessions refuses the parts that it does not have
  if (value("Result") == can::CommandAnswer::result_refused)
    state_ = data_.complete_but_for_actions() ? State::complete : State::refused;
}

}  // namespace bms::monitor
