#include "proof/faults_put_in.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "experiments/splitmix.hpp"
#include "model/catalogue.hpp"

namespace bms::proof {

using measurement::Recording;

void put_voltage_offset(Recording& r, double offset_v) {
  for (double& v : r.voltage_v.edit()) v += offset_v;
}

void put_current_offset(Recording& r, double offset_a) {
  for (double& a : r.current_a.edit()) a += offset_a;
}

void put_current_gain(Recording& r, double error) {
  for (double& a : r.current_a.edit()) a *= 1 + error;
}

void put_clipping(Recording& r, double limit_a) {
  for (double& a : r.current_a.edit()) a = std::clamp(a, -limit_a, limit_a);
}

void put_contact(Recording& r, double ohm, std::size_t first_row) {
  std::vector<double>& v = r.voltage_v.edit();
  for (std::size_t k = first_row; k < r.rows(); ++k) v[k] += ohm * r.current_a[k];
}

void put_contact_in_bursts(Recording& r, double ohm) {
  constexpr double pause_min_s = 60, pause_max_s = 400, burst_min_s = 5, burst_max_s = 30;
  constexpr std::uint64_t seed = 20;
  experiments::SplitMix random(seed);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random.bits() >> 11) * 0x1p-53;
  };
  double begin_s = r.time_s.front() + between(pause_min_s, pause_max_s),
         end_s = begin_s + between(burst_min_s, burst_max_s);
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (r.time_s[k] > end_s) {
      begin_s = end_s + between(pause_min_s, pause_max_s);
      end_s = begin_s + between(burst_min_s, burst_max_s);
    }
    if (r.time_s[k] >= begin_s && r.time_s[k] <= end_s) r.voltage_v.edit()[k] += ohm * r.current_a[k];
  }
}

namespace {

// A size that holds for cells of any capacity, and the first parameter that follows from it.
double as_it_is(double size, double) { return size; }
double per_ah(double size, double capacity_ah) { return size * capacity_ah; }
double times_ah(double size, double capacity_ah) { return size / capacity_ah; }

template <void (*put)(Recording&, double)>
void unscaled(Recording& r, double size, double) {
  put(r, size);
}

void voltage_gain(Recording& r, double size, double) {
  for (double& v : r.voltage_v.edit()) v *= 1 + size;
}

void current_offset(Recording& r, double size, double capacity_ah) { put_current_offset(r, size * capacity_ah); }

void clipping(Recording& r, double share, double) {
  double largest_a = 0;
  for (const double a : r.current_a) largest_a = std::max(largest_a, std::abs(a));
  put_clipping(r, share * largest_a);
}

/// The current is read some time behind the voltage: between two rows it is that of the row before for this time.
void late_current(Recording& r, double delay_s, double) {
  const std::vector<double> true_a = r.current_a.copy();
  std::vector<double>& read_a = r.current_a.edit();
  std::size_t from = 0;
  for (std::size_t k = 1; k < true_a.size(); ++k) {
    const double at_s = r.time_s[k] - delay_s;
    while (from + 1 < k && r.time_s[from + 1] < at_s) ++from;
    // the current of row n flows from row n - 1 to row n
    read_a[k] = at_s <= r.time_s[0] ? true_a[0] : true_a[std::min(from + 1, k)];
  }
}

/// A contact that changes in the middle.
void contact(Recording& r, double size, double capacity_ah) { put_contact(r, size / capacity_ah, r.rows() / 2); }

/// Open for 12 of every 400 rows, at moments that do not follow the load.
void loose_contact(Recording& r, double size, double capacity_ah) {
  constexpr std::size_t period = 400, open = 12, first = 170;
  std::vector<double>& v = r.voltage_v.edit();
  for (std::size_t k = 0; k < r.rows(); ++k) {
    const std::size_t jitter = (k / period * 37) % 200;
    const std::size_t at = k % period;
    if (at >= first + jitter && at < first + jitter + open) v[k] += size / capacity_ah * r.current_a[k];
  }
}

}  // namespace

const std::array<InjectedFault, 8> injected_faults = {{
    {"voltage_offset", {0.008, 0.015, 0.03}, unscaled<put_voltage_offset>, as_it_is},
    {"voltage_gain", {0.003, 0.006, 0.012}, voltage_gain, as_it_is},
    {"current_offset", {0.01, 0.02, 0.04}, current_offset, per_ah},
    {"current_gain", {0.02, 0.04, 0.08}, unscaled<put_current_gain>, as_it_is},
    {"current_clipping", {0.8, 0.6, 0.4}, clipping, nullptr},
    {"channel_skew", {1, 2, 4}, late_current, as_it_is},
    {"contact_step", {0.0025, 0.005, 0.01}, contact, times_ah},
    {"contact_intermittent", {0.01, 0.02, 0.04}, loose_contact, times_ah},
}};

bool is_within_bounds(const InjectedFault& fault, double size, double capacity_ah) {
  if (fault.first_parameter == nullptr) return true;
  const model::Parameter& p = model::catalogue[model::mechanism_index(fault.id)].parameter[0];
  const double value = fault.first_parameter(size, capacity_ah);
  return value >= p.lower(capacity_ah) && value <= p.upper(capacity_ah);
}

}  // namespace bms::proof
