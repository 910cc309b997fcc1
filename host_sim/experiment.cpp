#include "host_sim/experiment.hpp"

#include <algorithm>
#include <cmath>

#include "host_sim/splitmix.hpp"

namespace bms {

/// What a design writes on: straight pieces of current over time, and a source of chance.
class Course {
 public:
  explicit Course(const ExperimentOptions& options) : high_c_rate(options.high_c_rate), low_c_rate(options.low_c_rate), random_(options.seed) {}

  const double high_c_rate, low_c_rate;

  void ramp(int duration_s, double from_c_rate, double to_c_rate) {
    pieces_.push_back({duration_s, std::clamp(from_c_rate, -1.0, 1.0), std::clamp(to_c_rate, -1.0, 1.0)});
    time_s_ += duration_s;
  }
  void hold(int duration_s, double c_rate) { ramp(duration_s, c_rate, c_rate); }

  int time_s() const { return time_s_; }

  /// Whole number, both ends included.
  int between(int low, int high) {
    const auto choices = static_cast<std::uint64_t>(high - low + 1);
    return low + static_cast<int>((random_.bits() >> 32) * choices >> 32);
  }
  double between(double low, double high) { return low + (high - low) * (static_cast<double>(random_.bits() >> 11) * 0x1p-53); }

  std::vector<ProfileRow> sampled(double capacity_ah, double step_s) const {
    const int step_ms = std::max(1, static_cast<int>(std::lround(step_s * 1e3)));
    std::vector<ProfileRow> rows = {{0, 0}};
    double charge = 0;  // of the row being filled, 1C times milliseconds
    int filled_ms = 0;
    for (const Piece& piece : pieces_) {
      const int duration_ms = piece.duration_s * 1'000;
      for (int done_ms = 0; done_ms < duration_ms;) {
        const int part_ms = std::min(step_ms - filled_ms, duration_ms - done_ms);
        const double middle = (done_ms + part_ms / 2.0) / duration_ms;
        charge += part_ms * (piece.from_c_rate + (piece.to_c_rate - piece.from_c_rate) * middle);
        done_ms += part_ms;
        filled_ms += part_ms;
        if (filled_ms < step_ms) break;
        const double current_a = std::round(charge / step_ms * capacity_ah * 1e3) / 1e3;
        rows.push_back({static_cast<double>(rows.size()) * step_ms / 1e3, current_a + 0.0});  // + 0.0: no "-0"
        charge = 0;
        filled_ms = 0;
      }
    }
    return rows;
  }

 private:
  struct Piece {
    int duration_s;
    double from_c_rate, to_c_rate;
  };

