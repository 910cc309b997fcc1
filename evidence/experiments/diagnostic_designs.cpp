// Designs that distinguish causes which an ordinary recording leaves open. They begin at 95 %, reached from a full
// charge and with charging last: there the state of charge and the history are known best.
#include "experiments/designs.hpp"
#include "experiments/profile_builder.hpp"

namespace bms::experiments {

namespace {

constexpr int minute_s = 60, hour_s = 3'600;

/// Discharge and charge at nearly 1C.
void there_and_back(ProfileBuilder& cell) {
  cell.hold(2 * minute_s, 0);
  for (int turn = 0; turn < 3; ++turn) {
    for (const double direction : {-1.0, 1.0}) {
      cell.hold(4 * minute_s, 0.98 * direction);
      cell.hold(minute_s, 0);
    }
  }
}

}  // namespace

/// The sensors alone: no current flows, and a source defines what the voltage sensor should read.
void meter_check(ProfileBuilder& cell) {
  constexpr double low_v = 2.5, high_v = 3.6;  // within the range of every channel, as far apart as the cell's voltages
  cell.open(5 * minute_s);
  for (int turn = 0; turn < 5; ++turn) {
    cell.open(2 * minute_s, low_v);
    cell.open(2 * minute_s, high_v);
  }
  cell.open(5 * minute_s);
}

/// The current sensor compared with a better one.
void shunt_check(ProfileBuilder& cell) {
  cell.insert_ammeter();
  there_and_back(cell);
}

/// In addition the voltage channel compared with a meter on the cell itself: the difference is a contact resistance.
void terminal_check(ProfileBuilder& cell) {
  cell.insert_ammeter();
  cell.apply_voltmeter();
  there_and_back(cell);
}

/// Short pulses with fast logging distinguish an immediate resistance from one after half a second.
void fast_pulses(ProfileBuilder& cell) {
  cell.hold(minute_s, 0);
  for (int k = 0; k < 25; ++k) {
    for (const double direction : {-1.0, 1.0}) {
      cell.hold(5, direction);
      cell.hold(7, 0);
    }
  }
}

void zero_current(ProfileBuilder& cell) {
  cell.hold(2 * minute_s, 0);
  cell.open(20 * minute_s);
}

/// Lost charge, real or apparent, between two visits of the lower knee, where the voltage determines the charge.
void long_rest_open(ProfileBuilder& cell) {
  cell.open(15 * minute_s);
  cell.move(-0.87, 0.5);
  cell.hold(20 * minute_s, 0);
  cell.move(0.12, 0.5);
  cell.open(8 * hour_s);
  cell.move(-0.12, 0.5);
  cell.hold(20 * minute_s, 0);
}

/// The same with much charge throughput instead of time.
void charge_turns(ProfileBuilder& cell) {
  cell.open(15 * minute_s);
  cell.move(-0.87, 0.5);
  cell.hold(20 * minute_s, 0);
  for (int turn = 0; turn < 5; ++turn) {
    cell.move(0.5, 0.9);
    cell.move(-0.5, 0.9);
  }
  cell.hold(20 * minute_s, 0);
}

void full_cycle(ProfileBuilder& cell) {
  cell.hold(10 * minute_s, 0);
  cell.move(-0.9, 0.4);
  cell.hold(40 * minute_s, 0);
  cell.move(0.88, 0.4);
  cell.hold(40 * minute_s, 0);
}

/// Each level once from above and once from below, with rests longer than the diffusion; loops of three sizes at three
/// rates.
void loops_and_rests(ProfileBuilder& cell) {
  cell.hold(10 * minute_s, 0);
  for (const double rate : {0.9, 0.45, 0.2}) {
    cell.move(-0.25, 0.9);
    cell.hold(40 * minute_s, 0);
    cell.move(-0.08, rate);
    cell.hold(20 * minute_s, 0);
    cell.move(0.08, rate);
    cell.hold(40 * minute_s, 0);
    cell.move(0.02, rate);
    cell.move(-0.02, rate);
    cell.hold(10 * minute_s, 0);
  }
  cell.move(0.25, 0.9);
  cell.hold(40 * minute_s, 0);
}

void rate_steps(ProfileBuilder& cell) {
  cell.hold(5 * minute_s, 0);
  for (int level = 0; level < 5; ++level) {
    if (level > 0) {
      cell.move(-0.2, 0.9);
      cell.hold(10 * minute_s, 0);
    }
    for (const double rate : {0.1, 0.3, 1.0}) {
      for (const int pulse_s : {5, 30}) {
        for (const double direction : {-1.0, 1.0}) {
          cell.hold(pulse_s, direction * rate);
          cell.hold(pulse_s + 10, 0);
        }
      }
    }
  }
  cell.hold(10 * minute_s, 0);
}

/// Pulses without heating at two temperatures and again at the first one; then heating at constant chamber temperature.
void climate_steps(ProfileBuilder& cell) {
  const auto pulses = [&](int duration_s, double rate) {
    for (const int until_s = cell.time_s() + duration_s; cell.time_s() < until_s;) {
      for (const double direction : {-1.0, 1.0}) {
        cell.hold(30, direction * rate);
        cell.hold(30, 0);
      }
    }
  };
  cell.set_temperature(25);
  cell.hold(5 * minute_s, 0);
  cell.move(-0.35, 0.5);
  cell.hold(20 * minute_s, 0);
  for (const double temperature_c : {25.0, 10.0, 25.0}) {
    cell.set_temperature(temperature_c);
    pulses(70 * minute_s, 0.35);
  }
  for (const int until_s = cell.time_s() + 40 * minute_s; cell.time_s() < until_s;) {
    cell.hold(60, -1);
    cell.hold(60, 1);
  }
  pulses(40 * minute_s, 0.35);
}

}  // namespace bms::experiments
