// The flashed image of the forklift board in a truck: the emulated core with its ports, ADC, I2C and CAN, the model of
// the front end, and the circuit of battery, contactors and truck (evidence/plant/circuit). Wired as
// boards/stm32f405_forklift/README.md says.
//
// Nothing here knows states, thresholds or sequences of the firmware: it sees levels of pins and frames on the bus. One
// step is at most 1 ms while something switches, and at most 5 ms otherwise. A step ends when the firmware writes to
// the contactor port. The circuit takes steps of its own within it.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "plant/circuit/truck.hpp"
#include "plant/random.hpp"
#include "tests/firmware/i2c_controller_model.hpp"
#include "tests/firmware/second_can.hpp"
#include "tests/firmware/unicorn_board.hpp"
#include "tests/firmware/world/adc_model.hpp"
#include "tests/firmware/world/gpio_model.hpp"
#include "tests/firmware/world/insulation_device.hpp"
#include "tests/firmware/world/vehicle.hpp"
#include "tests/hal/bq76952_model.hpp"

namespace bms::world {

struct WorldSetup {
  plant::TruckParameters truck = plant::typical_world();
  double detector_error_v = 0;                 ///< of the supply detector, within +-0.07 V (DS8626, table 23)
  double reset_v = 2.83, reset_ends_v = 2.92;  ///< brown-out reset, level 3 (DS8626, table 23)
  double adc_offset_lsb = 0;
  double cell_noise_v = 0, shunt_noise_v = 0;  ///< standard deviations of what the front end converts
  std::uint32_t seed = 1;
};

/// Errors of what the front end senses; the circuit does not know them.
struct SensorFaults {
  std::array<double, 32> cell_error_v{};
  double stack_error_v = 0;
  bool lower_strap_broken = false, upper_strap_broken = false;  ///< of two chips: PACK, which says the chip's place
  double shunt_factor = 1;                                      ///< 0: a wire of the shunt is off
  double hall_error_v = 0;                                      ///< at PA1
};

/// I2C of the board. A reset of the chip resets it. While the program polls a byte on the wire, the time is skipped.
class WorldI2c : public firmware::UnicornBoard::Peripheral {
 public:
  WorldI2c(firmware::UnicornBoard& board, Bq76952Model& chip)
      : board_(board), chip_(chip), model_(std::in_place, chip) {}
  std::uint32_t read(std::uint32_t offset, double now_us) override;
  void write(std::uint32_t offset, std::uint32_t value, double now_us) override;
  void chip_reset() override;
  std::vector<std::string> violations() const;
  /// Of the bytes that were sent and received, at 400 kHz: nine bits each.
  double wire_ms() const { return 22.5e-3 * static_cast<double>(bytes_); }

 private:
  static constexpr std::uint32_t data = 0x10;

  firmware::UnicornBoard& board_;
  Bq76952Model& chip_;
  std::uint64_t bytes_ = 0;
  std::optional<firmware::I2cControllerModel> model_;
  std::vector<std::string> earlier_;
  unsigned polls_ = 0;
};

class TruckWorld {
 public:
  static constexpr double never = std::numeric_limits<double>::infinity();

  TruckWorld(const std::filesystem::path& image, const WorldSetup& setup);
  TruckWorld(const TruckWorld&) = delete;
  TruckWorld& operator=(const TruckWorld&) = delete;

  void run_ms(double ms);
  /// Returns the milliseconds until the condition holds at the end of a step, or a negative value.
  double run_until(const std::function<bool()>& holds, double within_ms);
  double now_ms() const { return board.now_ms(); }
  double now_s() const { return 1e-3 * now_ms(); }

  /// A dip that begins `delay_ms` from now.
  void dip_vdda(double delay_ms, double duration_ms, double depth_v);
  void dip_coil_supply(double delay_ms, double duration_ms, double depth_v);
  /// Keeps the voltage of a cell by its charge; NaN ends it.
  void hold_cell(std::size_t cell, double voltage_v);
  void set_temperature(std::size_t sensor, double celsius);
  double die_c = 25, upper_die_c = 25;  ///< of the front end, and of the upper one of two chips
  /// 0: shorted; Bq76952Inputs::open_ohm: broken
  void set_thermistor_ohm(std::size_t sensor, double ohm);
  double temperature_c(std::size_t sensor) const { return celsius_[sensor]; }
  void set_noise(double cell_v, double shunt_v) {
    setup_.cell_noise_v = cell_v;
    setup_.shunt_noise_v = shunt_v;
  }
  /// The 32,768 Hz crystal of the real-time clock, which makes stop mode possible. Before the first step.
  void fit_clock();
  /// The charger has a bus of its own, at CAN2. Before the first step.
  void fit_charger_bus(std::uint32_t bits_per_second);
  /// An insulation monitor at PA6, for an image that reads one. Before the first step.
  void fit_insulation_monitor();
  /// No other node is on the bus, so nothing is acknowledged; the truck's controller is off.
  void silence_bus(bool silent) {
    vehicle.talks = !silent;
    board.can.others_acknowledge = !silent;
  }
  /// main() wakes up to `most_ms` late again and again, so samples are that late.
  void make_late(double most_ms) { late_ms_ = most_ms; }
  /// Steps of `step_ms` for the given time, for fast events.
  void fine_steps(double duration_ms, double step_ms = 0.2);

