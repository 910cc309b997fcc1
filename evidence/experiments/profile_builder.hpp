// Builds the profile of an experiment. Designs use it; the names are in experiment.hpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "experiments/experiment.hpp"
#include "experiments/splitmix.hpp"

namespace bms::experiments {

/// A current profile under construction: linear pieces of current over time, and a random stream.
class ProfileBuilder {
 public:
  explicit ProfileBuilder(const ExperimentOptions& options)
      : high_c_rate(options.high_c_rate), low_c_rate(options.low_c_rate), random_(options.seed) {}

  const double high_c_rate, low_c_rate;

  void ramp(int duration_s, double from_c_rate, double to_c_rate) {
    pieces_.push_back({.duration_s = duration_s,
                       .from_c_rate = std::clamp(from_c_rate, -1.0, 1.0),
                       .to_c_rate = std::clamp(to_c_rate, -1.0, 1.0),
                       .temperature_c = temperature_c_,
                       .open = false,
                       .ammeter = ammeter_,
                       .voltmeter = voltmeter_,
                       .source_v = no_value});
    time_s_ += duration_s;
  }
  /// Contactor open; the sense wires are on the cell, or on a reference source of this voltage.
  void open(int duration_s, double source_v = no_value) {
    pieces_.push_back({.duration_s = duration_s,
                       .from_c_rate = 0,
                       .to_c_rate = 0,
                       .temperature_c = temperature_c_,
                       .open = true,
                       .ammeter = false,
                       .voltmeter = false,
                       .source_v = source_v});
    time_s_ += duration_s;
  }
  /// From this time on a trusted ammeter is in series, or a voltmeter on the terminals.
  void insert_ammeter() { ammeter_ = true; }
  void apply_voltmeter() { voltmeter_ = true; }
  /// Temperature of the chamber from this time on.
  void set_temperature(double temperature_c) { temperature_c_ = temperature_c; }
  /// Changes the state of charge at a constant rate.
  void move(double soc_change, double c_rate) {
    hold(static_cast<int>(std::lround(std::abs(soc_change) * 3'600 / c_rate)), soc_change > 0 ? c_rate : -c_rate);
  }
  void hold(int duration_s, double c_rate) { ramp(duration_s, c_rate, c_rate); }

  int time_s() const { return time_s_; }

  /// Random integer, both ends included.
  int between(int low, int high) {
    const auto choices = static_cast<std::uint64_t>(high - low + 1);
    return low + static_cast<int>((random_.bits() >> 32) * choices >> 32);
  }
  double between(double low, double high) {
    return low + (high - low) * (static_cast<double>(random_.bits() >> 11) * 0x1p-53);
  }

  std::vector<ProfileRow> sampled(double capacity_ah, double step_s) const {
    const int step_ms = std::max(1, static_cast<int>(std::lround(step_s * 1e3)));
    std::vector<ProfileRow> rows = {{0, 0}};
    if (!pieces_.empty()) rows.front().temperature_c = pieces_.front().temperature_c;
    double charge = 0;  // of the current row, 1C times milliseconds
    int filled_ms = 0;
    bool open = true;
    for (const Piece& piece : pieces_) {
      const int duration_ms = piece.duration_s * 1'000;
      for (int done_ms = 0; done_ms < duration_ms;) {
        const int part_ms = std::min(step_ms - filled_ms, duration_ms - done_ms);
        const double middle = (done_ms + part_ms / 2.0) / duration_ms;
        charge += part_ms * (piece.from_c_rate + (piece.to_c_rate - piece.from_c_rate) * middle);
        open = open && piece.open;
        done_ms += part_ms;
        filled_ms += part_ms;
        if (filled_ms < step_ms) break;
        const double current_a = std::round(charge / step_ms * capacity_ah * 1e3) / 1e3;
        rows.push_back({static_cast<double>(rows.size()) * step_ms / 1e3, current_a + 0.0, piece.temperature_c, open,
                        piece.ammeter, piece.voltmeter, piece.source_v});  // + 0.0: no "-0"
        charge = 0;
        filled_ms = 0;
        open = true;
      }
    }
    return rows;
  }

 private:
  struct Piece {
    int duration_s;
    double from_c_rate, to_c_rate;
    double temperature_c;
    bool open, ammeter, voltmeter;
    double source_v;
  };
  static constexpr double no_value = std::numeric_limits<double>::quiet_NaN();

  SplitMix random_;
  double temperature_c_ = no_value;
  bool ammeter_ = false, voltmeter_ = false;
  std::vector<Piece> pieces_;
  int time_s_ = 0;
};

}  // namespace bms::experiments
