#include "experiments/experiment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "experiments/splitmix.hpp"

namespace bms::experiments {

/// What a design writes on: straight pieces of current over time, and a source of chance.
class ProfileBuilder {
 public:
  explicit ProfileBuilder(const ExperimentOptions& options)
      : high_c_rate(options.high_c_rate), low_c_rate(options.low_c_rate), random_(options.seed) {}

  const double high_c_rate, low_c_rate;

  void ramp(int duration_s, double from_c_rate, double to_c_rate) {
    pieces_.push_back({duration_s, std::clamp(from_c_rate, -1.0, 1.0), std::clamp(to_c_rate, -1.0, 1.0), temperature_c_,
                       false, ammeter_, voltmeter_, no_value});
    time_s_ += duration_s;
  }
  /// Contactor open, the sense wires on the cell or on a reference source.
  void open(int duration_s, double source_v = no_value) {
    pieces_.push_back({duration_s, 0, 0, temperature_c_, true, false, false, source_v});
    time_s_ += duration_s;
  }
  /// From here on.
  void insert_ammeter() { ammeter_ = true; }
  void apply_voltmeter() { voltmeter_ = true; }
  /// Of the chamber, from here on.
  void set_temperature(double temperature_c) { temperature_c_ = temperature_c; }
  /// By so much state of charge, at a constant rate.
  void move(double soc_change, double c_rate) {
    hold(static_cast<int>(std::lround(std::abs(soc_change) * 3'600 / c_rate)), soc_change > 0 ? c_rate : -c_rate);
  }
  void hold(int duration_s, double c_rate) { ramp(duration_s, c_rate, c_rate); }

  int time_s() const { return time_s_; }

  /// Whole number, both ends included.
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
    double charge = 0;  // of the row being filled, 1C times milliseconds
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

namespace {

// The truck of forklift_shift. The paper shows the current of a real one (Fig. 9: lifting and manoeuvres) but does not
// publish it; amplitudes and durations here are chosen to look like it within 1C. `load` and `height` run from 0 to 1.

constexpr double standby_c_rate = -0.012;  // controller, display, lights

void stand(ProfileBuilder& truck, int duration_s) { truck.hold(duration_s, standby_c_rate); }

/// No second under a foot or a load is like the last.
void unsteady(ProfileBuilder& truck, int duration_s, double c_rate) {
  for (int k = 0; k < duration_s; ++k) truck.hold(1, c_rate * truck.between(0.88, 1.12));
}

void travel(ProfileBuilder& truck, int cruise_s, double load) {
  const double start = -(0.64 + 0.24 * load) * truck.between(0.9, 1.1), cruise = -(0.36 + 0.18 * load);
  truck.ramp(1, standby_c_rate, start);
  unsteady(truck, truck.between(2, 4), start);
  truck.ramp(2, start, cruise);
  unsteady(truck, cruise_s, cruise);
  const double regeneration = (0.25 + 0.2 * load) * truck.between(0.7, 1.2);
  truck.ramp(1, 0, regeneration);
  truck.ramp(truck.between(2, 4), regeneration, 0);
}

/// Back and forth in front of a rack: bursts of one to three seconds.
void manoeuvre(ProfileBuilder& truck) {
  for (int moves = truck.between(2, 5); moves > 0; --moves) {
    const int burst_s = truck.between(1, 3);  // one draw a statement: the order of arguments is the compiler's
    truck.hold(burst_s, truck.between(-0.5, -0.25));
    truck.hold(1, truck.between(0.05, 0.15));
    stand(truck, truck.between(1, 3));
  }
}

void lift(ProfileBuilder& truck, double height, double load) {
  const double pump = -(0.58 + 0.37 * load);
  truck.ramp(1, standby_c_rate, pump);
  unsteady(truck, 2 + static_cast<int>(9 * height), pump);
  stand(truck, truck.between(1, 3));
}

/// What hangs on the fork drives the pump backwards.
void lower(ProfileBuilder& truck, double height, double load) {
  unsteady(truck, 2 + static_cast<int>(7 * height), 0.08 + 0.24 * load);
  stand(truck, truck.between(1, 3));
}

void put_away(ProfileBuilder& truck) {
  const double load = truck.between(0.4, 1.0), height = truck.between(0.3, 1.0);
  lift(truck, 0, load);
  travel(truck, truck.between(10, 28), load);
  manoeuvre(truck);
  lift(truck, height, load);
  manoeuvre(truck);
  lower(truck, height, 0);
  travel(truck, truck.between(10, 28), 0);
}

void fetch(ProfileBuilder& truck) {
  const double load = truck.between(0.4, 1.0), height = truck.between(0.3, 1.0);
  travel(truck, truck.between(10, 28), 0);
  manoeuvre(truck);
  lift(truck, height, 0);
  manoeuvre(truck);
  lower(truck, height, load);
  travel(truck, truck.between(10, 28), load);
  lower(truck, 0, load);
}

void load_lorry(ProfileBuilder& truck) {
  for (int pallets = truck.between(2, 3); pallets > 0; --pallets) {
    const double load = truck.between(0.5, 1.0);
    lift(truck, 0.1, load);
    travel(truck, truck.between(4, 8), load);
    lower(truck, 0.1, load);
    manoeuvre(truck);
    travel(truck, truck.between(4, 8), 0);
  }
}

void work_until(ProfileBuilder& truck, int time_s) {
  constexpr int longest_job_s = 500;
  while (time_s - truck.time_s() > longest_job_s) {
    const int job = truck.between(0, 9);
    (job < 4 ? put_away : job < 8 ? fetch : load_lorry)(truck);
    stand(truck, truck.between(0, 14) == 0 ? truck.between(90, 240)
                                           : truck.between(3, 22));  // now and then there is paperwork
  }
  travel(truck, 15, 0);
  truck.hold(time_s - truck.time_s(), 0);  // parked, key off
}

/// Tapers at its end, where a charger would hold the voltage: a profile knows only the clock.
void charge(ProfileBuilder& truck, int duration_s, double c_rate) {
  truck.ramp(10, 0, c_rate);
  truck.hold(duration_s - 310, c_rate);
  truck.ramp(300, c_rate, 0.25 * c_rate);
}

void coffee_break(ProfileBuilder& truck) {
  truck.hold(60, 0);
  charge(truck, 12 * 60, 0.5);
  truck.hold(180, 0);
}

void lunch_break(ProfileBuilder& truck) {
  truck.hold(300, 0);
  charge(truck, 30 * 60, 0.98);
  truck.hold(900, 0);
}

void forklift_shift(ProfileBuilder& truck) {
  constexpr int minute_s = 60;
  truck.hold(5 * minute_s, 0);
  work_until(truck, 125 * minute_s);
  coffee_break(truck);
  work_until(truck, 240 * minute_s);
  lunch_break(truck);
  work_until(truck, 385 * minute_s);
  coffee_break(truck);
  work_until(truck, 465 * minute_s);
  truck.hold(480 * minute_s - truck.time_s(), 0);
}

// The designs of Tables 7 and 8, as current pulses around one state of charge: what is taken is given back, twenty
// minutes of it. The paper shows them (Fig. 9-11) without numbers.

constexpr int design_s = 1'200, lead_s = 60;

/// Short pulses out and in, of two heights, with rests between.
template <int rest_s>
void short_pulses(ProfileBuilder& cell) {
  constexpr int pulse_s = 10;
  cell.hold(lead_s, 0);
  for (int k = 0; cell.time_s() < design_s - lead_s; ++k) {
    const double c_rate = k % 2 == 0 ? cell.high_c_rate : 0.5 * cell.high_c_rate;
    for (const double direction : {-1.0, 1.0}) {
      cell.hold(pulse_s, direction * c_rate);
      cell.hold(rest_s, 0);
    }
  }
  cell.hold(lead_s, 0);
}

/// Long bursts that never rest: HIGH, LOW, and the same back.
template <int high_s, int low_s>
void long_bursts(ProfileBuilder& cell) {
  cell.hold(lead_s, 0);
  while (cell.time_s() < design_s - lead_s) {
    for (const double direction : {-1.0, 1.0}) {
      cell.hold(high_s, direction * cell.high_c_rate);
      cell.hold(low_s, direction * cell.low_c_rate);
    }
  }
  cell.hold(lead_s, 0);
}

/// From full to empty and back in ten steps each way, with a rest after each.
template <int rest_s>
void ocv_test(ProfileBuilder& cell) {
  cell.hold(rest_s, 0);
  const int tenth_s = static_cast<int>(360 / cell.high_c_rate);
  for (const double direction : {-1.0, 1.0}) {
    for (int step = 0; step < 10; ++step) {
      cell.hold(tenth_s, direction * cell.high_c_rate);
      cell.hold(rest_s, 0);
    }
  }
}

// Designs that tell causes apart which an ordinary recording leaves open. They begin at 95 %, come to from a full
// charge and charged last: state of charge and history are known best there.

constexpr int minute_s = 60, hour_s = 3'600;
constexpr double almost_full = 0.95;

/// The sensors alone: nothing flows, and what the voltage sensor should read a source says.
void meter_check(ProfileBuilder& cell) {
  constexpr double low_v = 2.5,
                   high_v = 3.6;  // inside every channel's range, as far apart as a lithium cell's voltages
  cell.open(5 * minute_s);
  for (int turn = 0; turn < 5; ++turn) {
    cell.open(2 * minute_s, low_v);
    cell.open(2 * minute_s, high_v);
  }
  cell.open(5 * minute_s);
}

void there_and_back(ProfileBuilder& cell) {
  cell.hold(2 * minute_s, 0);
  for (int turn = 0; turn < 3; ++turn) {
    for (const double direction : {-1.0, 1.0}) {
      cell.hold(4 * minute_s, 0.98 * direction);
      cell.hold(minute_s, 0);
    }
  }
}

/// The current sensor against a better one.
void shunt_check(ProfileBuilder& cell) {
  cell.insert_ammeter();
  there_and_back(cell);
}

/// The voltage channel too, against a meter on the cell itself: what lies between them is a contact.
void terminal_check(ProfileBuilder& cell) {
  cell.insert_ammeter();
  cell.apply_voltmeter();
  there_and_back(cell);
}

/// So short and so finely logged that a resistance at once and one after half a second are two.
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

/// What is lost or only seems to be, between two visits of the lower knee, where the voltage tells the charge.
void long_rest_open(ProfileBuilder& cell) {
  cell.open(15 * minute_s);
  cell.move(-0.87, 0.5);
  cell.hold(20 * minute_s, 0);
  cell.move(0.12, 0.5);
  cell.open(8 * hour_s);
  cell.move(-0.12, 0.5);
  cell.hold(20 * minute_s, 0);
}

/// The same with much charge turned over in place of time.
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

/// Each level once from above and once from below, with rests that outlast diffusion; loops of three sizes at three
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

/// Pulses that do not heat at two temperatures and at the first again; then heat without another temperature outside.
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

}  // namespace

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all = {
      {"rest_30s", "pulses of 10 s and rests of 30 s, 20 minutes around one state of charge", short_pulses<30>},
      {"rest_18s", "the same with rests of 18 s", short_pulses<18>},
      {"rest_5s", "the same with rests of 5 s", short_pulses<5>},
      {"high_1m_low_30s",
       "bursts of 1 min at HIGH and 30 s at LOW current, both ways, 20 minutes around one state of charge",
       long_bursts<60, 30>},
      {"high_30s_low_30s", "the same with 30 s and 30 s", long_bursts<30, 30>},
      {"high_30s_low_1m", "the same with 30 s and 1 min", long_bursts<30, 60>},
      {"ocv_1h_rest", "from full to empty and back in tenths, with rests of 1 h", ocv_test<3'600>},
      {"ocv_10min_rest", "the same with rests of 10 min", ocv_test<600>},
      {"forklift_shift",
       "eight hours of an electric forklift: driving, lifting, regeneration, breaks with opportunity charge",
       forklift_shift},
      // those below tell causes apart, the quicker ones first
      {"fast_pulses", "pulses of 5 s at 1C, ten minutes, logged ten times a second", fast_pulses, almost_full,
       "Charge the cell full, take out 10 % and put back 5 %, let it rest for an hour; log ten times a second.", 0.1},
      {"zero_current", "contactor open for 20 minutes: what the current sensor reads is its own", zero_current,
       almost_full,
       "Open the contactor where the profile has a current_ref_a, log on, and keep that column (0 A) in the "
       "recording."},
      {"shunt_check", "charge and discharge at nearly 1C with a trusted ammeter in series, half an hour", shunt_check,
       almost_full,
       "Charge the cell full, take out 10 % and put back 5 %; put a trusted ammeter or shunt in series and enter what "
       "it reads as current_ref_a in place of the profile's."},
      {"terminal_check",
       "charge and discharge at nearly 1C with a trusted ammeter in series and a voltmeter on the cell's own "
       "terminals, half an hour",
       terminal_check, almost_full,
       "Charge the cell full, take out 10 % and put back 5 %; put a trusted ammeter in series and a voltmeter on the "
       "cell's own terminals and enter what they read as current_ref_a and voltage_ref_v."},
      {"meter_check",
       "contactor open for half an hour, the voltage sense wires in turn on two voltages of a reference source",
       meter_check, almost_full,
       "Open the contactor; put the voltage sense wires on a reference source where the profile has a voltage_ref_v, "
       "and keep both reference columns in the recording, with what a trusted meter read there."},
      {"rate_steps", "pulses of three rates and two lengths, both ways, at five states of charge", rate_steps,
       almost_full,
       "Charge the cell full, take out 10 % and put back 5 %, let it rest for an hour; log once a second or faster."},
      {"climate_steps", "small pulses at 25, 10 and again 25 degrees C, then heat from within", climate_steps,
       almost_full,
       "Put the cell into a climate chamber set as temperature_c says, and log the cell's own temperature; begin at 95 "
       "%, charged last and rested for an hour."},
      {"full_cycle", "slowly down into the lower knee and up into the upper one, with rests", full_cycle, almost_full,
       "Charge the cell full, take out 10 % and put back 5 %, let it rest for an hour; no other load meanwhile."},
      {"loops_and_rests",
       "loops of three sizes at three rates, each level from above and from below, with rests of 40 minutes",
       loops_and_rests, almost_full,
       "Charge the cell full, take out 10 % and put back 5 %, let it rest for an hour; log through all rests."},
      {"charge_turns", "half the capacity in and out five times between two visits of the lower knee", charge_turns,
       almost_full,
       "Charge the cell full, take out 10 % and put back 5 %, let it rest for an hour; open the contactor where the "
       "profile has a current_ref_a and keep that column in the recording."},
      {"long_rest_open", "contactor open for 8 hours between two visits of the lower knee", long_rest_open, almost_full,
       "Charge the cell full, take out 10 % and put back 5 %, let it rest for an hour; open the contactor where the "
       "profile has a current_ref_a, log on, and keep that column in the recording."},
  };
  return all;
}

const Experiment* find_experiment(std::string_view name) {
  for (const Experiment& e : experiments()) {
    if (e.name == name) return &e;
  }
  return nullptr;
}

std::optional<std::vector<ProfileRow>> experiment(std::string_view name, const ExperimentOptions& options) {
  const Experiment* e = find_experiment(name);
  if (e == nullptr) return std::nullopt;
  ProfileBuilder builder(options);
  e->build(builder);
  return builder.sampled(options.capacity_ah, options.step_s);
}

}  // namespace bms::experiments