  bool closed(plant::Relay relay) const { return truck.contact_closed(relay); }
  bool both_mains_closed() const { return closed(plant::Relay::main_plus) && closed(plant::Relay::main_minus); }
  bool any_main_closed() const { return closed(plant::Relay::main_plus) || closed(plant::Relay::main_minus); }
  /// The controller has no supply, or is in reset.
  bool off() const { return held_in_reset_; }
  /// The battery can supply no current: one main contact is open, and the precharge relay or the other one.
  bool isolated() const;
  Level pin(plant::Relay relay) const { return port_c.driven(6 + static_cast<unsigned>(relay)); }
  double highest_cell_v() const, lowest_cell_v() const, pack_v() const;
  /// Time at which the second main contact has opened last [ms], or a negative value.
  double opened_ms() const { return opened_ms_; }

  struct Closing {
    double at_ms, across_v, peak_a, dc_link_v;
    plant::Relay relay;
    bool bounce;
  };
  /// Main contacts that connected the battery to a DC link more than `volt` below it, since an event number.
  std::vector<Closing> closings_below_v(double volt, std::size_t since = 0) const;
  /// Violations of the chip's manuals by the firmware.
  std::vector<std::string> violations() const;

  /// Time of the bytes on the buses of the front ends since the start.
  double i2c_ms() const { return i2c_.wire_ms() + upper_i2c_.wire_ms(); }
  /// More than 16 cells: the board stm32f405_80v, with a second chip.
  bool stacked() const { return truck.cell_count() > 16; }

  firmware::UnicornBoard board;
  Bq76952Model chip, upper_chip;  ///< the one with the lower cells, or all; the one with the upper cells
  bool isolator_supplied = true;  ///< false: no supply on its side of the upper chip
  plant::Truck truck;
  GpioPort port_a, port_b, port_c;
  ExtiModel exti;
  AdcModel adc;
  firmware::RtcModel rtc;
  std::optional<firmware::SecondCan> charger_bus;
  std::optional<InsulationDevice> insulation;
  Vehicle vehicle;
  SensorFaults sensors;
  std::function<void()> each_step;
  bool interlock = true, crashed = false, plugged = false, key_on = false;  ///< levels at PC5, PC13, PC3, PC2
  bool aux_fitted = true;  ///< false: the auxiliary contacts are not connected, the pins stay high

 private:
  void step(double limit_ms);
  double step_ms() const;
  void apply_pins();
  void observe();
  void update_supply(double vdda_v);
  void update_chip();
  void update_chip(Bq76952Model& which, std::size_t first, std::size_t count);
  void update_held_cells();
  void update_lateness();
  void update_auxiliary(unsigned pin, double pin_v, double vdda_v);
  void update_inputs(const plant::PinVoltages& v);

  WorldSetup setup_;
  WorldI2c i2c_, upper_i2c_;
  std::optional<PulseTimer> pulse_timer_;
  double insulation_passed_s_ = 0;
  plant::Random noise_;
  double truck_start_s_ = 0, fine_until_ms_ = 0, fine_step_ms_ = 1, switching_until_ms_ = 0, opened_ms_ = -1;
  double released_ms_ = never, late_ms_ = 0, late_edge_ms_ = 0;
  bool late_ = false;
  bool held_in_reset_ = false, supply_low_ = false, detected_ = false, were_closed_ = false;
  std::size_t seen_events_ = 0;
  std::uint64_t seen_writes_ = 0;
  bool enables_[2] = {false, false};
  std::array<double, 32> held_v_;
  bool any_held_ = false;
  std::array<double, 4> celsius_{25, 25, 25, 25}, ohm_{};
  std::vector<double> edges_ms_;
  plant::MonotoneCurve ocv_v_ = plant::table9_ocv_v();
};

}  // namespace bms::world
