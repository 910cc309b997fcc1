#include "benchmark/truth/profiles.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace bms::benchmark::truth {

std::string name_of(Profile profile) {
  switch (profile) {
    case Profile::forklift_shift:
      return "forklift_shift";
    case Profile::drive_discharge:
      return "drive_discharge";
    case Profile::drive_two_way:
      return "drive_two_way";
    case Profile::hppc:
      return "hppc";
    case Profile::full_cycle:
      return "full_cycle";
    case Profile::minor_loops:
      return "minor_loops";
    case Profile::multi_rate:
      return "multi_rate";
    case Profile::many_cycles:
      return "many_cycles";
    case Profile::storage:
      return "storage";
  }
  return "";
}

double draw_start_soc(Profile profile, plant::Random& random) {
  switch (profile) {
    case Profile::forklift_shift:
    case Profile::drive_discharge:
    case Profile::hppc:
    case Profile::full_cycle:
      return between(random, 0.92, 0.965);
    case Profile::storage:
      return between(random, 0.88, 0.96);
    case Profile::drive_two_way:
    case Profile::minor_loops:
    case Profile::multi_rate:
      return between(random, 0.35, 0.95);
    case Profile::many_cycles:
      return between(random, 0.6, 0.95);
  }
  return 0.5;
}

namespace {

constexpr double minute_s = 60;

/// Appends stretches of constant current until the duration is reached.
class Plan {
 public:
  Plan(const ProfileRequest& request) : request_(request), soc_(request.start_soc) {
    wanted_ = static_cast<std::size_t>(request.duration_s / request.step_s);
    current_a_.reserve(wanted_);
    current_a_.push_back(0);
  }

  bool done() const { return current_a_.size() >= wanted_; }
  double soc() const { return soc_; }
  double lowest() const { return request_.lowest_soc; }
  double highest() const { return request_.highest_soc; }
  double fastest_charge() const { return request_.fastest_charge; }
  double fastest_discharge() const { return request_.fastest_discharge; }