  SplitMix random_;
  std::vector<Piece> pieces_;
  int time_s_ = 0;
};

namespace {

// The truck of forklift_shift. The paper shows the current of a real one (Fig. 9: lifting and manoeuvres) but does not publish
// it; amplitudes and durations here are chosen to look like it within 1C. `load` and `height` run from 0 to 1.

constexpr double standby_c_rate = -0.012;  // controller, display, lights

void stand(Course& truck, int duration_s) { truck.hold(duration_s, standby_c_rate); }

/// No second under a foot or a load is like the last.
void unsteady(Course& truck, int duration_s, double c_rate) {
  for (int k = 0; k < duration_s; ++k) truck.hold(1, c_rate * truck.between(0.88, 1.12));
}

void travel(Course& truck, int cruise_s, double load) {
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
void manoeuvre(Course& truck) {
  for (int moves = truck.between(2, 5); moves > 0; --moves) {
    const int burst_s = truck.between(1, 3);  // one draw a statement: the order of arguments is the compiler's
    truck.hold(burst_s, truck.between(-0.5, -0.25));
    truck.hold(1, truck.between(0.05, 0.15));
    stand(truck, truck.between(1, 3));
  }
}

void lift(Course& truck, double height, double load) {
  const double pump = -(0.58 + 0.37 * load);
  truck.ramp(1, standby_c_rate, pump);
  unsteady(truck, 2 + static_cast<int>(9 * height), pump);
  stand(truck, truck.between(1, 3));
}

/// What hangs on the fork drives the pump backwards.
void lower(Course& truck, double height, double load) {
  unsteady(truck, 2 + static_cast<int>(7 * height), 0.08 + 0.24 * load);
  stand(truck, truck.between(1, 3));
}

void put_away(Course& truck) {
  const double load = truck.between(0.4, 1.0), height = truck.between(0.3, 1.0);
  lift(truck, 0, load);
  travel(truck, truck.between(10, 28), load);
  manoeuvre(truck);
  lift(truck, height, load);
  manoeuvre(truck);
  lower(truck, height, 0);
  travel(truck, truck.between(10, 28), 0);
}

void fetch(Course& truck) {
  const double load = truck.between(0.4, 1.0), height = truck.between(0.3, 1.0);
  travel(truck, truck.between(10, 28), 0);
  manoeuvre(truck);
  lift(truck, height, 0);
  manoeuvre(truck);
  lower(truck, height, load);
  travel(truck, truck.between(10, 28), load);
  lower(truck, 0, load);
}

void load_lorry(Course& truck) {
  for (int pallets = truck.between(2, 3); pallets > 0; --pallets) {
    const double load = truck.between(0.5, 1.0);
    lift(truck, 0.1, load);
    travel(truck, truck.between(4, 8), load);
    lower(truck, 0.1, load);
    manoeuvre(truck);
    travel(truck, truck.between(4, 8), 0);
  }
}

void work_until(Course& truck, int time_s) {
  constexpr int longest_job_s = 500;
  while (time_s - truck.time_s() > longest_job_s) {
    const int job = truck.between(0, 9);
    (job < 4 ? put_away : job < 8 ? fetch : load_lorry)(truck);
    stand(truck, truck.between(0, 14) == 0 ? truck.between(90, 240) : truck.between(3, 22));  // now and then there is paperwork
  }
  travel(truck, 15, 0);
  truck.hold(time_s - truck.time_s(), 0);  // parked, key off
}

/// Tapers at its end, where a charger would hold the voltage: a profile knows only the clock.
void charge(Course& truck, int duration_s, double c_rate) {
  truck.ramp(10, 0, c_rate);
  truck.hold(duration_s - 310, c_rate);
  truck.ramp(300, c_rate, 0.25 * c_rate);
}

void coffee_break(Course& truck) {
  truck.hold(60, 0);
  charge(truck, 12 * 60, 0.5);
  truck.hold(180, 0);
}

void lunch_break(Course& truck) {
  truck.hold(300, 0);
  charge(truck, 30 * 60, 0.98);
  truck.hold(900, 0);
}

void forklift_shift(Course& truck) {
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

// The designs of Tables 7 and 8, as current pulses around one state of charge: what is taken is given back, twenty minutes of it.
// The paper shows them (Fig. 9-11) without numbers.

constexpr int design_s = 1'200, lead_s = 60;

/// Short pulses out and in, of two heights, with rests between.
template <int rest_s>
void short_pulses(Course& cell) {
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
void long_bursts(Course& cell) {
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
void ocv_test(Course& cell) {
  cell.hold(rest_s, 0);
  const int tenth_s = static_cast<int>(360 / cell.high_c_rate);
  for (const double direction : {-1.0, 1.0}) {
    for (int step = 0; step < 10; ++step) {
      cell.hold(tenth_s, direction * cell.high_c_rate);
      cell.hold(rest_s, 0);
    }
  }
}

}  // namespace

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all = {
      {"rest_30s", "pulses of 10 s and rests of 30 s, 20 minutes around one state of charge", short_pulses<30>},
      {"rest_18s", "the same with rests of 18 s", short_pulses<18>},
      {"rest_5s", "the same with rests of 5 s", short_pulses<5>},
      {"high_1m_low_30s", "bursts of 1 min at HIGH and 30 s at LOW current, both ways, 20 minutes around one state of charge", long_bursts<60, 30>},
      {"high_30s_low_30s", "the same with 30 s and 30 s", long_bursts<30, 30>},
      {"high_30s_low_1m", "the same with 30 s and 1 min", long_bursts<30, 60>},
      {"ocv_1h_rest", "from full to empty and back in tenths, with rests of 1 h", ocv_test<3'600>},
      {"ocv_10min_rest", "the same with rests of 10 min", ocv_test<600>},
      {"forklift_shift", "eight hours of an electric forklift: driving, lifting, regeneration, breaks with opportunity charge", forklift_shift},
  };
  return all;
}

std::optional<std::vector<ProfileRow>> experiment(std::string_view name, const ExperimentOptions& options) {
  for (const Experiment& e : experiments()) {
    if (e.name != name) continue;
    Course course(options);
    e.lay_out(course);
    return course.sampled(options.capacity_ah, options.step_s);
  }
  return std::nullopt;
}

}  // namespace bms
