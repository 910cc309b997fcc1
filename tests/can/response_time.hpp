// How long a frame takes at worst from its sample to the end on the wire: R. I. Davis, A. Burns, R. J. Bril, J. J.
// Lukkien, "Controller Area Network (CAN) schedulability analysis: refuted, revisited and revised", Real-Time Systems
// 35 (2007) 239-272.
//
//   bits of a standard frame of s bytes, stuffed at worst, with intermission    34 + 8 s + 13 + (34 + 8 s - 1) / 4 (eq.
//   2): 8 bytes 135 of a frame of 29 bits                                                       54 instead of 34
//   (section 2.1): 160 busy period      t    = B + sum over k of higher priority and m itself of ceil((t + J_k) / T_k)
//   C_k                (eq. 9) queueing delay   w(q) = B + q C + sum over k of higher priority of ceil((w + J_k + bit)
//   / T_k) C_k                 (eq. 12) response         R    = max over q of J + w(q) - q T + C (eq. 13, 14)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <tuple>
#include <vector>

#include "can_messages.hpp"
#include "firmware/cia418_profile.hpp"
#include "hal/bxcan/transmit_queue.hpp"
#include "hal/sample_frames.hpp"
#include "j1939_messages.hpp"

namespace bms::can_bus {

struct Message {
  std::string name;
  std::uint32_t id = 0;
  unsigned length = 8;  ///< bytes
  double period_s = 1;
  double jitter_s = 0;   ///< between what asks for it and its place in the queue
  bool long_id = false;  ///< 29 bits
};

constexpr unsigned worst_bits(unsigned length, bool long_id = false) {
  const unsigned stuffed = (long_id ? 54 : 34) + 8 * length;
  return stuffed + 13 + (stuffed - 1) / 4;
}
constexpr unsigned worst_bits(const Message& m) { return worst_bits(m.length, m.long_id); }
constexpr std::uint32_t urgency(const Message& m) {
  return hal::bxcan::arbitration({m.id, 0, {}, m.long_id});
}  ///< lower wins

inline double load(const std::vector<Message>& messages, double bits_per_second) {
  double bits_each_second = 0;
  for (const Message& m : messages) bits_each_second += worst_bits(m) / m.period_s;
  return bits_each_second / bits_per_second;
}

/// Worst-case response of message `which` [s]; infinity when the bus is full. time_s(m): its time on the wire;
/// blocking_s: of a frame less urgent that is under way.
template <class Time>
double response_s(const std::vector<Message>& messages, std::size_t which, double blocking_s, double bit_s,
                  Time&& time_s) {
  const Message& m = messages[which];
  const double c = time_s(m);
  double utilisation = c / m.period_s;
  const auto others = [&](double until_s) {
    double sum = 0;
    for (const Message& k : messages) {
      if (urgency(k) < urgency(m)) sum += std::ceil((until_s + k.jitter_s) / k.period_s) * time_s(k);
    }
    return sum;
  };
  for (const Message& k : messages) utilisation += urgency(k) < urgency(m) ? time_s(k) / k.period_s : 0;
  if (utilisation >= 1) return std::numeric_limits<double>::infinity();
  const auto fixed_point = [](double start, auto&& next) {
    for (double now = start;;) {
      const double then = next(now);
      if (then <= now) return now;
      now = then;
    }
  };
  const double busy =
      fixed_point(c, [&](double t) { return blocking_s + others(t) + std::ceil((t + m.jitter_s) / m.period_s) * c; });
  double worst = 0;
  for (int q = 0; q < std::ceil((busy + m.jitter_s) / m.period_s); ++q) {
    const double w = fixed_point(blocking_s + q * c, [&](double t) { return blocking_s + q * c + others(t + bit_s); });
    worst = std::max(worst, m.jitter_s + w - q * m.period_s + c);
  }
  return worst;
}

/// From a complete sample to its last frame in the queue: what the firmware works until then. Of 16 cells 0.9 ms at an
/// instruction a cycle (bxcan_board_test measures it), two cycles on the chip at most.
inline constexpr double sample_to_queue_s = 2e-3;

/// Where the samples come from: of a chip on the board, or in frames of the bus (hal/sample_frames.hpp).
enum class Cells { measured_by_the_board, measured_by_another_node };
/// What the image sends beside the battery's own messages (build option BMS_VEHICLE_PROFILE).
enum class Profile { none, cia418, j1939 };
inline constexpr std::size_t cells_of_a_pack = 16;

/// What is in the DBC file: by its cycle time, or, without one, with every sample (of those that are sent once this is
/// too much); and the frames that bring a sample, if it comes by the bus; of their sender, which keeps their order, the
/// latest bound holds for all. jitter_s: from a complete sample to the queue.
inline std::vector<Message> messages_on_the_bus(double samples_per_second, double jitter_s, Cells cells,
                                                Profile profile = Profile::none) {
  std::vector<Message> all;
  std::apply(
      [&](auto... m) {
        (all.push_back(
             {m.name, m.id, m.frame(0).length, m.cycle_us > 0 ? 1e-6 * m.cycle_us : 1 / samples_per_second, jitter_s}),
         ...);
      },
      can::Messages{});
  if (cells == Cells::measured_by_another_node) {
    for (const can::Frame& f : hal::frames_of(measurement::PackSample<cells_of_a_pack>{}, 0, 0))
      all.push_back({"(of a sample)", f.id, f.length, 1 / samples_per_second, 0});
  }
  if (profile == Profile::cia418) {
    all.push_back(
        {"(heartbeat)", firmware::canopen::heartbeat_id + hal::canopen_node, 1,
         1e-6 * firmware::canopen::Node::heartbeat_us, jitter_s});
    for (const firmware::Cia418Profile::Pdo& pdo : firmware::Cia418Profile::pdos)
      all.push_back({pdo.name, pdo.id, pdo.length, 1e-6 * firmware::Cia418Profile::cycle_us, jitter_s});
  }
  if (profile == Profile::j1939)
    std::apply(
        [&](auto... m) {
          (all.push_back({m.name, m.id, 8, 1e-6 * m.cycle_us, jitter_s, true}), ...);
        },
        can::j1939::Messages{});
  std::sort(all.begin(), all.end(), [](const Message& a, const Message& b) { return urgency(a) < urgency(b); });
  return all;
}

/// Blocking by two frames, the longest that there are: the one that is under way, and one more that gets in when a
/// mailbox is filled a moment after the bus has become free (the analysis lets a node offer its most urgent frame at
/// once).
inline double response_on_the_bus_s(const std::vector<Message>& messages, std::size_t which, double bits_per_second) {
  const bool long_ones = std::any_of(messages.begin(), messages.end(), [](const Message& m) { return m.long_id; });
  return response_s(messages, which, 2 * worst_bits(8, long_ones) / bits_per_second, 1 / bits_per_second,
                    [&](const Message& m) { return worst_bits(m) / bits_per_second; });
}

}  // namespace bms::can_bus
