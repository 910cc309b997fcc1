#include "tests/firmware/board_fault_matrix.hpp"

#include <atomic>
#include <cmath>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from can/greybox_bms.dbc
#include "estimator/estimate.hpp"
#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "hal/bytes.hpp"
#include "hal/sample_frames.hpp"
#include "hil/board_link.hpp"
#include "host_sim/replay.hpp"
#include "images/firmware_image.hpp"
#include "tests/protection/simulated_truck.hpp"

namespace bms::protection {

namespace {

constexpr std::size_t charge_heat = 8, discharge_heat = 9, implausible = 18, precharge = 26, welded = 27,
                      not_closed = 28, no_samples = 29;
constexpr std::size_t in_frames = 30;                 // faults that frames can bring about
constexpr int opens_within_ms = 5'000 + 2 * step_ms;  // what opens waits five seconds for the current to cease
constexpr double most_a = 6;

std::string_view reaction_of(std::size_t k) { return expected_rows[k].reaction; }
bool opens(std::size_t k) {
  return reaction_of(k) == "open" || reaction_of(k) == "open now" || reaction_of(k) == "forbid discharge";
}

/// Built once.
const std::filesystem::path& image() {
  static const auto path = images::firmware_image("stm32f405_forklift", files::read_cell("table9"), images::Image::hil);
  return path;
}

/// The board at the other end, and what it said last.
class BoardTruck : public TruckPack {
 public:
  BoardTruck(std::uint64_t seed, MatrixResult& result, std::int32_t soc_ppb = 600'000'000)
      : TruckPack(seed), result_(result), link_(hil::emulated_link("stm32f405_forklift", image())) {
    receive(link_->exchange(0, std::vector{hal::frame_of(measurement::StartingPoint{soc_ppb, 20'000'000})}));
  }

  bool drive_off(const Change& change = {}) {
    for (int k = 0; k < 100 && contactors.state != can::ContactorState::state_drive; ++k) step(change);
    return contactors.state == can::ContactorState::state_drive;
  }

  void step(const Change& change = {}) {
    measure(told(), change);
    if (link) inputs.dc_link_uv = link(*this);
    std::vector<can::Frame> frames;
    if (steps() % 10 == 1) frames.push_back(request());
    const auto measured = hal::frames_of(sample, inputs.dc_link_uv, static_cast<std::uint16_t>(steps()));
    frames.insert(frames.end(), measured.begin(), measured.end());
    heard_faults_ = false;
    receive(link_->exchange(1e-6 * (static_cast<double>(sample.time_us) + 0.5), frames));
    if (!heard_faults_) complain("did not say Faults with a sample");
    judge();
    if (result_.traced) trace();
  }

  /// 100 ms without a sample.
  void wait() {
    measure(told());
    std::vector<can::Frame> frames;
    if (steps() % 10 == 1) frames.push_back(request());
    receive(link_->exchange(1e-6 * (static_cast<double>(sample.time_us) + 0.5), frames));
  }

