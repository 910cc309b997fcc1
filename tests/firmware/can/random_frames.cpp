// Prints frames of every message of the DBC file with random values, values beyond the range and values that are not
// known. One line each: {"id": 384, "data": "0f...", "values": {"Soc": 54.3, "SocSigma": null, ...}}
//
//   random_frames SEED COUNT [j1939|parallel]        messages of firmware/can/j1939_profile.dbc or parallel_bus.dbc
//
// values: the input, clamped to the range of the signal; null: not known. decode_frames.py decodes the frames with
// another decoder.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>

#include <fmt/format.h>

#include "can_messages.hpp"
#include "j1939_messages.hpp"
#include "parallel_messages.hpp"

namespace {

using namespace bms;

std::mt19937 chance;
double uniform() { return std::uniform_real_distribution<double>()(chance); }

enum class Kind { below, above, lowest, highest, within };

/// Half of all frames have values within the range.
Kind random_kind() {
  const auto kind = chance() % 8;
  return kind < 4 ? static_cast<Kind>(kind) : Kind::within;
}

std::string entry(const char* name, bool known, const std::string& value) {
  return fmt::format("\"{}\": {}", name, known ? value : "null");
}

/// The factor as it stands in the DBC file, which a float is not. More than 24 bits with a factor are raw in C++.
double decimal(float factor) { return std::round(1e6 * static_cast<double>(factor)) / 1e6; }

/// Sets the value of a signal and returns its entry of "values".
std::string set(const char* name, float& value, const can::SignalLayout& s, Kind kind) {
  const double span = s.highest - s.lowest;
  double x = s.lowest;
  if (kind == Kind::below) x = s.lowest - span * uniform();
  if (kind == Kind::above) x = s.highest + span * uniform();
  if (kind == Kind::highest) x = s.highest;
  if (kind == Kind::within) x = s.lowest + span * uniform();
  const bool known = !s.has_invalid || chance() % 5 != 0;
  value = known ? static_cast<float>(x) : can::unknown;
  const double clamped = std::clamp(x, static_cast<double>(s.lowest), static_cast<double>(s.highest));
  return entry(name, known, fmt::format("{}", clamped));
}
std::string set(const char* name, std::int32_t& value, const can::SignalLayout& s, Kind) {
  const auto most = static_cast<std::int32_t>(can::mask(s.bits - 1));
  value = static_cast<std::int32_t>(chance());
  const double sent = std::clamp(value, -most - 1, most);
  const bool known = !s.has_invalid || value != static_cast<std::int32_t>(s.invalid);
  return entry(name, known, fmt::format("{}", sent * decimal(s.factor) - static_cast<double>(s.minus_offset)));
}
std::string set(const char* name, std::uint32_t& value, const can::SignalLayout& s, Kind kind) {
  const auto most = s.bits > 24 ? static_cast<std::uint32_t>(can::mask(s.bits)) : static_cast<std::uint32_t>(s.highest);
  if (kind == Kind::highest)
    value = most;
  else if (kind == Kind::above && s.bits <= 24)
    value = most + 1 + static_cast<std::uint32_t>(chance() % 100);
  else
    value = static_cast<std::uint32_t>(chance() % (std::uint64_t{most} + 1));
  const bool known = !s.has_invalid || (value <= most && value != static_cast<std::uint32_t>(s.invalid));
  if (s.bits <= 24) return entry(name, known, fmt::format("{}", std::min(value, most)));
  return entry(name, known,
               fmt::format("{}", static_cast<double>(value) * decimal(s.factor) - static_cast<double>(s.minus_offset)));
}

template <class Message>
void line() {
  Message m;
  std::string values;
  const Kind kind = random_kind();
  m.each([&](const char* name, const char*, auto& value, const can::SignalLayout& s) {
    values += (values.empty() ? "" : ", ") + set(name, value, s, kind);
  });
  can::Frame frame;
  if constexpr (requires { m.frame(); })
    frame = m.frame();
  else
    frame = m.frame(static_cast<std::uint8_t>(chance() % can::counters));
  std::string data;
  for (const std::uint8_t byte : frame.data) data += fmt::format("{:02x}", byte);
  fmt::print("{{\"id\": {}, \"data\": \"{}\", \"counter\": {}, \"values\": {{{}}}}}\n", frame.id, data,
             can::counter_of(frame), values);
}

template <class... Message>
void lines(std::tuple<Message...>*) {
  (line<Message>(), ...);
}

}  // namespace

int main(int argc, char** argv) {
  chance.seed(argc > 1 ? static_cast<unsigned>(std::atoi(argv[1])) : 1);
  const std::string of = argc > 3 ? argv[3] : "";
  for (int k = argc > 2 ? std::atoi(argv[2]) : 100; k > 0; --k) {
    if (of == "j1939")
      lines(static_cast<can::j1939::Messages*>(nullptr));
    else if (of == "parallel")
      lines(static_cast<can::parallel::Messages*>(nullptr));
    else
      lines(static_cast<can::Messages*>(nullptr));
  }
}