  /// Returns false if the end of the SOC range or of the duration cut it short. The current is limited near the ends of
  /// the range.
  bool hold(double c_rate, double duration_s) {
    const auto samples = static_cast<std::size_t>(std::max(1.0, std::round(duration_s / request_.step_s)));
    for (std::size_t k = 0; k < samples && !done(); ++k) {
      double rate = std::clamp(c_rate, -request_.fastest_discharge, request_.fastest_charge);
      if (rate > 0 && soc_ > 0.9) rate = std::min(rate, 0.5);
      if (rate < 0 && soc_ < 0.1) rate = std::max(rate, -1.0);
      const double next = soc_ + rate * request_.step_s / 3'600;
      if ((rate > 0 && next > highest()) || (rate < 0 && next < lowest())) return false;
      soc_ = next;
      current_a_.push_back(rate * request_.capacity_ah);
    }
    return !done();
  }
  void rest(double duration_s) { hold(0, duration_s); }
  /// Charges or discharges to `soc` at c_rate > 0.
  bool go_to(double soc, double c_rate) {
    return hold(soc > soc_ ? c_rate : -c_rate, std::abs(soc - soc_) / c_rate * 3'600);
  }

  std::vector<double> current_a() && { return std::move(current_a_); }

 private:
  const ProfileRequest& request_;
  std::size_t wanted_ = 0;
  std::vector<double> current_a_;
  double soc_;
};

void forklift_shift(Plan& plan, double current_scale, plant::Random& random) {
  plan.rest(between(random, 2, 8) * minute_s);
  const double pace = between(random, 0.7, 1.4);
  while (!plan.done()) {
    if (plan.soc() < plan.lowest() + 0.06 || chance(random, 0.004)) {  // charge at a break or when empty
      plan.rest(between(random, 2, 15) * minute_s);
      plan.hold(between(random, 0.4, 1), between(random, 25, 60) * minute_s);
      plan.rest(between(random, 2, 10) * minute_s);
      continue;
    }
    const double drive = -between(random, 0.15, 0.7) * current_scale * pace;
    for (int n = 0, last = 3 + static_cast<int>(below(random, 8)); n < last; ++n)
      plan.hold(drive * between(random, 0.5, 1.5), between(random, 2, 6));
    plan.hold(between(random, 0.1, 0.7), between(random, 2, 6));  // brakes
    if (chance(random, 0.7)) {
      plan.hold(-between(random, 1, 2.2) * current_scale, between(random, 4, 12));  // lifts
      plan.hold(between(random, 0, 0.5), between(random, 3, 8));                    // lowers
    }
    plan.hold(-between(random, 0.005, 0.03),
              chance(random, 0.04) ? between(random, 8, 25) * minute_s : between(random, 5, 60) / pace);
  }
}

void drive_discharge(Plan& plan, double current_scale, double duration_s, plant::Random& random) {
  plan.rest(between(random, 5, 20) * minute_s);
  const double mean_rate = (plan.soc() - plan.lowest()) / (0.85 * duration_s / 3'600);
  while (!plan.done()) {
    if (plan.soc() < plan.lowest() + 0.01) return plan.rest(1e6);
    if (chance(random, 0.15))
      plan.rest(between(random, 5, 60));
    else if (chance(random, 0.006))
      plan.rest(between(random, 5, 20) * minute_s);
    const double rate = -std::min(mean_rate * 1.25 * -std::log(1 - 0.98 * random.uniform()), 3.0) * current_scale;
    plan.hold(rate, between(random, 2, 30) / current_scale);
  }
}

void drive_two_way(Plan& plan, double current_scale, plant::Random& random) {
  plan.rest(between(random, 5, 15) * minute_s);
  const double spread = between(random, 0.5, 1.1) * current_scale;
  double aim = between(random, plan.lowest(), plan.highest());
  while (!plan.done()) {
    if (std::abs(plan.soc() - aim) < 0.03) {
      if (chance(random, 0.5)) plan.rest(between(random, 5, 25) * minute_s);
      aim = between(random, plan.lowest(), plan.highest());
    }
    const double towards = std::copysign(0.35, aim - plan.soc());
    const double rate = std::clamp(towards + spread * random.normal(), -4.5, plan.fastest_charge());
    if (!plan.hold(chance(random, 0.12) ? 0 : rate, between(random, 2, 25))) aim = 0.5;
  }
}

void hppc(Plan& plan, double current_scale, plant::Random& random) {
  plan.rest(between(random, 5, 20) * minute_s);
  const double pulse = between(random, 0.8, 1.5) * current_scale,
               width_s = one_of(random, std::array{10.0, 18.0, 30.0, 60.0});
  const double stride = one_of(random, std::array{0.05, 0.08, 0.1}), rate = one_of(random, std::array{0.33, 0.5, 1.0});
  const double rest_s = one_of(random, std::array{8.0, 12.0, 20.0, 30.0}) * minute_s;
  double direction = plan.soc() > 0.5 ? -1 : 1;
  while (!plan.done()) {
    plan.hold(-pulse, width_s);
    plan.rest(std::max(40.0, width_s));
    plan.hold(0.75 * pulse, width_s);
    plan.rest(std::max(40.0, width_s));
    const double next = plan.soc() + direction * stride;
    const bool more = plan.go_to(next, rate);
    plan.rest(rest_s);
    if (!more) direction = -direction;
  }
}

void full_cycle(Plan& plan, plant::Random& random) {
  plan.rest(10 * minute_s);
  const double rate = one_of(random, std::array{1 / 3.0, 0.4, 0.5}), rest_s = between(random, 40, 70) * minute_s;
  plan.go_to(-1, rate);
  plan.rest(rest_s);
  plan.go_to(2, rate);
  plan.rest(rest_s);
  plan.go_to(between(random, 0.3, 0.7), rate);
  plan.rest(20 * minute_s);
}

/// Away from the ends of the range; elsewhere it usually turns.
double next_direction(const Plan& plan, double direction, plant::Random& random) {
  constexpr double near = 0.03;
  if (plan.soc() < plan.lowest() + near) return 1;
  if (plan.soc() > plan.highest() - near) return -1;
  return chance(random, 0.75) ? -direction : direction;
}

void minor_loops(Plan& plan, plant::Random& random) {
  constexpr std::array rates = {0.2, 0.33, 0.5, 1.0, 1.5};
  plan.rest(between(random, 10, 20) * minute_s);
  double direction = plan.soc() > 0.6 ? -1 : 1;
  while (!plan.done()) {
    const double far = chance(random, 0.4) ? between(random, 0.15, 0.45) : between(random, 0.02, 0.12);
    const double rate = std::max(one_of(random, rates), far > 0.15 ? 0.5 : 0.2);
    plan.go_to(plan.soc() + direction * far, rate);  // or to the end of the range
    if (chance(random, 0.5)) plan.rest(between(random, 8, 35) * minute_s);
    direction = next_direction(plan, direction, random);
  }
}

void multi_rate(Plan& plan, double current_scale, plant::Random& random) {
  const std::array rates = {0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 2.0 * current_scale, 3.0 * current_scale};
  plan.rest(between(random, 5, 15) * minute_s);
  double direction = plan.soc() > 0.5 ? -1 : 1;
  while (!plan.done()) {
    for (int n = 0; n < 4 && !plan.done(); ++n) {
      const double rate = std::min(one_of(random, rates), plan.fastest_discharge()),
                   width_s = std::min(between(random, 8, 90), 150 / rate);
      plan.hold(-rate, width_s);
      plan.rest(between(random, 10, 90));
      const double back = std::min(rate, plan.fastest_charge());
      plan.hold(back, width_s * rate / back);
      plan.rest(between(random, 20, 150));
    }
    if (!plan.go_to(plan.soc() + direction * between(random, 0.04, 0.15), between(random, 0.3, 1.2)))
      direction = -direction;
    plan.rest(between(random, 2, 12) * minute_s);
  }
}

void many_cycles(Plan& plan, plant::Random& random) {
  plan.rest(10 * minute_s);
  const double charge = between(random, 0.8, 1.8), discharge = between(random, 0.8, 1.8);
  while (!plan.done()) {
    const bool whole = chance(random, 0.35);
    plan.go_to(whole ? -1 : between(random, plan.lowest(), 0.3), discharge);
    plan.rest(between(random, 1, 6) * minute_s);
    plan.go_to(whole ? 2 : between(random, 0.7, plan.highest()), charge);
    plan.rest(between(random, 1, 10) * minute_s);
  }
}

void storage(Plan& plan, double duration_s, plant::Random& random) {
  const double rate = between(random, 0.4, 0.8);
  plan.rest(between(random, 0.12, 0.25) * duration_s);
  plan.go_to(-1, rate);
  plan.rest(between(random, 0.1, 0.2) * duration_s);
  plan.go_to(2, rate);
  plan.rest(between(random, 0.15, 0.3) * duration_s);
  plan.go_to(-1, rate);
  plan.rest(20 * minute_s);
}

}  // namespace

std::vector<double> draw_current_a(const ProfileRequest& request, plant::Random& random) {
  Plan plan(request);
  switch (request.profile) {
    case Profile::forklift_shift:
      forklift_shift(plan, request.current_scale, random);
      break;
    case Profile::drive_discharge:
      drive_discharge(plan, request.current_scale, request.duration_s, random);
      break;
    case Profile::drive_two_way:
      drive_two_way(plan, request.current_scale, random);
      break;
    case Profile::hppc:
      hppc(plan, request.current_scale, random);
      break;
    case Profile::full_cycle:
      full_cycle(plan, random);
      break;
    case Profile::minor_loops:
      minor_loops(plan, random);
      break;
    case Profile::multi_rate:
      multi_rate(plan, request.current_scale, random);
      break;
    case Profile::many_cycles:
      many_cycles(plan, random);
      break;
    case Profile::storage:
      storage(plan, request.duration_s, random);
      break;
  }
  return std::move(plan).current_a();
}

std::vector<double> draw_ambient_c(Ambient ambient, double start_c, double swing_k, std::size_t count,
                                   plant::Random& random) {
  std::vector<double> temperature_c(count, start_c);
  if (ambient == Ambient::constant) return temperature_c;
  const double leaves = between(random, 0.1, 0.3), returns = leaves + between(random, 0.25, 0.45),
               ramp = between(random, 0.01, 0.08);
  const double turns = between(random, 1, 2.2);
  const SmoothRandom small(random);
  for (std::size_t k = 0; k < count; ++k) {
    const double x = static_cast<double>(k) / static_cast<double>(count);
    const double way = ambient == Ambient::wave
                           ? 0.5 - 0.5 * std::cos(2 * std::numbers::pi * turns * x)
                           : std::clamp((x - leaves) / ramp, 0.0, 1.0) - std::clamp((x - returns) / ramp, 0.0, 1.0);
    temperature_c[k] += swing_k * way + 0.3 * (small.at(x) - small.at(0));
  }
  return temperature_c;
}

}  // namespace bms::benchmark::truth