  Outputs told() const {
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

  std::function<std::int32_t(const TruckPack&)> link;  ///< instead of the truck's own
  std::uint32_t faults = 0, expected = 0;
  std::uint32_t not_judged = 0;  ///< rows that the oracle does not know here
  std::uint32_t flags = 0;       ///< of the estimate
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
      if (f.id == can::Faults::id)
        faults = hal::get_bytes<std::uint32_t>(f.data, 2), heard_faults_ = true;  // bits 16 to 47
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
    expected = oracle_.check(sample, contradicts());
    for (std::size_t k = 0; k < fault_count; ++k) {
      if (!told_by_samples(k) || has(not_judged, k) || has(expected, k) == has(faults, k)) continue;
      ++(has(expected, k) ? result_.missed : result_.falsely);
      complain(fmt::format("{} {}, value {}", expected_rows[k].name, has(expected, k) ? "missed" : "false",
                           oracle_.values[k].value_or(measurement::no_reading)));
    }
    for (std::size_t k = 0; k < fault_count; ++k) {
      if (!has(faults, k)) told_at_us_[k] = sample.time_us;
    }
    drove_ = drove_ || contactors.state == can::ContactorState::state_drive;
    bool may_open = inputs.request == Request::none;
    for (std::size_t k = 0; k < fault_count; ++k)
      may_open = may_open || (has(faults, k) && opens(k)) ||
                 (has(faults, k) && reaction_of(k) == "forbid charge" && sample.current_ua > 0);
    forbidden_ = forbidden_ || may_open;
    if (drove_ && !forbidden_ && !is_closed()) complain("contactors opened without a fault that opens");
    for (std::size_t k = 0; k < fault_count; ++k) {
      if (!has(faults, k)) continue;
      const bool no_discharge = opens(k), no_charge = reaction_of(k) == "forbid charge" || reaction_of(k) == "open" ||
                                                      reaction_of(k) == "open now";
      if (reaction_of(k) == "open now" &&
          (contactors.main_plus != 0 || contactors.main_minus != 0 || contactors.precharge != 0))
        complain(std::string(expected_rows[k].name) + ": a contactor is closed");
      if (no_discharge && allowed.discharge > 0)
        complain(std::string(expected_rows[k].name) + ": discharge is allowed");
      if (no_charge && allowed.charge > 0) complain(std::string(expected_rows[k].name) + ": charge is allowed");
      if (reaction_of(k) == "derate" && sample.time_us - told_at_us_[k] >= 1'000'000 &&
          (allowed.discharge > 0.5 * most_a + 0.02 || allowed.charge > 0.5 * most_a + 0.02))
        complain(std::string(expected_rows[k].name) + ": more than half the current is allowed");
    }
  }

