#include "workflow/cell_size.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "measurement/statistics.hpp"

namespace bms::workflow {

namespace {

/// Usual limits of a chemistry, from data sheets of cells of it.
struct Chemistry {
  const char* name;
  double voltage_min_v, voltage_max_v, temperature_min_c, temperature_max_c;
};
constexpr Chemistry chemistries[] = {
    {"LFP", 2.5, 3.65, -20, 60}, {"NMC", 2.5, 4.2, -20, 60}, {"NCA", 2.5, 4.2, -20, 60}, {"LTO", 1.5, 2.8, -30, 55}};

/// Mean current of ten seconds with the largest magnitude in one direction; 0 if it never flows so.
double sustained_a(const measurement::Recording& r, double sign) {
  constexpr double window_s = 10;
  double largest = 0, charge_as = 0;
  std::size_t from = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const auto of = [&](std::size_t row) {
      const double a = sign * r.current_a[row];
      return a > 0 ? a * (r.time_s[row] - r.time_s[row - 1]) : 0;
    };
    charge_as += of(k);
    while (from + 1 < k && r.time_s[k] - r.time_s[from + 1] >= window_s) charge_as -= of(++from);
    const double seconds = r.time_s[k] - r.time_s[from];
    if (seconds >= window_s) largest = std::max(largest, charge_as / seconds);
  }
  return largest;
}

template <class Column>
void multiply(Column& column, double by, const model::accepted::Range& range, const char* name,
              std::vector<std::string>& clamped) {
  for (std::size_t k = 0; k < column.size; ++k) {
    const double value = column[k] * by;
    column[k] = std::clamp(value, range.low, range.high);
    if (column[k] != value && (clamped.empty() || clamped.back() != name)) clamped.emplace_back(name);
  }
}

}  // namespace

bool StatedLimits::any() const {
  return voltage_min_v || voltage_max_v || charge_current_max_a || discharge_current_max_a || temperature_min_c ||
         temperature_max_c;
}

std::vector<std::string> scale_to(double capacity_ah, files::CellFile& cell) {
  model::CellParameters<>& p = cell.parameters;
  const double times = capacity_ah / p.capacity_ah;
  std::vector<std::string> clamped;
  const auto scale_table = [&](model::RcTable<double>& rc) {
    constexpr model::accepted::Range deviation{0, 1e9};
    multiply(rc.r0_ohm, 1 / times, model::accepted::resistance_ohm, "rc.r0_ohm", clamped);
    multiply(rc.r1_ohm, 1 / times, model::accepted::resistance_ohm, "rc.r1_ohm", clamped);
    multiply(rc.c1_f, times, model::accepted::capacitance_f, "rc.c1_f", clamped);
    multiply(rc.r0_std_ohm, 1 / times, deviation, "", clamped);
    multiply(rc.r1_std_ohm, 1 / times, deviation, "", clamped);
    multiply(rc.c1_std_f, times, deviation, "", clamped);
  };
  scale_table(p.rc);
  for (files::TemperatureTable& at : cell.at_temperature) scale_table(at.rc);
  for (double* a : {&p.limits.charge_current_max_a, &p.limits.discharge_current_max_a}) {
    *a = std::clamp(*a * times, model::accepted::current_a.low, model::accepted::current_a.high);
  }
  for (double* a : {&cell.pulses.charge.for_10s_a, &cell.pulses.charge.for_30s_a, &cell.pulses.discharge.for_10s_a,
                    &cell.pulses.discharge.for_30s_a}) {
    if (*a != 0) *a = std::clamp(*a * times, model::accepted::current_a.low, model::accepted::current_a.high);
  }
  for (double* a :
       {&p.noise.current_a, &p.noise.current_offset_a, &p.noise.current_unknown_a, &p.noise.current_at_rest_a}) {
    *a *= times;
  }
  for (model::MechanismSetting& m : cell.mechanisms) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    for (std::size_t k = 0; k < info.parameters; ++k) {
      const double by = info.parameter[k].scale(capacity_ah) / info.parameter[k].scale(p.capacity_ah);
      m.value[k] *= by;
      m.deviation[k] *= by;
    }
  }
  p.capacity_ah = capacity_ah;
  return clamped;
}

std::string chemistry_of(const std::vector<measurement::Recording>& recordings) {
  double highest_v = 0;
  std::vector<double> usual_v;
  for (const measurement::Recording& r : recordings) {
    for (const double v : r.voltage_v) highest_v = v > highest_v ? v : highest_v;
    usual_v.push_back(measurement::upper_median(r.voltage_v.copy()));
  }
  const double usual = measurement::upper_median(usual_v);
  if (highest_v < 3 && usual < 2.7) return "LTO";
  return usual < 3.45 && highest_v < 3.9 ? "LFP" : "NMC";
}

std::string derive_limits(const StatedLimits& stated, const std::string& chemistry,
                          const std::vector<measurement::Recording>& recordings, files::CellFile& cell) {
  const auto* const usual = std::find_if(std::begin(chemistries), std::end(chemistries),
                                         [&](const Chemistry& c) { return c.name == chemistry; });
  const Chemistry& of = usual == std::end(chemistries) ? chemistries[1] : *usual;
  model::Limits& limits = cell.parameters.limits;
  double low_v = of.voltage_min_v, high_v = of.voltage_max_v;
  double charge_a = cell.parameters.capacity_ah, discharge_a = charge_a;
  for (const measurement::Recording& r : recordings) {
    for (const double v : r.voltage_v) {
      if (v > 0.5 && v < low_v) low_v = v;
      if (v < 5 && v > high_v) high_v = v;
    }
    charge_a = std::max(charge_a, sustained_a(r, 1));
    discharge_a = std::max(discharge_a, sustained_a(r, -1));
  }
  const auto two_digits = [](double v, double direction) {
    return direction > 0 ? std::ceil(100 * v - 1e-9) / 100 : std::floor(100 * v + 1e-9) / 100;
  };
  limits.voltage_min_v = stated.voltage_min_v.value_or(two_digits(low_v, -1));
  limits.voltage_max_v = stated.voltage_max_v.value_or(two_digits(high_v, 1));
  limits.charge_current_max_a = stated.charge_current_max_a.value_or(two_digits(charge_a, 1));
  limits.discharge_current_max_a = stated.discharge_current_max_a.value_or(two_digits(discharge_a, 1));
  limits.temperature_min_c = stated.temperature_min_c.value_or(of.temperature_min_c);
  limits.temperature_max_c = stated.temperature_max_c.value_or(of.temperature_max_c);
  const bool complete = stated.voltage_min_v && stated.voltage_max_v && stated.charge_current_max_a &&
                        stated.discharge_current_max_a && stated.temperature_min_c && stated.temperature_max_c;
  if (complete) return "stated by the user";
  return fmt::format(
      "{}voltages and temperatures: usual for {} and not narrower than the recordings; currents: 1C or the "
      "largest that the recordings sustain; the data sheet decides",
      stated.any() ? "partly stated by the user; the others are derived, " : "derived, ", of.name);
}

}  // namespace bms::workflow
