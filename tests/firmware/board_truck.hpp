// A simulated truck with the emulated forklift board. The oracle judges every message of the board.
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "estimator/estimate.hpp"
#include "files/cell_file.hpp"
#include "hal/bytes.hpp"
#include "hal/sample_frames.hpp"
#include "hil/board_link.hpp"
#include "images/firmware_image.hpp"
#include "tests/firmware/board_fault_matrix.hpp"
#include "tests/firmware/protection/simulated_truck.hpp"
#include "tests/starting_point.hpp"

namespace bms::protection {

inline constexpr std::size_t charge_overload = 8, discharge_overload = 9, implausible = 18, precharge = 26, welded = 27,
                             not_closed = 28, no_samples = 29, internal_error = 30, failed_storage = 31,
                             tripped_line = 32, failed_line = 33, other_sensor = 34, unrequested = 36, exceeded = 37,
                             charge_limit = 38, discharge_limit = 39, not_obeyed = 40, dip = 41, shorted = 42;
/// Faults of precharge, contactors and missing samples: cases of their own.
inline constexpr std::array contactor_rows{precharge, welded, not_closed, no_samples};
/// Returns true if frames can cause fault k; the others are tested on the boards in Unicorn, those from the inputs of
/// the truck also in the world.
constexpr bool in_frames(std::size_t k) {
  return k != internal_error && k != failed_storage && k != tripped_line && k != failed_line && k != other_sensor &&
         k != dip && k <= shorted;
}
/// Rows whose quantity is the charge above the allowed current.
constexpr bool of_a_limit(std::size_t k) { return k == charge_limit || k == discharge_limit || k == not_obeyed; }
/// Rows whose quantity is an integral of the current: a time is that of the current of level().
constexpr bool of_an_integral(std::size_t k) {
  return k == charge_overload || k == discharge_overload || of_a_limit(k);
}
/// Rows whose condition is the current.
constexpr bool of_the_current(std::size_t k) { return of_an_integral(k) || k == exceeded; }
/// Returns true if a change of the truck's samples can cause fault k.
constexpr bool on_the_truck(std::size_t k) { return visible_in_samples(k) || of_the_current(k); }
constexpr bool every_row_has_a_case() {
  for (std::size_t k = 0; k < fault_count; ++k) {
    if (in_frames(k) && !on_the_truck(k) && k != unrequested &&
        std::ranges::find(contactor_rows, k) == contactor_rows.end())
      return false;
  }
  return true;
}
static_assert(every_row_has_a_case(),
              "a row has no case in the fault matrix of the board: add it to visible_in_samples() and inject() of "
              "simulated_truck.hpp, or to contactor_rows with its link_of function, or to in_frames()");
inline constexpr int opens_within_ms =
    5'000 + 2 * step_ms;              // a fault that opens waits five seconds for the current to end
inline constexpr double limit_a = 6;  // of table9

inline std::string_view reaction_of(std::size_t k) { return expected_rows[k].reaction; }
inline bool opens(std::size_t k) {
  return reaction_of(k) == "open" || reaction_of(k) == "open now" || reaction_of(k) == "forbid discharge";
}

/// The image; built once.
inline const std::filesystem::path& image() {
  static const auto path = images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::hil);
  return path;
}

/// A truck with the emulated board, and the last messages of the board.
class BoardTruck : public TruckPack {
 public:
  BoardTruck(std::uint64_t seed, MatrixResult& result, double soc = 0.6)
      : TruckPack(seed), result_(result), link_(hil::emulated_link("stm32f405_forklift", image())) {
    receive(link_->exchange(0, std::vector{hal::frame_of(starting_at(soc, 0.02))}));
  }

  bool drive_off(const Change& change = {}) {
    for (int k = 0; k < 100 && contactors.state != can::ContactorState::state_drive; ++k) step(change);
    return contactors.state == can::ContactorState::state_drive;
  }

  void step(const Change& change = {}) {
    measure(outputs(), change);
    if (link) set_link(link(*this));
    std::vector<can::Frame> frames;
    if (steps() % 10 == 1) frames.push_back(request());
    const auto measured =
        hal::frames_of(sample, inputs.link_plus_uv, static_cast<std::uint16_t>(steps()), inputs.link_minus_uv);
    frames.insert(frames.end(), measured.begin(), measured.end());
    received_faults_ = false;
    receive(link_->exchange(1e-6 * (static_cast<double>(sample.time_us) + 0.5), frames));
    if (!received_faults_) complain("no message Faults with a sample");
    judge();
    if (result_.traced) trace();
  }

  /// Passes 100 ms without a sample.
  void wait() {
    measure(outputs());
    std::vector<can::Frame> frames;
    if (steps() % 10 == 1) frames.push_back(request());
    receive(link_->exchange(1e-6 * (static_cast<double>(sample.time_us) + 0.5), frames));
  }

  Outputs outputs() const {
    return {.main_plus = contactors.main_plus != 0,
            .main_minus = contactors.main_minus != 0,
            .precharge = contactors.precharge != 0,
            .charge_enable = contactors.charge_enable != 0};
  }
  bool is_closed() const { return contactors.main_plus != 0 && contactors.main_minus != 0; }
  void complain(const std::string& what) {
    ++wrong;
    if (result_.wrong.size() < 100)
      result_.wrong.push_back(fmt::format("{} at {:.1f} s", what, 0.1 * static_cast<double>(steps())));
  }

