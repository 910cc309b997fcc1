#include "monitor/service_client.hpp"

namespace bms::monitor {

std::vector<can::Frame> ServiceClient::due(double now_s) {
  if (state_ != State::working || now_s < next_s_) return {};
  if (tries_ == most_tries) {
    state_ = State::silent;
    return {};
  }
  ++tries_;
  next_s_ = now_s + patience_s;
  return frames();
}

std::vector<can::Frame> ServiceClient::frames() {
  can::ServiceRequest request;
  switch (step_) {
    case Step::challenge:
      request.kind = can::ServiceRequest::kind_challenge;
      return {request.frame(count())};
    case Step::response:
    case Step::close:
      request.kind = step_ == Step::close ? can::ServiceRequest::kind_close : can::ServiceRequest::kind_response;
      request.operator_number = operator_;
      request.code = authentication::session_code(service_, challenge_, operator_);
      if (step_ == Step::close) state_ = State::done;
      return {request.frame(count())};
    case Step::command:
      break;
  }
  const can::Frame command = this->command().frame(command_counter_ = count());
  if (!needs_session_) return {command};
  can::CommandAuthority authority;
  authority.sequence = ++sequence_;
  authority.code = authentication::command_code(service_, challenge_, sequence_, command.data);
  return {authority.frame(count()), command};
}

void ServiceClient::go_to(Step step, double now_s) {
  step_ = step;
  tries_ = 0;
  next_s_ = now_s;
}

void ServiceClient::receive(const can::Frame& frame, double now_s) {
  if (state_ != State::working || frame.long_id || !can::intact(frame, static_cast<std::uint16_t>(frame.id))) return;
  if (frame.id == can::ServiceChallenge::id) return receive_challenge(can::ServiceChallenge::of(frame), now_s);
  if (frame.id != can::CommandAnswer::id || step_ != Step::command) return;
  const auto answer = can::CommandAnswer::of(frame);
  if (answer.code != command().code || answer.command_counter != command_counter_) return;
  if (answer.result == can::CommandAnswer::result_not_authorised)
    state_ = State::not_authorised;
  else if (answer.result != can::CommandAnswer::result_done)
    state_ = State::refused;
  else if (++done_ < commands_.size())
    go_to(Step::command, now_s);
  else if (needs_session_)
    go_to(Step::close, now_s);
  else
    state_ = State::done;
}

void ServiceClient::receive_challenge(const can::ServiceChallenge& m, double now_s) {
  using M = can::ServiceChallenge;
  if (step_ != Step::challenge && step_ != Step::response) return;
  if (m.state == M::state_locked) {
    state_ = State::locked;
  } else if (m.state == M::state_no_key) {
    state_ = State::no_key;
  } else if (m.state == M::state_not_needed) {
    needs_session_ = false;
    go_to(Step::command, now_s);
  } else if (m.state == M::state_challenge && step_ == Step::challenge) {
    challenge_ = m.challenge_low | static_cast<std::uint64_t>(m.challenge_high) << 32;
    go_to(Step::response, now_s);
  } else if (m.state == M::state_open && step_ == Step::response) {
    go_to(Step::command, now_s);
  } else if (m.state == M::state_closed && step_ == Step::response) {
    state_ = State::wrong_key;
  }
}

std::string words_for(ServiceClient::State state) {
  using enum ServiceClient::State;
  switch (state) {
    case done:
      return "done";
    case refused:
      return "the battery refused the command: its argument is out of range, it cannot do it, or a contactor is closed";
    case not_authorised:
      return "the battery did not accept the command in this session; try again";
    case locked:
      return "the battery is locked after wrong attempts; try again in ten minutes";
    case no_key:
      return "the battery has no device key; write one first";
    case wrong_key:
      return "the battery did not accept the answer; this is not its key";
    default:
      return "the battery does not answer; check the wiring, the bit rate, and that it is switched on";
  }
}

}  // namespace bms::monitor
