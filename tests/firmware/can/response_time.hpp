// Worst-case response time of a frame, from its sample to its end on the wire: R. I. Davis, A. Burns, R. J. Bril, J. J.
// Lukkien, "Controller Area Network (CAN) schedulability analysis: refuted, revisited and revised", Real-Time Systems
// 35 (2007) 239-272.
//
//   worst bits of a standard frame of s bytes, with stuff bits and intermission (eq. 2):
//     34 + 8 s + 13 + (34 + 8 s - 1) / 4                     8 bytes: 135; with 29 bits, 54 instead of 34: 160
//   busy period (eq. 9), sum over all k of higher priority and m itself:
//     t = B + sum ceil((t + J_k) / T_k) C_k
//   queueing delay (eq. 12), sum over all k of higher priority:
//     w(q) = B + q C + sum ceil((w + J_k + bit) / T_k) C_k
//   response time (eq. 13, 14):
//     R = max over q of J + w(q) - q T + C
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
  double jitter_s = 0;   ///< from the event to the place in the queue
  bool long_id = false;  ///< 29 bits
};

constexpr unsigned worst_bits(unsigned length, bool long_id = false) {
  const unsigned stuffed = (long_id ? 54 : 34) + 8 * length;
  return stuffed + 13 + (stuffed - 1) / 4;
}
constexpr unsigned worst_bits(const Message& m) { return worst_bits(m.length, m.long_id); }
/// Arbitration value: the lower one wins.
constexpr std::uint32_t urgency(const Message& m) { return hal::bxcan::arbitration({m.id, 0, {}, m.long_id}); }

inline double load(const std::vector<Message>& messages, double bits_per_second) {
  double bits_each_second = 0;
  for (const Message& m : messages) bits_each_second += worst_bits(m) / m.period_s;
  return bits_each_second / bits_per_second;
}

/// Worst-case response time of message `which` [s]; infinity if the bus is full. blocking_s: time of a less urgent
/// frame that is already being sent. time_s(m): time of a frame on the wire.
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

/// Time of the firmware from a complete sample to the last of its frames in the queue. bxcan_board_test measures half
/// of it at one cycle per instruction; the chip needs at most two.
inline constexpr double sample_to_queue_s = 3e-3;

/// Source of the samples: a chip on the board, or frames on the bus (hal/sample_frames.hpp).
enum class Cells { measured_by_the_board, measured_by_another_node };
/// Additional messages of the image (build option BMS_VEHICLE_PROFILE).
enum class Profile { none, cia418, j1939 };

/// Packs of more than 16 cells have more messages, and more frames of a sample.
enum class Pack { of_16_cells, of_24_cells, of_32_cells };
inline bool sends(Pack pack, std::uint32_t id) {
  const bool above_16 = id == can::CellVoltages5::id || id == can::CellVoltages6::id || id == can::PackVoltage::id,
             above_24 = id == can::CellVoltages7::id || id == can::CellVoltages8::id;
  return pack == Pack::of_32_cells || (!above_24 && (pack == Pack::of_24_cells || !above_16));
}
template <std::size_t Cells>
void add_frames_of_a_sample(double samples_per_second, std::vector<Message>& to) {
  for (const can::Frame& f : hal::frames_of(measurement::PackSample<Cells>{}, 0, 0))
    to.push_back({"(of a sample)", f.id, f.length, 1 / samples_per_second, 0});
}

/// All messages of the DBC file. Without a cycle time, a message counts with every sample (also one that is sent once).
/// Added are the frames that bring a sample, if they come over the bus, and those of the profile. The sender of samples
/// keeps their order, so the latest bound holds for all of its frames. jitter_s: from a complete sample to the queue.
inline std::vector<Message> messages_on_the_bus(double samples_per_second, double jitter_s, Cells cells,
                                                Profile profile = Profile::none, Pack pack = Pack::of_16_cells) {
  std::vector<Message> all;
  std::apply(
      [&](auto... m) {
        (all.push_back(
             {m.name, m.id, m.frame(0).length, m.cycle_us > 0 ? 1e-6 * m.cycle_us : 1 / samples_per_second, jitter_s}),
         ...);
      },
      can::Messages{});
  std::erase_if(all, [&](const Message& m) { return !sends(pack, m.id); });
  if (cells == Cells::measured_by_another_node && pack == Pack::of_32_cells)
    add_frames_of_a_sample<32>(samples_per_second, all);
  else if (cells == Cells::measured_by_another_node && pack == Pack::of_24_cells)
    add_frames_of_a_sample<24>(samples_per_second, all);
  else if (cells == Cells::measured_by_another_node)
    add_frames_of_a_sample<16>(samples_per_second, all);
  if (profile == Profile::cia418) {
    all.push_back({"(heartbeat)", firmware::canopen::heartbeat_id + hal::canopen_node, 1,
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

/// Worst-case response time on this bus. Two of the longest frames block: the one being sent, and one more that is sent
/// first if a mailbox is filled just after the bus became free. (The analysis assumes that a node offers its most
/// urgent frame immediately.)
inline double response_on_the_bus_s(const std::vector<Message>& messages, std::size_t which, double bits_per_second) {
  const bool long_ones = std::any_of(messages.begin(), messages.end(), [](const Message& m) { return m.long_id; });
  return response_s(messages, which, 2 * worst_bits(8, long_ones) / bits_per_second, 1 / bits_per_second,
                    [&](const Message& m) { return worst_bits(m) / bits_per_second; });
}

}  // namespace bms::can_bus
