#include "hil/simulated_pack.hpp"

#include <algorithm>
#include <cmath>

namespace bms::hil {

namespace {

constexpr double precharge_time_constant_s = 0.5, dc_link_discharge_time_constant_s = 5;
constexpr double pack_noise_per_cell_noise = 4;  // of the pack voltage: sqrt(16)

}  // namespace

double dc_link_voltage_after(double dc_link_v, double pack_v, const ContactorCommand& closed, bool welded,
                             double duration_s) {
  if (closed.conducts(welded)) return pack_v;
  if (closed.precharge && closed.main_minus)
    return dc_link_v + (pack_v - dc_link_v) * (1 - std::exp(-duration_s / precharge_time_constant_s));
  return dc_link_v * std::exp(-duration_s / dc_link_discharge_time_constant_s);
}

SimulatedPack::SimulatedPack(const files::CellFile& cell, std::size_t cells, double initial_soc,
                             const PackSpread& spread)
    : tables_(model::prepare<double, model::max_intervals>(cell.parameters)),
      voltage_v_(cells),
      random_(spread.seed),
      spread_(spread),
      capacity_ah_(cell.parameters.capacity_ah) {
  std::normal_distribution<double> normal;
  simulations_.reserve(cells);
  for (std::size_t k = 0; k < cells; ++k) {
    const double soc_offset = cells > 1 ? spread.soc * normal(random_) : 0,
                 capacity_offset = cells > 1 ? spread.capacity * normal(random_) : 0;
    const double own_ah = capacity_ah_ * (1 + capacity_offset);
    simulations_.emplace_back(tables_, own_ah, model::chosen<double>(cell.mechanisms, own_ah),
                              std::clamp(initial_soc + soc_offset, 0.0, 1.0));
    voltage_v_[k] = simulations_[k].step(0, 0, 0, model::assumed_ambient_c, [](auto&, const auto&) {});
  }
}

double SimulatedPack::soc() const {
  double sum = 0;
  for (const auto& c : simulations_) sum += c.soc();
  return sum / static_cast<double>(simulations_.size());
}

double SimulatedPack::pack_v() const {
  double sum = 0;
  for (const double v : voltage_v_) sum += v;
  return sum;
}

void SimulatedPack::run(double demand_a, const ContactorCommand& closed, bool welded, double temperature_c,
                        double duration_s) {
  current_a_ = closed.conducts(welded) ? demand_a : 0;
  time_s_ += duration_s;
  for (std::size_t k = 0; k < simulations_.size(); ++k)
    voltage_v_[k] = simulations_[k].step(time_s_, duration_s, current_a_, temperature_c, [](auto&, const auto&) {});
  dc_link_v_ = dc_link_voltage_after(dc_link_v_, pack_v(), closed, welded, duration_s);
}

measurement::PackSample<max_cells> SimulatedPack::read(std::uint64_t time_us, double temperature_c) {
  std::normal_distribution<double> normal;
  const auto micro = [](double v) { return static_cast<std::int32_t>(std::lround(1e6 * v)); };
  measurement::PackSample<max_cells> s;
  s.time_us = time_us;
  s.current_ua = micro(current_a_ + spread_.current_noise_a * normal(random_));
  for (std::size_t k = 0; k < simulations_.size(); ++k)
    s.cell_uv[k] = micro(voltage_v_[k] + spread_.voltage_noise_v * normal(random_));
  const double pack_noise_v = pack_noise_per_cell_noise * spread_.voltage_noise_v;
  s.pack_uv = simulations_.size() == 1 ? s.cell_uv[0] : micro(pack_v() + pack_noise_v * normal(random_));
  for (auto& t : s.temperature_cdegc)
    t = static_cast<std::int16_t>(std::lround(100 * (temperature_c + spread_.temperature_noise_c * normal(random_))));
  return s;
}

}  // namespace bms::hil
