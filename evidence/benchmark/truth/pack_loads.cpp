#include "benchmark/truth/pack_loads.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace bms::benchmark::truth {

namespace {

constexpr double one_minute_s = 60, one_hour_s = 3'600, one_day_s = 86'400;

using Rate = std::function<double(double time_s)>;  ///< C-rate of the load; rising times

/// Something that is on and off for exponentially distributed times.
struct Switched {
  double rate, on_s, off_s;
  double until_s = 0;
  bool on = false;

  double at(double time_s, plant::Random& random) {
    while (time_s >= until_s) {
      on = !on;
      until_s += -(on ? on_s : off_s) * std::log(1 - random.uniform());
    }
    return on ? rate : 0;
  }
};

Rate appliances(plant::Random& random) {
  std::vector<Switched> all;
  for (int n = 0; n < 6; ++n) {
    const double on_s = log_between(random, 3, 1'800);
    all.push_back({-log_between(random, 0.02, 0.6), on_s, on_s * log_between(random, 1, 12)});
  }
  const double base = -between(random, 0.005, 0.03), sun = between(random, 0.15, 0.5);
  const double dawn_s = between(random, 0, one_day_s / 2);
  const auto clouds = ornstein_uhlenbeck(random.bits(), 200'000, 5, between(random, 20, 300));
  return [=, &random](double time_s) mutable {
    double rate = base;
    for (Switched& s : all) rate += s.at(time_s, random);
    const double height = std::sin(2 * std::numbers::pi * (time_s - dawn_s) / one_day_s);
    const auto place = static_cast<std::size_t>(time_s / 5) % clouds.size();
    if (height > 0) rate += sun * height * std::clamp(0.7 + 0.5 * clouds[place], 0.05, 1.1);
    return rate;
  };
}

Rate road(plant::Random& random) {
  const double correlation_s = log_between(random, 2, 15), strong = between(random, 0.3, 0.9);
  const auto pedal = ornstein_uhlenbeck(random.bits(), 1'000'000, 0.5, correlation_s);
  Switched stops{1, between(random, 8, 60), between(random, 20, 240)};
  const double mean = between(random, 0.1, 0.35);
  return [=, &random](double time_s) mutable {
    if (stops.at(time_s, random) > 0) return -0.01;
    return -mean - strong * pedal[static_cast<std::size_t>(time_s / 0.5) % pedal.size()];
  };
}

Rate shift(plant::Random& random) {
  double until_s = 0, rate = 0, busy_until_s = 0;
  const double drive = between(random, 0.2, 0.6), lift = between(random, 0.8, 1.8);
  return [=, &random](double time_s) mutable {
    if (time_s >= busy_until_s + 5 * one_minute_s) busy_until_s = time_s + between(random, 5, 60) * one_minute_s;
    if (time_s >= busy_until_s) return -0.01;
    if (time_s < until_s) return rate;
    until_s = time_s + between(random, 1, 9);
    const double what = random.uniform();
    if (what < 0.5)
      rate = -drive * between(random, 0.4, 1.6);
    else if (what < 0.65)
      rate = drive * between(random, 0.3, 1);
    else
      rate = what < 0.8 ? -lift * between(random, 0.7, 1.2) : -0.01;
    return rate;
  };
}

Rate pump(plant::Random& random) {
  const double period_s = log_between(random, 4, 400), share = between(random, 0.2, 0.8);
  const double rate = -between(random, 0.3, 1.2), base = -between(random, 0, 0.1);
  const double wobble = between(random, 0, 0.03);
  double since_s = 0, length_s = period_s;
  return [=, &random](double time_s) mutable {
    if (time_s - since_s >= length_s) {
      since_s += length_s;
      length_s = period_s * (1 + wobble * random.normal());
    }
    return base + (time_s - since_s < share * length_s ? rate : 0);
  };
}

Rate rate_of(PackLoad load, plant::Random& random) {
  switch (load) {
    case PackLoad::shift:
      return shift(random);
    case PackLoad::road:
      return road(random);
    case PackLoad::appliances:
      return appliances(random);
    case PackLoad::pump:
      break;
  }
  return pump(random);
}

}  // namespace

std::string_view name_of(PackLoad load) {
  constexpr std::array<std::string_view, 4> names = {"shift", "road", "appliances", "pump"};
  return names[static_cast<std::size_t>(load)];
}

std::vector<double> draw_load_a(const LoadRequest& r, plant::Random& random) {
  const Rate rate_at = rate_of(r.load, random);
  std::vector<double> current_a;
  double soc = r.start_soc, rest_until_s = between(random, 2, 10) * one_minute_s, charge_c = 0;
  bool charging = false;
  for (double time_s = 0; time_s < r.duration_s; time_s += r.step_s) {
    double rate = rate_at(time_s);  // always, so that its times go on
    if (!charging && soc < r.lowest_soc) {
      charging = true;
      charge_c = std::min(r.fastest_charge, between(random, 0.3, 0.8));
      rest_until_s = time_s + between(random, 5, 20) * one_minute_s;
    }
    if (charging && soc > r.highest_soc - 0.01) {
      charging = false;
      rest_until_s = time_s + between(random, 5, 30) * one_minute_s;
    }
    if (charging) rate = charge_c;
    if (time_s < rest_until_s) rate = 0;
    rate = std::clamp(rate, -r.fastest_discharge, r.fastest_charge);
    if (rate > 0 && soc > r.highest_soc) rate = 0;
    soc += rate * r.step_s / one_hour_s;
    current_a.push_back(rate * r.capacity_ah);
  }
  return current_a;
}

}  // namespace bms::benchmark::truth
