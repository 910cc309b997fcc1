// Frames of every message of the DBC file, of random values, of values beyond the range and of values that are not
// known:
//
//   random_frames SEED COUNT [j1939]        j1939: of can/j1939_profile.dbc; a line each: {"id": 384, "data": "0f...",
//   "values": {"Soc": 54.3, "SocSigma": null, ...}}
//
// values: what went in, held within the signal's range; null: not known. decode_frames.py reads them with another
// decoder.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>

#include <fmt/format.h>

#include "can_messages.hpp"
#include "j1939_messages.hpp"

namespace {

using namespace bms;

std::mt19937 chance;
double uniform() { return std::uniform_real_distribution<double>()(chance); }

template <class Message>
void line() {
  Message m;
  std::string values;
  const int kind = static_cast<int>(chance() % 8);
  m.each([&](const char* name, const char*, auto& value, const can::SignalLayout& s) {
    if constexpr (std::same_as<std::remove_reference_t<decltype(value)>, float>) {
      const double span = s.highest - s.lowest;
      const double x = kind == 0   ? s.lowest - span * uniform()
                       : kind == 1 ? s.highest + span * uniform()
                       : kind == 2 ? s.lowest
                       : kind == 3 ? s.highest
                                   : s.lowest + span * uniform();
      const bool known = !s.has_invalid || chance() % 5 != 0;
      value = known ? static_cast<float>(x) : can::unknown;
      const double clamped = std::min(std::max(x, static_cast<double>(s.lowest)), static_cast<double>(s.highest));
      values +=
          fmt::format("{}\"{}\": {}", values.empty() ? "" : ", ", name, known ? fmt::format("{}", clamped) : "null");
    } else if constexpr (std::same_as<std::remove_reference_t<decltype(value)>, std::int32_t>) {
      const auto most = static_cast<std::int32_t>(can::mask(s.bits - 1));
      value = static_cast<std::int32_t>(chance());
      values += fmt::format("{}\"{}\": {}", values.empty() ? "" : ", ", name, std::clamp(value, -most - 1, most));
    } else {
      const auto most =
          s.bits > 24 ? static_cast<std::uint32_t>(can::mask(s.bits)) : static_cast<std::uint32_t>(s.highest);
      value = kind == 3                   ? most
              : kind == 1 && s.bits <= 24 ? most + 1 + static_cast<std::uint32_t>(chance() % 100)
                                          : static_cast<std::uint32_t>(chance() % (std::uint64_t{most} + 1));
      const bool known = !s.has_invalid || (value <= most && value != static_cast<std::uint32_t>(s.invalid));
      // of more than 24 bits with a factor: raw in C++
      if (s.bits > 24)
        values += fmt::format(
            "{}\"{}\": {}", values.empty() ? "" : ", ", name,
            !known ? "null"
                   : fmt::format("{}", static_cast<double>(value) * static_cast<double>(s.factor == 1 ? 1 : 1e-3) +
                                           static_cast<double>(s.offset)));
      else
        values += fmt::format("{}\"{}\": {}", values.empty() ? "" : ", ", name,
                              known ? fmt::format("{}", std::min(value, most)) : "null");
    }
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
  const bool j1939 = argc > 3 && std::string(argv[3]) == "j1939";
  for (int k = argc > 2 ? std::atoi(argv[2]) : 100; k > 0; --k) {
    if (j1939)
      lines(static_cast<can::j1939::Messages*>(nullptr));
    else
      lines(static_cast<can::Messages*>(nullptr));
  }
}
