// Chargers on the bus, written from what their makers publish (firmware/can/messages.md), and the cells that they fill.
// They share no code with the firmware. A test runs them around the application on this machine or around the flashed
// image in a truck.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "hal/can.hpp"
#include "plant/truth_cell.hpp"

namespace bms::firmware {

/// A charger that holds a voltage and limits a current. Its faults are set by the test.
class Charger {
 public:
  virtual ~Charger() = default;
  /// The frames that it sends now.
  virtual std::vector<can::Frame> send(double now_s) = 0;
  virtual void receive(const can::Frame& frame, double now_s) = 0;

  /// What its output is set to: it holds the voltage and limits the current.
  double limit_a(double now_s) const { return ignores_limit ? rated_a : std::min(rated_a, wanted_a(now_s)); }
  double target_v(double now_s) const { return own_target_v.value_or(wanted_v(now_s)); }

  /// Current into the pack: a regulator with the time constant of a power supply.
  double current_a(double terminals_v, bool connected, double now_s) {
    const double most_a = limit_a(now_s), volts = target_v(now_s);
    if (!connected || most_a <= 0 || volts <= 0) return current_a_ = 0;
    constexpr double loop_ohm = 0.3;
    current_a_ = std::clamp(current_a_ + 0.3 * (volts - terminals_v) / loop_ohm, 0.0, most_a);
    return current_a_;
  }
  double output_a() const { return current_a_; }
  /// Where a circuit computes its current: what it measures at its output.
  void measured(double volts, double amperes) {
    pack_v = volts;
    current_a_ = amperes;
  }

  bool silent = false, deaf = false, ignores_limit = false;
  std::optional<double> own_target_v, reported_v;
  double rated_a = 6, pack_v = 0;

 protected:
  virtual double wanted_a(double now_s) const = 0;
  virtual double wanted_v(double now_s) const = 0;

 private:
  double current_a_ = 0;
};

/// Elcon: 0x1806E5F4 every second at the latest, else it stops after five; 0x18FF50E5 every second.
class ElconCharger : public Charger {
 public:
  std::vector<can::Frame> send(double now_s) override {
    if (silent || now_s < next_s_) return {};
    next_s_ = now_s + 1;
    const auto v = static_cast<unsigned>(std::lround(10 * reported_v.value_or(pack_v))),
               a = static_cast<unsigned>(std::lround(10 * output_a()));
    const auto b = [](unsigned x) { return static_cast<std::uint8_t>(x); };
    const bool lost = now_s - received_s_ > 5;
    return {{0x18FF50E5, 8, {b(v >> 8), b(v), b(a >> 8), b(a), b(lost ? 0x10 : 0), 0, 0, 0}, true}};
  }
  void receive(const can::Frame& f, double now_s) override {
    if (deaf || !f.long_id || f.id != 0x1806E5F4 || f.length != 8) return;
    received_s_ = now_s;
    voltage_v_ = 0.1 * (256 * f.data[0] + f.data[1]);
    allowed_a_ = 0.1 * (256 * f.data[2] + f.data[3]);
    on_ = f.data[4] == 0;
  }

 protected:
  double wanted_a(double now_s) const override { return on_ && now_s - received_s_ <= 5 ? allowed_a_ : 0; }
  double wanted_v(double) const override { return voltage_v_; }

 private:
  double next_s_ = 0, received_s_ = -100, voltage_v_ = 0, allowed_a_ = 0;
  bool on_ = false;
};

/// CiA 419: heartbeat every second; charges what receive PDO 3 asks for while PDO 1 says ready, up to its own voltage.
class CanopenCharger : public Charger {
 public:
  explicit CanopenCharger(double end_v = 16 * 3.55) { own_target_v = end_v; }
  std::vector<can::Frame> send(double now_s) override {
    if (silent || now_s < next_s_) return {};
    next_s_ = now_s + 1;
    return {{0x70A, 1, {5}}};
  }
  void receive(const can::Frame& f, double now_s) override {
    if (deaf || f.long_id) return;
    if (f.id == 0x20A && f.length == 3) ready_ = (f.data[2] & 1) != 0;
    if (f.id != 0x40A || f.length != 3) return;
    allowed_a_ = (f.data[0] | f.data[1] << 8) / 16.0;
    received_s_ = now_s;
  }

 protected:
  double wanted_a(double now_s) const override { return ready_ && now_s - received_s_ <= 1 ? allowed_a_ : 0; }
  double wanted_v(double) const override { return 0; }

 private:
  double next_s_ = 0, received_s_ = -100, allowed_a_ = 0;
  bool ready_ = false;
};

/// The reference cell, whose voltage rises steeply once the positive electrode is empty of lithium: 0.1 V per percent.
/// The curve of the paper ends at 100 %.
inline plant::MonotoneCurve ocv_beyond_full() {
  const plant::MonotoneCurve ocv = plant::table9_ocv_v();
  std::vector<plant::Point> points;
  for (int k = 0; k <= 50; ++k) points.push_back({k / 50.0, ocv.at(k / 50.0)});
  points.push_back({1.01, points.back().y + 0.1});
  points.push_back({1.02, points.back().y + 0.15});
  return plant::MonotoneCurve(points);
}

}  // namespace bms::firmware
