// How long a frame takes at worst from its sample to the end on the wire: R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, "Controller Area
// Network (CAN) schedulability analysis: refuted, revisited and revised", Real-Time Systems 35 (2007) 239-272.
//
//   bits of a standard frame of s bytes, stuffed at worst, with intermission    34 + 8 s + 13 + (34 + 8 s - 1) / 4     (eq. 2): 8 bytes 135
//   busy period      t    = B + sum over k of higher priority and m itself of ceil((t + J_k) / T_k) C_k                (eq. 9)
//   queueing delay   w(q) = B + q C + sum over k of higher priority of ceil((w + J_k + bit) / T_k) C_k                 (eq. 12)
//   response         R    = max over q of J + w(q) - q T + C                                                          (eq. 13, 14)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <tuple>
#include <vector>

#include "can_messages.hpp"
#include "hal/sample_frames.hpp"

namespace bms::can_bus {

struct Message {
  std::string name;
  std::uint32_t id = 0;
  unsigned length = 8;    ///< bytes
  double period_s = 1;
  double jitter_s = 0;    ///< between what asks for it and its place in the queue
};

constexpr unsigned worst_bits(unsigned length) { return 34 + 8 * length + 13 + (34 + 8 * length - 1) / 4; }

inline double load(const std::vector<Message>& messages, double bits_per_second) {
  double bits_each_second = 0;
  for (const Message& m : messages) bits_each_second += worst_bits(m.length) / m.period_s;
  return bits_each_second / bits_per_second;
}

/// Worst-case response of message `which` [s]; infinity when the bus is full. time_s(m): its time on the wire; blocking_s: of a frame
/// less urgent that is under way.
template <class Time>
double response_s(const std::vector<Message>& messages, std::size_t which, double blocking_s, double bit_s, Time&& time_s) {
  const Message& m = messages[which];
  const double c = time_s(m);
  double utilisation = c / m.period_s;
  const auto others = [&](double until_s) {
    double sum = 0;
    for (const Message& k : messages) {
      if (k.id < m.id) sum += std::ceil((until_s + k.jitter_s) / k.period_s) * time_s(k);
    }
    return sum;
  };
  for (const Message& k : messages) utilisation += k.id < m.id ? time_s(k) / k.period_s : 0;
  if (utilisation >= 1) return std::numeric_limits<double>::infinity();
  const auto fixed_point = [](double start, auto&& next) {
    for (double now = start;;) {
      const double then = next(now);
      if (then <= now) return now;
      now = then;
    }
  };
  const double busy = fixed_point(c, [&](double t) { return blocking_s + others(t) + std::ceil((t + m.jitter_s) / m.period_s) * c; });
  double worst = 0;
  for (int q = 0; q < std::ceil((busy + m.jitter_s) / m.period_s); ++q) {
    const double w = fixed_point(blocking_s + q * c, [&](double t) { return blocking_s + q * c + others(t + bit_s); });
    worst = std::max(worst, m.jitter_s + w - q * m.period_s + c);
  }
  return worst;
}

/// From a complete sample to its last frame in the queue: what the firmware works until then. Of 16 cells 0.9 ms at an instruction a cycle (bxcan_board_test
/// measures it), two cycles on the chip at most.
inline constexpr double sample_to_queue_s = 2e-3;

/// Where the samples come from: of a chip on the board, or in frames of the bus (hal/sample_frames.hpp).
enum class Cells { measured_by_the_board, measured_by_another_node };
inline constexpr std::size_t cells_of_a_pack = 16;

/// What is in the DBC file: by its cycle time, or, without one, with every sample (of those that are sent once this is too much); and
/// the frames that bring a sample, if it comes by the bus; of their sender, which keeps their order, the latest bound holds for all. jitter_s: from a complete sample to the queue.
inline std::vector<Message> messages_on_the_bus(double samples_per_second, double jitter_s, Cells cells) {
  std::vector<Message> all;
  std::apply([&](auto... m) { (all.push_back({m.name, m.id, m.frame(0).length, m.cycle_us > 0 ? 1e-6 * m.cycle_us : 1 / samples_per_second, jitter_s}), ...); }, can::Messages{});
  if (cells == Cells::measured_by_another_node) {
    for (const hal::CanFrame& f : hal::frames_of(PackSample<cells_of_a_pack>{}, 0, 0)) all.push_back({"(of a sample)", f.id, f.length, 1 / samples_per_second, 0});
  }
  std::sort(all.begin(), all.end(), [](const Message& a, const Message& b) { return a.id < b.id; });
  return all;
}

/// Blocking by two frames: the one that is under way, and one more that gets in when a mailbox is filled a moment after the bus has
/// become free (the analysis lets a node offer its most urgent frame at once).
inline double response_on_the_bus_s(const std::vector<Message>& messages, std::size_t which, double bits_per_second) {
  return response_s(messages, which, 2 * worst_bits(8) / bits_per_second, 1 / bits_per_second, [&](const Message& m) { return worst_bits(m.length) / bits_per_second; });
}

}  // namespace bms::can_bus
