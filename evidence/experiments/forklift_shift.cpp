// The truck of forklift_shift. The paper shows the current of a real truck (Fig. 9: lifting and manoeuvres) but does
// not publish it. Amplitudes and durations here are chosen to look similar within 1C. `load` and `height`: 0 to 1.
#include "experiments/designs.hpp"
#include "experiments/profile_builder.hpp"

namespace bms::experiments {

namespace {

constexpr double standby_c_rate = -0.012;  // controller, display, lights

void stand(ProfileBuilder& truck, int duration_s) { truck.hold(duration_s, standby_c_rate); }

/// Every second differs a little from the one before.
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
    const int burst_s = truck.between(1, 3);  // one draw per statement, because the order of arguments is unspecified
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

/// The load on the fork drives the pump backwards.
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

/// job: 0..9.
void do_job(ProfileBuilder& truck, int job) {
  if (job < 4)
    put_away(truck);
  else if (job < 8)
    fetch(truck);
  else
    load_lorry(truck);
}

void work_until(ProfileBuilder& truck, int time_s) {
  constexpr int longest_job_s = 500;
  while (time_s - truck.time_s() > longest_job_s) {
    do_job(truck, truck.between(0, 9));
    stand(truck,
          truck.between(0, 14) == 0 ? truck.between(90, 240) : truck.between(3, 22));  // sometimes there is paperwork
  }
  travel(truck, 15, 0);
  truck.hold(time_s - truck.time_s(), 0);  // parked, key off
}

/// Tapers at the end, where a charger would hold the voltage: a profile depends on time alone.
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

}  // namespace

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

}  // namespace bms::experiments