  MatrixResult& result_;
  std::unique_ptr<hil::BoardLink> link_;
  TruckOracle oracle_;
  std::uint8_t asked_ = 0;
  std::array<std::uint64_t, fault_count> told_at_us_{};
  bool heard_faults_ = false, drove_ = false, forbidden_ = false;
};

/// The same as inject(), of a board whose estimator is its own: it disbelieves what is beside its model.
void bring(std::size_t k, std::int32_t value, BoardTruck& truck, measurement::PackSample<16>& s, PackEstimate<16>& e) {
  if (k == charge_heat || k == discharge_heat) {
    s.current_ua = value;
  } else if (k == implausible) {
    for (auto& uv : s.cell_uv) uv -= value > 0 && uv != measurement::no_reading ? 300'000 : 0;
  } else {
    inject(k, value, truck, s, e);
  }
}
std::int32_t level(std::size_t k, bool above) {
  if (k == charge_heat) return above ? 12'000'000 : 6'270'000;
  if (k == discharge_heat) return above ? -12'000'000 : -6'270'000;
  return above ? levels(expected_rows[k]).just_above : levels(expected_rows[k]).just_below;
}
/// Beyond the threshold by up to three sigma, as somebody measures it: what stays the same to the last digit is another
/// fault.
void hold(std::size_t k, BoardTruck& truck, measurement::PackSample<16>& s, PackEstimate<16>& e) {
  const bool measured = told_by_samples(k) && levels(expected_rows[k]).noise > 0;
  const int sign = expected_rows[k].beyond == '>' ? 1 : -1;
  bring(
      k,
      level(k, true) + (measured ? sign * static_cast<std::int32_t>(measured_noise(k) * std::abs(truck.chance())) : 0),
      truck, s, e);
}
/// Twice the limit, over 1.05 of it: the integral is full after 30 s / (i^2 - 1).
int ideal_heat_ms() {
  const double i = 2 / 1.05;
  return static_cast<int>(30'000 / (i * i - 1));
}
int delay_ms(std::size_t k) {
  return k == charge_heat || k == discharge_heat ? ideal_heat_ms() : expected_rows[k].delay_ms;
}
/// An integral in 256ths is off by 1.4 %.
int tolerance_ms(std::size_t k) {
  return step_ms + (k == charge_heat || k == discharge_heat ? delay_ms(k) * 14 / 1'000 : 0);
}
/// How long until the estimator disbelieves is its own affair; what stands still is found when the others have moved.
bool begins_by_itself(std::size_t k) { return k == implausible || waits_for_others(k); }
int patience_ms(std::size_t k) { return delay_ms(k) + (begins_by_itself(k) ? 120'000 : 3'000); }

bool on_the_truck(std::size_t k) { return k < 26; }

class Matrix {
 public:
  Matrix(bool every, std::uint64_t seed) : every_(every), random_(seed) { result.rows.resize(fault_count); }

  struct Case {
    std::string name;
    std::function<void(MatrixResult&)> run;
  };

  std::vector<Case> cases() {
    std::vector<Case> all;
    if (every_) all.push_back({"the shift", shift});
    for (std::size_t k = 0; k < in_frames; ++k) {
      if (!on_the_truck(k)) continue;
      const std::string name = expected_rows[k].name;
      all.push_back({"just below " + name, [k](MatrixResult& r) { below(k, r); }});
      all.push_back({"just above " + name, [k](MatrixResult& r) { above(k, r); }});
      const bool measured = told_by_samples(k) && levels(expected_rows[k]).noise > 0;
      if (measured) {
        for (const int offset : one_of<int>({-1, 0, 1})) {
          all.push_back({fmt::format("noise {} {}",
                                     offset < 0   ? "below"
                                     : offset > 0 ? "above"
                                                  : "around",
                                     name),
                         [k, offset](MatrixResult& r) { noisy(k, offset, r); }});
        }
      } else if (told_by_samples(k)) {
        all.push_back({"now and then " + name, [k](MatrixResult& r) { loose(k, r); }});
      }
      std::vector<std::size_t> others;
      for (std::size_t other = 0; other < 26; ++other) {
        if (other != k && quantity_of(other) != quantity_of(k) && other != implausible && !waits_for_others(other))
          others.push_back(other);
      }
      for (const std::size_t other : one_of(others)) {
        all.push_back({fmt::format("{} during {}", name, expected_rows[other].name),
                       [k, other](MatrixResult& r) { during(k, other, r); }});
      }
    }
    const std::vector<std::size_t> harmless = {0, 3, 11, 13, 15, 17, 23};  // contactors close all the same
    for (const std::size_t k : {precharge, welded, not_closed, no_samples}) {
      const std::string name = expected_rows[k].name;
      all.push_back({"just below " + name, [k](MatrixResult& r) { contactors(k, false, {}, r); }});
      all.push_back({"just above " + name, [k](MatrixResult& r) { contactors(k, true, {}, r); }});
      for (const std::size_t other : one_of(harmless)) {
        all.push_back({fmt::format("{} during {}", name, expected_rows[other].name),
                       [k, other](MatrixResult& r) { contactors(k, true, other, r); }});
      }
    }
    return all;
  }

  MatrixResult result;

 private:
  template <class T>
  std::vector<T> one_of(std::vector<T> all) {
    if (every_) return all;
    return {all[random_.bits() % all.size()]};
  }
  static Quantity quantity_of(std::size_t k) {
    static constexpr ProtectionPlan plan = protection_plan(forklift);
    return plan.rules[k].quantity;
  }

  /// The eight hours of recordings/forklift_shift.csv, every second ten times with noise of its own: no fault is there,
  /// none may be told.
  static void shift(MatrixResult& result) {
    const std::vector<measurement::Sample> seconds =
        measurement::samples(files::read_recording(BMS_SOURCE_DIR "/recordings/forklift_shift.csv"));
    BoardTruck truck(6, result, 980'000'000);
    const auto is = [&](const measurement::Sample& at) {
      truck.trajectory = {static_cast<double>(at.current_ua), static_cast<double>(at.voltage_uv),
                          static_cast<double>(at.temperature_cdegc)};
    };
    is(seconds.front());
    if (!truck.drive_off()) return truck.complain("does not drive off");
    const std::uint64_t before = result.samples;
    for (const measurement::Sample& second : seconds) {
      is(second);
      for (int tenth = 0; tenth < 10; ++tenth) {
        truck.step();
        if (truck.faults != 0) return truck.complain(fmt::format("told faults {:08x}", truck.faults));
        if (truck.expected != 0) return truck.complain(fmt::format("there are faults {:08x}", truck.expected));
        if (!truck.is_closed()) return truck.complain("does not drive any more");
      }
    }
    result.shift_samples = result.samples - before;
  }

  static void below(std::size_t k, MatrixResult& result) {
    BoardTruck truck(k + 1, result);
    if (!truck.drive_off()) return truck.complain("does not drive off");
    for (int t = 0; t < patience_ms(k); t += step_ms) {
      truck.step([&](auto& s, auto& e, auto&) { bring(k, level(k, false), truck, s, e); });
      if (has(truck.faults, k)) return truck.complain("false");
    }
    if (truck.wrong == 0) ++result.rows[k].silent;
  }

  /// The time until it is told; and of a fault that opens, until the contactors are. Nothing: complained.
  static std::optional<int> reaction(std::size_t k, BoardTruck& truck, const TruckPack::Change& change,
                                     MatrixResult& result, int offset_ms = 0) {
    int told_ms = -1, opened_ms = truck.is_closed() ? -1 : 0;
    std::optional<int> since = begins_by_itself(k) ? std::nullopt : std::optional(0);
    const int most_ms = patience_ms(k) + opens_within_ms + 1'000;
    for (int t = offset_ms; t < most_ms; t += step_ms) {
      truck.step(change);
      if (!since && (k == implausible ? truck.contradicts() : has(truck.expected, k)))
        since = k == implausible ? t : t - delay_ms(k);
      if (told_ms < 0 && has(truck.faults, k)) told_ms = t;
      if (opened_ms < 0 && !truck.is_closed()) opened_ms = t;
      if (told_ms >= 0 && (opened_ms >= 0 || !opens(k) || k == charge_heat)) break;
    }
    const bool taken_away = (k == charge_heat || k == discharge_heat) && told_ms < 0 &&
                            !truck.is_closed();  // by another fault that the oracle knows: no current flows
    if (taken_away && truck.wrong == 0) return std::nullopt;
    if (told_ms < 0 || !since)
      return truck.complain(fmt::format("missed, faults {:08x}, contactors {}, flags of the estimate {:x}",
                                        truck.faults, truck.contactors.state, truck.flags)),
             std::nullopt;
    const int after_ms = told_ms - *since;
    if (after_ms < delay_ms(k) - (k == charge_heat || k == discharge_heat ? tolerance_ms(k) : 0))
      truck.complain(fmt::format("after {} ms: too soon", after_ms));
    if (after_ms > delay_ms(k) + tolerance_ms(k)) truck.complain(fmt::format("after {} ms: too late", after_ms));
    if (opens(k) && opened_ms != 0) {
      if (opened_ms < 0 || opened_ms > told_ms + (reaction_of(k) == "open now" ? 0 : opens_within_ms))
        truck.complain(fmt::format("opened {} ms after it was told", opened_ms - told_ms));
      result.rows[k].opened.add(opened_ms - *since);
    }
    return after_ms;
  }

  static void above(std::size_t k, MatrixResult& result) {
    BoardTruck truck(k + 40, result);
    if (!truck.drive_off()) return truck.complain("does not drive off");
    // an estimator that is still looking for its state of charge disbelieves nothing
    for (int t = 0; k == implausible && t < 300'000 && truck.flags != 0; t += step_ms) truck.step();
    if (const auto ms = reaction(
            k, truck, [&](auto& s, auto& e, auto&) { bring(k, level(k, true), truck, s, e); }, result))
      result.rows[k].above.add(*ms);
  }

  static void noisy(std::size_t k, int offset, MatrixResult& result) {
    const ExpectedRow& row = expected_rows[k];
    BoardTruck truck(100 + k * 3 + static_cast<std::size_t>(offset + 1), result);
    if (!truck.drive_off()) return truck.complain("does not drive off");
    const std::int32_t noise = measured_noise(k), sign = row.beyond == '>' ? 1 : -1;
    int told_ms = -1;
    for (int t = 0; t < row.delay_ms + 20'000; t += step_ms) {
      const auto value =
          row.threshold + sign * offset * (noise + 2) + static_cast<std::int32_t>(noise * truck.chance());
      truck.step([&](auto& s, auto& e, auto&) { bring(k, value, truck, s, e); });
      if (told_ms < 0 && has(truck.faults, k)) told_ms = t;
    }
    if (offset < 0 && told_ms >= 0) truck.complain("false");
    if (offset > 0 && (told_ms < row.delay_ms || told_ms > row.delay_ms + step_ms))
      truck.complain(fmt::format("told after {} ms", told_ms));
    if (offset > 0) result.rows[k].in_noise.add(told_ms);
    if (offset < 0 && truck.wrong == 0) ++result.rows[k].silent;
  }

  /// Of what is there or not: now and then. The oracle says when that is a fault.
  static void loose(std::size_t k, MatrixResult& result) {
    BoardTruck truck(200 + k, result);
    if (!truck.drive_off()) return truck.complain("does not drive off");
    for (int t = 0; t < 60'000; t += step_ms) {
      const bool now = truck.chance() > 0.15;  // a third of the samples
      truck.step([&](auto& s, auto& e, auto&) { bring(k, now ? 1 : 0, truck, s, e); });
    }
  }

  static void during(std::size_t k, std::size_t other, MatrixResult& result) {
    BoardTruck truck(1'000 + 32 * k + other, result);
    if (!truck.drive_off()) return truck.complain("does not drive off");
    for (int t = 0; t < delay_ms(other) + 500; t += step_ms) {
      truck.step([&](auto& s, auto& e, auto&) { hold(other, truck, s, e); });
    }
    if (!has(truck.faults, other)) return truck.complain("the other is not there");
    // from a turn on the others go far enough from where they were
    while (waits_for_others(k) && truck.steps() % 200 != 0)
      truck.step([&](auto& s, auto& e, auto&) { hold(other, truck, s, e); });
    const auto both = [&](auto& s, auto& e, auto&) {
      hold(other, truck, s, e);
      bring(k, level(k, true), truck, s, e);
    };
    if (shares(k, other)) {  // one takes away what the other is seen by: the oracle knows
      for (int t = 0; t < delay_ms(k) + 1'500; t += step_ms) truck.step(both);
      return;
    }
    if (const auto ms = reaction(k, truck, both, result)) result.rows[k].during.add(*ms);
  }
  /// Both are brought about by the same readings, or one by the loss of what the other needs.
  static bool shares(std::size_t k, std::size_t other) {
    const auto heat_or_current = [](std::size_t r) {
      return r == charge_heat || r == discharge_heat || r == 10 || r == 22;
    };
    const auto cells = [](std::size_t r) {
      return r <= 7 || r == 16 || r == 17 || r == 19 || r == 20 || r == 21 || r == 25 || r == implausible;
    };
    const auto warm = [](std::size_t r) { return (r >= 11 && r <= 15) || r == 23 || r == 24; };
    const bool open_already =
        k == implausible || (heat_or_current(k) && opens(other));  // without current there is none to be too much
    return open_already || (heat_or_current(k) && heat_or_current(other)) || (cells(k) && cells(other)) ||
           (warm(k) && warm(other));
  }

  /// Pre-charge, welded and not closed by the link's voltage, and samples that do not come. other: a fault that is
  /// there before.
  static void contactors(std::size_t k, bool above, std::optional<std::size_t> other, MatrixResult& result) {
    BoardTruck truck(3'000 + 10 * k + (above ? 1 : 0), result);
    const auto change = [&](auto& s, auto& e, auto&) {
      if (other) hold(*other, truck, s, e);
    };
    truck.inputs.request = Request::none;
    for (int t = 0; t < (other ? delay_ms(*other) + 500 : 1'000); t += step_ms) truck.step(change);
    if (other && !has(truck.faults, *other)) return truck.complain("the other is not there");
    truck.inputs.request = Request::drive;
    int in_precharge = 0, holds_since = -1, now = 0, told = -1, opened = -1;
    const auto holds = [&](bool yes) {
      if (yes && holds_since < 0) holds_since = now;
    };
    if (k == precharge) {
      // a hair above the least that the curve allows, or below it, from half a time constant on
      truck.link = [&](const TruckPack& t) {
        if (!truck.told().precharge || !truck.told().main_minus) return truck.is_closed() ? t.sample.pack_uv : 0;
        ++in_precharge;
        const int halves = in_precharge * step_ms / 250;
        if (above) holds(halves >= 1);
        const double least = 1 - std::exp(-0.5 * halves) - 0.2;
        if (!above && halves >= 11) return t.sample.pack_uv;
        return static_cast<std::int32_t>(t.sample.pack_uv * std::max(0.0, least + (above ? -0.002 : 0.002)));
      };
    } else if (k == welded) {
      // the link rises by an eighth with the pre-charge relay alone
      truck.link = [&](const TruckPack& t) -> std::int32_t {
        const Outputs o = truck.told();
        if (o.precharge && !o.main_minus) return holds(above), t.sample.pack_uv / 8 + (above ? 1 : 0);
        if (o.precharge && o.main_minus)
          return ++in_precharge, static_cast<std::int32_t>(t.sample.pack_uv * (1 - std::exp(-0.2 * in_precharge)));
        return truck.is_closed() ? t.sample.pack_uv : 0;
      };
    } else if (k == not_closed) {
      // a sixteenth below the pack with both closed
      truck.link = [&](const TruckPack& t) -> std::int32_t {
        const Outputs o = truck.told();
        if (o.precharge && o.main_minus)
          return ++in_precharge, static_cast<std::int32_t>(t.sample.pack_uv * (1 - std::exp(-0.2 * in_precharge)));
        if (!truck.is_closed()) return 0;
        holds(above);
        return static_cast<std::int32_t>(std::int64_t{t.sample.pack_uv} * 960 / 1024) - (above ? 1 : 0);
      };
    }
    if (k == no_samples) {
      if (!truck.drive_off(change)) return truck.complain("does not drive off");
      if (!above) {
        for (int gap = 0; gap < 4; ++gap) truck.wait();  // half a second from sample to sample
      } else {
        holds(true);
      }
    }
    for (; now < (above ? 12'000 : 10'000); now += step_ms) {
      if (k == no_samples && above)
        truck.wait();
      else
        truck.step(change);
      if (told < 0 && has(truck.faults, k)) told = now;
      const Outputs o = truck.told();
      if (told >= 0 && opened < 0 && !o.main_plus && !o.main_minus && !o.precharge) opened = now;
      if (opened >= 0) break;
    }
    if (!above) {
      if (told >= 0) truck.complain("false");
      if (!truck.is_closed()) truck.complain("does not drive");
      if (truck.wrong == 0) ++result.rows[k].silent;
      return;
    }
    if (told < 0 || holds_since < 0) return truck.complain("missed");
    // time without a sample counts from the last that came
    const int after_ms = told - holds_since + (k == no_samples ? step_ms : 0);
    const int stated_ms = k == no_samples ? 500 : expected_rows[k].delay_ms;
    if (after_ms > stated_ms + step_ms) truck.complain(fmt::format("told after {} ms: too late", after_ms));
    if (opened < 0 || opened > told) truck.complain("a contactor is closed when it is told");
    result.rows[k].opened.add(opened - holds_since + (k == no_samples ? step_ms : 0));
    (other ? result.rows[k].during : result.rows[k].above).add(after_ms);
  }

  bool every_;
  plant::Random random_;
};

void merge(DetectionTime& into, const DetectionTime& from) {
  if (from.cases == 0) return;
  into.soonest_ms = into.cases == 0 ? from.soonest_ms : std::min(into.soonest_ms, from.soonest_ms);
  into.latest_ms = std::max(into.latest_ms, from.latest_ms);
  into.cases += from.cases;
}

}  // namespace

MatrixResult run_fault_matrix(bool every, std::uint64_t seed, unsigned threads, const std::string& only) {
  image();
  Matrix matrix(every, seed);
  auto cases = matrix.cases();
  std::erase_if(cases, [&](const auto& c) { return c.name.find(only) == std::string::npos; });
  std::atomic<std::size_t> next = 0;
  std::mutex one_at_a_time;
  std::vector<std::thread> workers;
  for (unsigned t = 0; t < threads; ++t) {
    workers.emplace_back([&] {
      for (std::size_t c = next++; c < cases.size(); c = next++) {
        MatrixResult mine;
        mine.rows.resize(fault_count);
        mine.traced = !only.empty();
        try {
          cases[c].run(mine);
        } catch (const std::exception& e) {
          mine.wrong.push_back(e.what());
        }
        const std::lock_guard lock(one_at_a_time);
        MatrixResult& all = matrix.result;
        ++all.cases;
        all.samples += mine.samples;
        all.shift_samples += mine.shift_samples;
        all.missed += mine.missed;
        all.falsely += mine.falsely;
        for (const std::string& line : mine.wrong) all.wrong.push_back(cases[c].name + ": " + line);
        if (mine.traced) all.trace += cases[c].name + "\n" + mine.trace;
        for (std::size_t k = 0; k < fault_count; ++k) {
          all.rows[k].silent += mine.rows[k].silent;
          merge(all.rows[k].above, mine.rows[k].above);
          merge(all.rows[k].in_noise, mine.rows[k].in_noise);
          merge(all.rows[k].during, mine.rows[k].during);
          merge(all.rows[k].opened, mine.rows[k].opened);
        }
      }
    });
  }
  for (std::thread& w : workers) w.join();
  return matrix.result;
}

std::string markdown(const MatrixResult& result) {
  const auto told = [](const DetectionTime& t) {
    if (t.cases == 0) return std::string("-");
    if (t.soonest_ms == t.latest_ms) return fmt::format("{:.1f} s", 1e-3 * t.latest_ms);
    return fmt::format("{:.1f} to {:.1f} s", 1e-3 * t.soonest_ms, 1e-3 * t.latest_ms);
  };
  std::string out =
      "| fault | table | silent below, of cases | told just above it after | three sigma above | during others | of "
      "cases | open after |\n|---|---|---|---|---|---|---|---|\n";
  for (std::size_t k = 0; k < in_frames; ++k) {
    const MatrixRow& r = result.rows[k];
    const std::string stated = k == charge_heat || k == discharge_heat
                                   ? fmt::format("{:.1f} s at twice the limit", 1e-3 * ideal_heat_ms())
                                   : fmt::format("{:.1f} s", k == no_samples ? 0.5 : 1e-3 * expected_rows[k].delay_ms);
    out += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} |\n", expected_rows[k].name, stated, r.silent,
                       told(r.above), told(r.in_noise), told(r.during), r.during.cases, told(r.opened));
  }
  out += fmt::format("\n{} cases, {} samples: {} missed, {} false.", result.cases, result.samples, result.missed,
                     result.falsely);
  if (result.shift_samples > 0)
    out += fmt::format(" {} of the samples are the shift with noise: none told.", result.shift_samples);
  return out + "\n";
}

}  // namespace bms::protection
