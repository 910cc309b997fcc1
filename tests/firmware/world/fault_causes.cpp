#include "tests/firmware/world/fault_causes.hpp"

#include <algorithm>
#include <cmath>

namespace bms::world {

namespace {

constexpr std::uint64_t fault(unsigned bit) { return std::uint64_t{1} << bit; }
constexpr std::uint64_t limits = fault(38) | fault(39) | fault(40);  ///< the reading is far above them
constexpr std::uint64_t limits_of_cells = fault(0) | fault(1) | fault(2) | fault(3) | fault(4) | fault(5) | fault(16) |
                                          fault(17) | fault(20) | fault(21) | fault(25);
constexpr std::uint64_t second_line = fault(32) | fault(28);  ///< its trip opens main plus

}  // namespace

SetQuantity actuator_of(const Row& row) {
  const std::string& q = row.quantity;
  if (q == "highest cell") return [](TruckWorld& w, double v) { w.hold_cell(7, v); };
  if (q == "lowest cell") return [](TruckWorld& w, double v) { w.hold_cell(4, v); };
  if (q == "pack") {
    return [](TruckWorld& w, double v) {
      const std::size_t cells = w.truck.cell_count();
      for (std::size_t k = 0; k < cells; ++k) w.hold_cell(k, v / static_cast<double>(cells));
    };
  }
  if (q == "warmest sensor") return [](TruckWorld& w, double c) { w.set_temperature(2, c); };
  if (q == "coldest sensor") return [](TruckWorld& w, double c) { w.set_temperature(1, c); };
  if (q == "die of the measuring chip") return [](TruckWorld& w, double c) { w.die_c = c; };
  if (q == "sum of cells minus pack") return [](TruckWorld& w, double v) { w.sensors.stack_error_v = -v; };
  if (q == "highest minus lowest cell") {
    return [](TruckWorld& w, double v) {
      double highest_v = 0;
      for (std::size_t k = 0; k < w.truck.cell_count(); ++k)
        highest_v = k == 3 ? highest_v : std::max(highest_v, w.truck.cell_v(k));
      w.hold_cell(3, highest_v - v);
    };
  }
  if (q == "opposite shift of neighbours") {
    return [](TruckWorld& w, double v) {
      w.sensors.cell_error_v[9] = -v;
      w.sensors.cell_error_v[10] = v;
    };
  }
  return {};
}

namespace {

/// Of each of two chips, of the isolator between them, and of both at once.
void add_half_causes(std::vector<Cause>& list) {
  // voltage missing; with the lower chip the current, with each its temperatures
  const std::uint64_t half = fault(20) | fault(21) | fault(22) | fault(23) | second_line | fault(33);
  const auto add = [&](unsigned bit, const char* name, std::function<void(TruckWorld&)> happens,
                       double within_s = 0.7) {
    list.push_back({bit, name, std::move(happens), within_s, true, half});
  };
  add(20, "lower chip does not answer", [](TruckWorld& w) { w.chip.gone = true; });
  add(20, "lower chip holds its clock low", [](TruckWorld& w) { w.chip.hung = true; });
  add(20, "lower chip stops measuring", [](TruckWorld& w) { w.chip.frozen = true; });
  add(
      32, "lower chip resets", [](TruckWorld& w) { w.chip.reset(); }, 2);
  add(20, "strap of the lower chip broken", [](TruckWorld& w) { w.sensors.lower_strap_broken = true; });
  add(20, "isolator without supply", [](TruckWorld& w) { w.isolator_supplied = false; });
  add(20, "upper chip holds its clock low", [](TruckWorld& w) { w.upper_chip.hung = true; });
  add(20, "upper chip stops measuring", [](TruckWorld& w) { w.upper_chip.frozen = true; });
  add(
      32, "upper chip resets", [](TruckWorld& w) { w.upper_chip.reset(); }, 2);
  add(20, "strap of the upper chip broken", [](TruckWorld& w) { w.sensors.upper_strap_broken = true; });
  add(29, "both chips hold their clocks low", [](TruckWorld& w) { w.chip.hung = w.upper_chip.hung = true; });
  add(29, "both chips stop measuring", [](TruckWorld& w) { w.chip.frozen = w.upper_chip.frozen = true; });
  for (std::size_t k = 0; k + 1 < list.size(); ++k) list[k].also &= ~fault(list[k].bit);
  list.push_back({48, "die of the upper chip hot", [](TruckWorld& w) { w.upper_die_c = 97; }, 0.45});
  list.push_back({16, "wire between the halves open",
                  [](TruckWorld& w) {
                    w.sensors.cell_error_v[11] = -0.6;
                    w.sensors.cell_error_v[12] = 0.6;
                  },
                  0.45, false, limits_of_cells});
  list.push_back({19, "a cell register of the upper chip reads 0",
                  [](TruckWorld& w) { w.upper_chip.zero_cells = 1U << 6; }, 0.3, true, limits_of_cells | second_line});
}

void add_chip_causes(std::vector<Cause>& list) {
  list.push_back({29, "I2C: front end does not answer", [](TruckWorld& w) { w.chip.gone = true; }, 0.5, true,
                  fault(20) | fault(22) | fault(23) | second_line});
  list.push_back({29, "I2C: clock held low", [](TruckWorld& w) { w.chip.hung = true; }, 0.7, true,
                  fault(20) | fault(22) | fault(23) | second_line});
  list.push_back({29, "front end resets", [](TruckWorld& w) { w.chip.reset(); }, 0.7, true,
                  fault(20) | fault(22) | fault(23) | second_line | fault(33)});
  // The chip reports each complete scan in Alarm Status (TI in E2E 1401615; SLUUBY2B, 12.2, not at hand). Without a
  // report its registers may keep old values, so there is no sample.
  list.push_back({29, "front end stops measuring", [](TruckWorld& w) { w.chip.frozen = true; }, 0.7, true,
                  fault(20) | fault(22) | fault(23) | fault(21) | second_line});
}

void add_front_end_causes(std::vector<Cause>& list) {
  // 0 V is a valid code: the stack, measured by itself, contradicts it
  list.push_back(
      {19, "a cell register reads 0", [](TruckWorld& w) { w.chip.zero_cells = 1U << 6; }, 0.3, true,
       fault(3) | fault(4) | fault(5) | fault(16) | fault(17) | fault(20) | fault(21) | fault(25) | second_line});
  list.push_back({21, "a cell register is stuck", [](TruckWorld& w) { w.chip.stale_cells = 1U << 6; }, 3, false,
                  fault(16) | fault(19),
                  [](TruckWorld& w) {
                    static int seconds = 0;  // others that return each second would look like noise
                    const double v = 3.30 + 0.02 * std::min(seconds++, 4);
                    for (std::size_t k = 0; k < w.truck.cell_count(); ++k) w.hold_cell(k, v);
                  }});
  // the converter saturates at the end of its range, which is a large current
  list.push_back({10,
                  "current beyond the range of the sensor",
                  [](TruckWorld& w) { w.sensors.shunt_factor = 1e5; },
                  0.4,
                  true,
                  fault(8) | fault(9) | fault(34) | fault(37) | fault(27) | limits | second_line,
                  {},
                  true});
}

void add_temperature_causes(std::vector<Cause>& list) {
  for (std::size_t sensor = 0; sensor < 4; ++sensor) {
    for (const double ohm : {Bq76952Inputs::open_ohm, 0.0}) {
      list.push_back({23, "thermistor " + std::to_string(sensor + 1) + (ohm == 0 ? " shorted" : " broken"),
                      [=](TruckWorld& w) { w.set_thermistor_ohm(sensor, ohm); }, 0.7, false, ohm == 0 ? fault(42) : 0});
    }
    list.push_back({42, "thermistor " + std::to_string(sensor + 1) + " shorted for long",
                    [=](TruckWorld& w) { w.set_thermistor_ohm(sensor, 0); }, 0.7, false, fault(23)});
  }
  list.push_back({24, "thermistor 1 stuck",
                  [](TruckWorld& w) {
                    for (std::size_t k = 1; k < 4; ++k) w.set_temperature(k, 25);
                  },
                  8, false, 0,
                  [](TruckWorld& w) {
                    for (std::size_t k = 1; k < 4; ++k)
                      w.set_temperature(k, std::min(38.0, w.temperature_c(k) + 2.5 + 0.2 * static_cast<double>(k)));
                  }});
  list.push_back({35, "all thermistors broken",
                  [](TruckWorld& w) {
                    for (std::size_t k = 0; k < 4; ++k) w.set_thermistor_ohm(k, Bq76952Inputs::open_ohm);
                  },
                  0.4, false, fault(23)});
  list.back().no_temperature = true;
}

}  // namespace

std::vector<Cause> other_causes(std::size_t cells) {
  std::vector<Cause> list;
  if (cells > 16)
    add_half_causes(list);
  else
    add_chip_causes(list);
  add_front_end_causes(list);
  add_temperature_causes(list);
  list.push_back({34,
                  "Hall sensor reads 36 A too much",
                  [](TruckWorld& w) { w.sensors.hall_error_v = 0.06; },
                  0.4,
                  false,
                  0,
                  {},
                  true});
  list.push_back({43, "wire of the Hall sensor broken", [](TruckWorld& w) { w.sensors.hall_error_v = -3; }, 0.4, false,
                  fault(34)});
  list.push_back({44, "interlock loop parts", [](TruckWorld& w) { w.interlock = false; }, 0.4});
  list.push_back({45, "crash", [](TruckWorld& w) { w.crashed = true; }, 0.3});
  list.push_back({36,
                  "current flows after the request has ended",
                  [](TruckWorld& w) {
                    // a fan that stays on; the charger's own current ends with its contactor
                    if (w.closed(plant::Relay::charge)) set_drive_a(w, -5);
                    w.vehicle.request = Request::none;
                  },
                  0.4,
                  false,
                  0,
                  {},
                  true});
  // a record of the charge is due each minute, and is tried again
  list.push_back(
      {31, "flash wears out", [](TruckWorld& w) { w.board.flash.worn_out = true; }, 130, false, fault(30), {}, true});
  return list;
}

std::vector<Background> backgrounds() {
  return {{"a lost temperature", [](TruckWorld& w) { w.set_thermistor_ohm(0, Bq76952Inputs::open_ohm); }, fault(23)},
          {"a warm cell", [](TruckWorld& w) { w.set_temperature(3, 57); }, fault(11) | fault(13)},
          {"a cold cell", [](TruckWorld& w) { w.set_temperature(3, -3); }, fault(15)},
          // SR-30: a latched fault that neither flash nor a backup register keeps forbids closing
          {"worn-out flash", [](TruckWorld& w) { w.board.flash.worn_out = true; }, fault(30) | fault(31)}};
}

}  // namespace bms::world
