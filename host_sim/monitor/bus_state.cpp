#include "monitor/bus_state.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <type_traits>

#include "can_messages.hpp"    // generated from firmware/can/greybox_bms.dbc
#include "j1939_messages.hpp"  // generated from firmware/can/j1939_profile.dbc

namespace bms::monitor {

namespace {

constexpr std::int64_t stale_without_cycle_us = 3'000'000;
constexpr std::int64_t largest_time_us = std::int64_t{1} << 60;  // 36,500 years; sums and differences do not overflow
constexpr std::int64_t clock_set_us = 1'000'000;                 // a larger step back means that a clock was set
constexpr double smoothing = 1.0 / 8;
constexpr int stale_cycles = 3, most_digits = 9;

/// The shortest decimal number that rounds to `value`: 0.002 for 0.002F.
double decimal(float value) {
  std::array<char, 32> text;
  const auto written = std::to_chars(text.data(), text.data() + text.size(), value);
  double result = 0;
  std::from_chars(text.data(), written.ptr, result);
  return result;
}

int digits_of(double step) {
  int digits = 0;
  while (digits < most_digits && std::abs(step - std::round(step)) > 1e-9 * step) {
    step *= 10;
    ++digits;
  }
  return digits;
}

/// The raw value that means "invalid".
double invalid_raw(const can::SignalLayout& layout) {
  if (layout.is_signed) return layout.invalid;
  return static_cast<double>(static_cast<std::uint32_t>(layout.invalid));
}

double raw_of(const SignalInfo& signal, double value) {
  if (signal.raw) return value;
  return std::round((value + static_cast<double>(signal.layout.minus_offset)) /
                    static_cast<double>(signal.layout.factor));
}

/// The decimal value of a signal: 54.302, not the product of two floats. A float holds a raw value of up to 24 bits
/// exactly, and the rounding of the product is less than half a step.
double decimal_value(const SignalInfo& signal, double value) {
  if ((signal.integer || signal.raw) && signal.layout.has_invalid && value == invalid_raw(signal.layout))
    return std::numeric_limits<double>::quiet_NaN();
  if (signal.integer || !std::isfinite(value)) return value;
  const double raw = raw_of(signal, value);
  const double scale = std::pow(10, signal.digits);
  return std::round((raw * signal.factor + signal.offset) * scale) / scale;
}

template <class Message>
constexpr std::uint16_t data_id_of() {
  if constexpr (requires { Message::data_id; })
    return Message::data_id;
  else
    return 0;
}

template <class Message>
MessageInfo info_of() {
  MessageInfo info{Message::name,
                   Message::id,
                   sizeof(Message::id) > 2,
                   data_id_of<Message>(),
                   Message::cycle_us,
                   {},
                   [](const can::Frame& frame, std::span<double> values) {
                     Message message = Message::of(frame);
                     std::size_t k = 0;
                     message.each([&](const char*, const char*, const auto& value, const can::SignalLayout&) {
                       values[k++] = static_cast<double>(value);
                     });
                   }};
  Message message;
  message.each([&](const char* name, const char* unit, const auto& value, const can::SignalLayout& layout) {
    const double factor = decimal(layout.factor), offset = -decimal(layout.minus_offset);
    const bool integral = std::is_integral_v<std::remove_cvref_t<decltype(value)>>,
               unscaled = factor == 1 && offset == 0;
    info.signals.push_back(
        {name, unit, "", integral && unscaled, integral && !unscaled, layout, {}, factor, offset, digits_of(factor)});
  });
  std::size_t k = 0;
  Message::each_in_words([&](const char*, const char* comment, std::span<const can::ValueName> names) {
    info.signals[k].comment = comment;
    info.signals[k].names = names;
    ++k;
  });
  return info;
}

template <class... Message, class... ProfileMessage>
std::vector<MessageInfo> infos_of(std::tuple<Message...>*, std::tuple<ProfileMessage...>*) {
  static_assert(sizeof...(Message) < 255);
  return {info_of<Message>()..., info_of<ProfileMessage>()...};
}

}  // namespace

const std::vector<MessageInfo>& messages() {
  static const std::vector<MessageInfo> all =
      infos_of(static_cast<can::Messages*>(nullptr), static_cast<can::j1939::Messages*>(nullptr));
  return all;
}

BusState::BusState() {
  index_of_standard_id_.fill(none);
  for (std::size_t k = 0; k < messages().size(); ++k) {
    if (messages()[k].long_id)
      index_of_extended_id_.push_back(k);
    else
      index_of_standard_id_[messages()[k].id & 0x7FFU] = static_cast<std::uint8_t>(k);
    states_.emplace_back().values.assign(messages()[k].signals.size(), std::numeric_limits<double>::quiet_NaN());
  }
}

std::size_t BusState::receive(const BusFrame& frame) {
  const std::size_t not_accepted = states_.size();
  const std::int64_t time_us =
      std::clamp(frame.time_us, -largest_time_us, largest_time_us);  // a log may contain any time
  if (frames_++ == 0) first_us_ = last_us_ = now_us_ = time_us;
  if (time_us < last_us_ - clock_set_us) clock_set_back(time_us);
  last_us_ = std::max(last_us_, time_us);
  advance_time(time_us);
  switch (frame.kind) {
    case FrameKind::remote:
      ++remote_;
      return not_accepted;
    case FrameKind::fd:
      ++fd_;
      return not_accepted;
    case FrameKind::error:
      ++errors_;
      error_classes_ |= frame.id;
      return not_accepted;
    case FrameKind::extended:
    case FrameKind::standard:
      break;
  }
  const std::size_t message = message_of(frame);
  if (message != not_accepted) return receive_known(message, to_can_frame(frame), time_us) ? message : not_accepted;
  count_unknown(frame);
  return not_accepted;
}

std::size_t BusState::message_of(const BusFrame& frame) const {
  if (frame.kind == FrameKind::extended) {
    const auto found = std::find_if(index_of_extended_id_.begin(), index_of_extended_id_.end(),
                                    [&](std::size_t k) { return messages()[k].id == frame.id; });
    return found == index_of_extended_id_.end() ? states_.size() : *found;
  }
  const std::uint8_t message = index_of_standard_id_[frame.id & 0x7FFU];
  return message == none ? states_.size() : message;
}

void BusState::clock_set_back(std::int64_t to_us) {
  first_us_ = std::max(first_us_ - (last_us_ - to_us), -2 * largest_time_us);
  last_us_ = now_us_ = to_us;
  for (MessageState& state : states_) state.last_us = std::min(state.last_us, to_us);
}

/// Counts the error of the frame if there is one.
bool BusState::is_intact(const MessageInfo& info, MessageState& state, const can::Frame& frame) const {
  if (frame.length != 8) {
    ++state.wrong_length;
    return false;
  }
  if (info.data_id == 0) return true;
  const std::uint8_t counter = can::counter_of(frame);
  if (!can::intact(frame, info.data_id) || counter >= can::counters) {
    ++state.crc_errors;
    return false;
  }
  if (state.frames > 0 && counter == state.counter) {
    ++state.repeated;
    return false;
  }
  if (state.frames > 0)
    state.lost += static_cast<unsigned>(counter - state.counter + can::counters - 1) % can::counters;
  state.counter = counter;
  return true;
}

bool BusState::receive_known(std::size_t message, const can::Frame& frame, std::int64_t time_us) {
  const MessageInfo& info = messages()[message];
  MessageState& state = states_[message];
  if (!is_intact(info, state, frame)) return false;
  if (const auto since_us = static_cast<double>(time_us - state.last_us); state.frames > 0 && since_us > 0)
    state.period_us += state.period_us > 0 ? smoothing * (since_us - state.period_us) : since_us;
  ++accepted_;
  ++state.frames;
  state.last_us = time_us;
  info.decode(frame, state.values);
  for (std::size_t s = 0; s < state.values.size(); ++s)
    state.values[s] = decimal_value(info.signals[s], state.values[s]);
  return true;
}

void BusState::count_unknown(const BusFrame& frame) {
  ++unknown_frames_;
  const auto end = unknown_.begin() + static_cast<std::ptrdiff_t>(unknown_count_);
  const auto place = std::find_if(unknown_.begin(), end,
                                  [&](const Unknown& u) { return u.id == frame.id && u.long_id == frame.long_id; });
  if (place != end) {
    ++place->frames;
  } else if (unknown_count_ < unknown_.size()) {
    unknown_[unknown_count_++] = {frame.id, frame.long_id, 1};
  } else {
    ++unknown_without_place_;
  }
}

double BusState::age_s(std::size_t message) const {
  const MessageState& state = states_[message];
  return state.frames == 0 ? std::numeric_limits<double>::infinity()
                           : 1e-6 * static_cast<double>(now_us_ - state.last_us);
}

bool BusState::stale(std::size_t message) const {
  const std::int64_t cycle_us = messages()[message].cycle_us;
  return states_[message].frames == 0 ||
         now_us_ - states_[message].last_us > (cycle_us > 0 ? stale_cycles * cycle_us : stale_without_cycle_us);
}

std::size_t BusState::find(std::string_view message) {
  const auto& all = messages();
  return static_cast<std::size_t>(
      std::find_if(all.begin(), all.end(), [&](const MessageInfo& m) { return message == m.name; }) - all.begin());
}

Reading BusState::reading(std::string_view message, std::string_view signal) const {
  const std::size_t k = find(message);
  if (k == messages().size()) return {};
  const auto& signals = messages()[k].signals;
  for (std::size_t s = 0; s < signals.size(); ++s) {
    if (signal == signals[s].name) return {states_[k].values[s], age_s(k), stale(k)};
  }
  return {};
}

bool BusState::complete() const {
  bool all = true, every_sample = true;
  std::int64_t longest_us = 0;
  for (std::size_t k = 0; k < states_.size(); ++k) {
    if (messages()[k].long_id) continue;  // not every image sends them
    const std::string_view name = messages()[k].name;
    if (states_[k].frames == 0) {
      all = false;
      if (name == "PackState" || name == "PackElectrical" || name == "Status") every_sample = false;
    }
    longest_us = std::max<std::int64_t>(longest_us, messages()[k].cycle_us);
  }
  return all || (every_sample && last_us_ - first_us_ >= longest_us + longest_us / 5);
}

}  // namespace bms::monitor