  std::function<plant::LinkPoles(const TruckPack&)> link;  ///< DC link instead of that of the truck
  FaultSet faults = 0, expected = 0;
  FaultSet not_judged = 0;  ///< rows that the oracle cannot judge in this case
  std::uint32_t flags = 0;  ///< of the estimate
  bool contradicts() const { return (flags & estimator::voltage_rejected) != 0; }
  can::ContactorState contactors;
  can::AllowedCurrent allowed;
  int wrong = 0;

 private:
  can::Frame request() {
    can::Command command;
    command.code = can::Command::code_request;
    command.argument = static_cast<std::uint32_t>(inputs.request);
    return command.frame(asked_ = can::next(asked_));
  }

  void receive(const std::vector<can::Frame>& frames) {
    for (const can::Frame& f : frames) {
      if (f.id == can::Faults::id) {
        faults = (faults >> 32 << 32) | hal::get_bytes<std::uint32_t>(f.data, 2);  // bits 16 to 47
        received_faults_ = true;
      }
      if (f.id == can::MoreFaults::id)
        faults = FaultSet{hal::get_bytes<std::uint32_t>(f.data, 2)} << 32 | (faults & 0xFFFF'FFFF);
      if (f.id == can::ContactorState::id) contactors = can::ContactorState::of(f);
      if (f.id == can::AllowedCurrent::id) allowed = can::AllowedCurrent::of(f);
      if (f.id == can::Status::id) flags = can::Status::of(f).flags;
    }
  }

  void trace() {
    std::string names;
    for (std::size_t k = 0; k < fault_count; ++k)
      names += has(faults, k) ? fmt::format(" [{}]", expected_rows[k].name) : "";
    const auto [low, high] = std::minmax_element(sample.cell_uv.begin(), sample.cell_uv.end());
    result_.trace += fmt::format(
        "{:7.1f} s  {:7.2f} A  {:.3f} to {:.3f} V  {}  discharge {:.2f} A, charge {:.2f} A {}\n",
        0.1 * static_cast<double>(steps()), 1e-6 * sample.current_ua, 1e-6 * *low, 1e-6 * *high,
        contactor_state_names[static_cast<std::size_t>(contactors.state)], allowed.discharge, allowed.charge, names);
  }

  void judge() {
    ++result_.samples;
    judge_faults();
    judge_contactors();
    for (std::size_t k = 0; k < fault_count; ++k) {
      if (has(faults, k)) judge_reaction(k);
    }
  }

  void judge_faults() {
    expected = oracle_.check(sample, contradicts());
    for (std::size_t k = 0; k < fault_count; ++k) {
      if (!visible_in_samples(k) || has(not_judged, k) || has(expected, k) == has(faults, k)) continue;
      ++(has(expected, k) ? result_.missed : result_.falsely);
      complain(fmt::format("{} {}, value {}", expected_rows[k].name, has(expected, k) ? "missed" : "false",
                           oracle_.values[k].value_or(measurement::no_reading)));
    }
    for (std::size_t k = 0; k < fault_count; ++k) {
      if (!has(faults, k)) published_at_us_[k] = sample.time_us;
    }
  }

  void judge_contactors() {
    drove_ = drove_ || contactors.state == can::ContactorState::state_drive;
    bool may_open = inputs.request == Request::none;
    for (std::size_t k = 0; k < fault_count; ++k)
      may_open = may_open || (has(faults, k) && opens(k)) ||
                 (has(faults, k) && reaction_of(k) == "forbid charge" && sample.current_ua > 0);
    forbidden_ = forbidden_ || may_open;
    if (drove_ && !forbidden_ && !is_closed()) complain("contactors opened without a fault that opens");
  }

  /// Checks contactors and allowed currents while fault k is active.
  void judge_reaction(std::size_t k) {
    const std::string name = expected_rows[k].name;
    const bool open_now = reaction_of(k) == "open now";
    const bool no_charge = open_now || reaction_of(k) == "forbid charge" || reaction_of(k) == "open";
    if (open_now && (contactors.main_plus != 0 || contactors.main_minus != 0 || contactors.precharge != 0))
      complain(name + ": a contactor is closed");
    if (opens(k) && allowed.discharge > 0) complain(name + ": discharge is allowed");
    if (no_charge && allowed.charge > 0) complain(name + ": charge is allowed");
    if (reaction_of(k) == "derate" && sample.time_us - published_at_us_[k] >= 1'000'000 &&
        (allowed.discharge > 0.5 * limit_a + 0.02 || allowed.charge > 0.5 * limit_a + 0.02))
      complain(name + ": more than half the current is allowed");
  }

  MatrixResult& result_;
  std::unique_ptr<hil::BoardLink> link_;
  TruckOracle oracle_;
  std::uint8_t asked_ = 0;
  std::array<std::uint64_t, fault_count> published_at_us_{};
  bool received_faults_ = false, drove_ = false, forbidden_ = false;
};

}  // namespace bms::protection
