#include "tests/firmware/board_fault_matrix.hpp"

#include <atomic>
#include <cmath>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include <fmt/format.h>

#include "files/recording.hpp"
#include "tests/firmware/board_truck.hpp"

namespace bms::protection {

namespace {

/// Like inject(), for a board with its own estimator, which rejects voltages that contradict its model.
void bring_about(std::size_t k, std::int32_t value, BoardTruck& truck, measurement::PackSample<16>& s,
                 PackEstimate<16>& e) {
  if (k == charge_overload || k == discharge_overload) {
    s.current_ua = value;
  } else if (k == charge_limit) {
    s.temperature_cdegc[3] = 500;  // half of the charge current is allowed
    s.current_ua = static_cast<std::int32_t>(1.05e6 * static_cast<double>(truck.allowed.charge)) + value;
  } else if (of_a_limit(k)) {
    s.temperature_cdegc[3] = -1'250;  // half of the discharge current is allowed
    s.current_ua = static_cast<std::int32_t>(-1.05e6 * static_cast<double>(truck.allowed.discharge)) - value;
  } else if (k == exceeded) {
    // 1.1 times the allowed current plus the rest current of 2 % of 6 Ah
    s.current_ua =
        static_cast<std::int32_t>(-1e6 * (1.1 * static_cast<double>(truck.allowed.discharge) + 0.12)) - value;
  } else if (k == implausible) {
    for (auto& uv : s.cell_uv) uv -= value > 0 && uv != measurement::no_reading ? 300'000 : 0;
  } else {
    inject(k, value, truck, s, e);
  }
}
/// 1C above the allowed current, and the leak of 0.5 %; twice as much for the row that opens, because the row that
/// forbids has opened after five seconds of grace otherwise.
std::int32_t limit_excess_ua(std::size_t k) { return (k == not_obeyed ? 12'000'000 : 6'000'000) + 30'000; }
std::int32_t level(std::size_t k, bool above) {
  if (k == charge_overload) return above ? 12'000'000 : 6'270'000;
  if (k == discharge_overload) return above ? -12'000'000 : -6'270'000;
  if (k == exceeded) return above ? 50'000 : -50'000;  // the message has steps of 20 mA
  if (of_a_limit(k)) return above ? limit_excess_ua(k) : 0;
  return above ? levels(expected_rows[k]).just_above : levels(expected_rows[k]).just_below;
}
/// Keeps the condition of fault k, beyond its threshold by up to three sigma of noise. A constant reading would be
/// another fault.
void keep(std::size_t k, BoardTruck& truck, measurement::PackSample<16>& s, PackEstimate<16>& e) {
  const bool measured = visible_in_samples(k) && levels(expected_rows[k]).noise > 0;
  const int sign = expected_rows[k].beyond == '>' ? 1 : -1;
  bring_about(
      k,
      level(k, true) + (measured ? sign * static_cast<std::int32_t>(measured_noise(k) * std::abs(truck.chance())) : 0),
      truck, s, e);
}
/// Twice the limit, relative to 1.05 of it: the overload integral is full after 30 s / (i^2 - 1).
int ideal_overload_ms() {
  const double i = 2 / 1.05;
  return static_cast<int>(30'000 / (i * i - 1));
}
int delay_ms(std::size_t k) {
  if (of_a_limit(k)) return expected_rows[k].threshold / (k == not_obeyed ? 2'000 : 1'000);
  return k == charge_overload || k == discharge_overload ? ideal_overload_ms() : expected_rows[k].delay_ms;
}
/// An integral in 256ths is off by 1.4 %. The allowed current begins to ramp down with the second sample, and the truck
/// of the test follows it a sample later.
int tolerance_ms(std::size_t k) {
  if (of_a_limit(k)) return 3 * step_ms;
  return step_ms + (of_an_integral(k) ? delay_ms(k) * 14 / 1'000 : 0);
}
/// The estimator decides when it rejects the voltage; a stuck reading is detected when the others have changed.
bool begins_by_itself(std::size_t k) { return k == implausible || waits_for_others(k); }
int patience_ms(std::size_t k) { return delay_ms(k) + (begins_by_itself(k) ? 120'000 : 3'000); }

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
    for (std::size_t k = 0; k < fault_count; ++k) {
      if (!on_the_truck(k)) continue;
      const std::string name = expected_rows[k].name;
      all.push_back({"just below " + name, [k](MatrixResult& r) { below(k, r); }});
      all.push_back({"just above " + name, [k](MatrixResult& r) { above(k, r); }});
      const bool measured = visible_in_samples(k) && levels(expected_rows[k]).noise > 0;
      if (measured) {
        for (const int offset : one_of<int>({-1, 0, 1})) {
          static constexpr std::array where{"below", "around", "above"};
          all.push_back({fmt::format("noise {} {}", where[static_cast<std::size_t>(offset + 1)], name),
                         [k, offset](MatrixResult& r) { noisy(k, offset, r); }});
        }
      } else if (visible_in_samples(k)) {
        all.push_back({"sometimes " + name, [k](MatrixResult& r) { loose(k, r); }});
      }
      std::vector<std::size_t> others;
      for (std::size_t other = 0; other < fault_count; ++other) {
        // a limit that is not obeyed opens before most other faults are raised
        if (on_the_truck(other) && other != k && quantity_of(other) != quantity_of(k) && other != implausible &&
            !waits_for_others(other) && !of_a_limit(other))
          others.push_back(other);
      }
      for (const std::size_t other : one_of(others)) {
        all.push_back({fmt::format("{} during {}", name, expected_rows[other].name),
                       [k, other](MatrixResult& r) { during(k, other, r); }});
      }
    }
    for (const bool past : {false, true})
      all.push_back({fmt::format("just {} {}", past ? "above" : "below", expected_rows[unrequested].name),
                     [past](MatrixResult& r) { without_request(past, r); }});
    const std::vector<std::size_t> harmless = {0, 3, 11, 13, 15, 17, 23};  // the contactors close in spite of these
    for (const std::size_t k : contactor_rows) {
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

  /// The eight hours of evidence/recordings/forklift_shift.csv, every second ten times with different noise. There is
  /// no fault, so none may be published.
  static void shift(MatrixResult& result) {
    const std::vector<measurement::Sample> seconds =
        measurement::samples(files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv"));
    BoardTruck truck(6, result, 0.98);
    const auto is = [&](const measurement::Sample& at) {
      truck.trajectory = {static_cast<double>(at.current_ua), static_cast<double>(at.voltage_uv),
                          static_cast<double>(at.temperature_cdegc)};
    };
    is(seconds.front());
    if (!truck.drive_off()) return truck.complain("does not start to drive");
    const std::uint64_t before = result.samples;
    for (const measurement::Sample& second : seconds) {
      is(second);
      for (int tenth = 0; tenth < 10; ++tenth) {
        truck.step();
        if (truck.faults != 0) return truck.complain(fmt::format("published faults {:010x}", truck.faults));
        if (truck.expected != 0) return truck.complain(fmt::format("the oracle has faults {:010x}", truck.expected));
        if (!truck.is_closed()) return truck.complain("stopped driving");
      }
    }
    result.shift_samples = result.samples - before;
  }

  static void below(std::size_t k, MatrixResult& result) {
    BoardTruck truck(k + 1, result);
    if (!truck.drive_off()) return truck.complain("does not start to drive");
    for (int t = 0; t < patience_ms(k); t += step_ms) {
      truck.step([&](auto& s, auto& e, auto&) { bring_about(k, level(k, false), truck, s, e); });
      if (has(truck.faults, k)) return truck.complain("false");
    }
    if (truck.wrong == 0) ++result.rows[k].silent;
  }

  static std::nullopt_t missed(BoardTruck& truck) {
    truck.complain(fmt::format("missed, faults {:010x}, contactors {}, flags of the estimate {:x}", truck.faults,
                               truck.contactors.state, truck.flags));
    return std::nullopt;
  }

  /// Returns the time until the fault is published, and records that until the contactors are open. Nothing: a
  /// deviation.
  static std::optional<int> reaction(std::size_t k, BoardTruck& truck, const TruckPack::Change& change,
                                     MatrixResult& result, int offset_ms = 0) {
    int published_ms = -1, opened_ms = truck.is_closed() ? -1 : 0;
    std::optional<int> since = begins_by_itself(k) ? std::nullopt : std::optional(0);
    const int most_ms = patience_ms(k) + opens_within_ms + 1'000;
    for (int t = offset_ms; t < most_ms; t += step_ms) {
      truck.step(change);
      if (!since && (k == implausible ? truck.contradicts() : has(truck.expected, k)))
        since = k == implausible ? t : t - delay_ms(k);
      if (published_ms < 0 && has(truck.faults, k)) published_ms = t;
      if (opened_ms < 0 && !truck.is_closed()) opened_ms = t;
      if (published_ms >= 0 && (opened_ms >= 0 || !opens(k) || k == charge_overload)) break;
    }
    const bool taken_away =
        of_an_integral(k) && published_ms < 0 && !truck.is_closed();  // another fault has opened: no current flows
    if (taken_away && truck.wrong == 0) return std::nullopt;
    if (published_ms < 0 || !since) return missed(truck);
    const int after_ms = published_ms - *since;
    if (after_ms < delay_ms(k) - (of_an_integral(k) ? tolerance_ms(k) : 0))
      truck.complain(fmt::format("after {} ms: too soon", after_ms));
    if (after_ms > delay_ms(k) + tolerance_ms(k)) truck.complain(fmt::format("after {} ms: too late", after_ms));
    if (opens(k) && opened_ms != 0) {
      if (opened_ms < 0 || opened_ms > published_ms + (reaction_of(k) == "open now" ? 0 : opens_within_ms))
        truck.complain(fmt::format("opened {} ms after the message", opened_ms - published_ms));
      result.rows[k].opened.add(opened_ms - *since);
    }
    return after_ms;
  }

  static void above(std::size_t k, MatrixResult& result) {
    BoardTruck truck(k + 40, result);
    if (!truck.drive_off()) return truck.complain("does not start to drive");
    // until the published current has risen to what the cell carries
    for (int t = 0; of_a_limit(k) && t < 4'000; t += step_ms)
      truck.step([&](auto& s, auto& e, auto&) { bring_about(k, 0, truck, s, e); });
    // an estimator that still searches for its state of charge rejects no voltage
    for (int t = 0; k == implausible && t < 3'600'000 && truck.flags != 0; t += step_ms) truck.step();
    if (const auto ms = reaction(
            k, truck, [&](auto& s, auto& e, auto&) { bring_about(k, level(k, true), truck, s, e); }, result))
      result.rows[k].above.add(*ms);
  }

  static void noisy(std::size_t k, int offset, MatrixResult& result) {
    const ExpectedRow& row = expected_rows[k];
    BoardTruck truck(100 + k * 3 + static_cast<std::size_t>(offset + 1), result);
    if (!truck.drive_off()) return truck.complain("does not start to drive");
    const std::int32_t noise = measured_noise(k), sign = row.beyond == '>' ? 1 : -1;
    int published_ms = -1;
    for (int t = 0; t < row.delay_ms + 20'000; t += step_ms) {
      const auto value =
          row.threshold + sign * offset * (noise + 2) + static_cast<std::int32_t>(noise * truck.chance());
      truck.step([&](auto& s, auto& e, auto&) { bring_about(k, value, truck, s, e); });
      if (published_ms < 0 && has(truck.faults, k)) published_ms = t;
    }
    if (offset < 0 && published_ms >= 0) truck.complain("false");
    if (offset > 0 && (published_ms < row.delay_ms || published_ms > row.delay_ms + step_ms))
      truck.complain(fmt::format("published after {} ms", published_ms));
    if (offset > 0) result.rows[k].in_noise.add(published_ms);
    if (offset < 0 && truck.wrong == 0) ++result.rows[k].silent;
  }

  /// A condition that holds only in some samples. The oracle decides when it is a fault.
  static void loose(std::size_t k, MatrixResult& result) {
    BoardTruck truck(200 + k, result);
    if (!truck.drive_off()) return truck.complain("does not start to drive");
    for (int t = 0; t < 60'000; t += step_ms) {
      const bool now = truck.chance() > 0.15;  // a third of the samples
      truck.step([&](auto& s, auto& e, auto&) { bring_about(k, now ? 1 : 0, truck, s, e); });
    }
  }

  static void during(std::size_t k, std::size_t other, MatrixResult& result) {
    BoardTruck truck(1'000 + 64 * k + other, result);
    if (!truck.drive_off()) return truck.complain("does not start to drive");
    for (int t = 0; t < delay_ms(other) + 500; t += step_ms) {
      truck.step([&](auto& s, auto& e, auto&) {
        // until then the truck obeys, also while the allowed current changes
        if (k == exceeded)
          s.current_ua = std::max(s.current_ua, static_cast<std::int32_t>(-1e6F * truck.allowed.discharge));
        keep(other, truck, s, e);
      });
    }
    if (!has(truck.faults, other)) return truck.complain("the other fault is not active");
    // after a turning point the other readings change far enough
    while (waits_for_others(k) && truck.steps() % 200 != 0)
      truck.step([&](auto& s, auto& e, auto&) { keep(other, truck, s, e); });
    const auto both = [&](auto& s, auto& e, auto&) {
      keep(other, truck, s, e);
      bring_about(k, level(k, true), truck, s, e);
    };
    if (shares(k, other)) {  // one fault hides the other: the oracle decides
      for (int t = 0; t < delay_ms(k) + 1'500; t += step_ms) truck.step(both);
      return;
    }
    if (const auto ms = reaction(k, truck, both, result)) result.rows[k].during.add(*ms);
  }
  /// Returns true if the same readings cause both faults, or if one needs a reading that the other removes.
  static bool shares(std::size_t k, std::size_t other) {
    const auto overload_or_current = [](std::size_t r) { return of_the_current(r) || r == 10 || r == 22; };
    const auto cells = [](std::size_t r) {
      return r <= 7 || r == 16 || r == 17 || r == 19 || r == 20 || r == 21 || r == 25 || r == implausible;
    };
    const auto warm = [](std::size_t r) { return (r >= 11 && r <= 15) || r == 23 || r == 24 || r == 35; };
    const bool open_already =
        k == implausible || (overload_or_current(k) && opens(other));  // without current there is no overcurrent
    return open_already || (overload_or_current(k) && overload_or_current(other)) || (cells(k) && cells(other)) ||
           (warm(k) && warm(other));
  }

  /// The request ends, and the load goes on until just before the delay is over, or beyond it.
  static void without_request(bool past, MatrixResult& result) {
    BoardTruck truck(past ? 5 : 4, result);
    if (!truck.drive_off()) return truck.complain("does not start to drive");
    truck.inputs.request = Request::none;  // received within a second
    for (int k = 0; k < 20 && truck.contactors.state != can::ContactorState::state_unloading; ++k) truck.step();
    const int delay = delay_ms(unrequested), load_ends_ms = past ? delay + opens_within_ms + 1'000 : delay;
    int published_ms = -1, opened_ms = -1;
    for (int t = 0; t < delay + opens_within_ms + 1'000; t += step_ms) {
      truck.step([&](auto& s, auto&, auto&) { s.current_ua = t < load_ends_ms ? s.current_ua : 0; });
      if (published_ms < 0 && has(truck.faults, unrequested)) published_ms = t;
      if (opened_ms < 0 && !truck.is_closed()) opened_ms = t;
    }
    if (!past) {
      if (published_ms >= 0 || opened_ms < load_ends_ms) truck.complain("opened a load that ended in time");
      if (truck.wrong == 0) ++result.rows[unrequested].silent;
      return;
    }
    if (published_ms < delay || published_ms > delay + step_ms)
      truck.complain(fmt::format("published after {} ms", published_ms));
    if (opened_ms < published_ms || opened_ms > published_ms + opens_within_ms)
      truck.complain(fmt::format("opened {} ms after the message", opened_ms - published_ms));
    result.rows[unrequested].above.add(published_ms);
    result.rows[unrequested].opened.add(opened_ms);
  }

  /// A fault of precharge or contactors, caused by the DC-link voltage, or missing samples.
  struct ContactorCase {
    std::size_t fault;
    bool above;
    int now_ms = 0, holds_since_ms = -1, in_precharge = 0;  ///< in_precharge: samples

    void condition_holds(bool yes) {
      if (yes && holds_since_ms < 0) holds_since_ms = now_ms;
    }
  };

  /// Poles of a DC link with this voltage, where the commanded contactors connect them.
  static plant::LinkPoles poles(const BoardTruck& truck, std::int32_t pack_uv, double dc_link_uv) {
    const Outputs o = truck.outputs();
    return plant::link_poles(o.main_plus || o.precharge, o.main_minus, 1e-6 * pack_uv, 1e-6 * dc_link_uv);
  }
  /// Just above the lowest voltage that the curve allows, or just below it, from half a time constant on. The curve
  /// starts at an empty DC link and has 1.5 times the time constant, minus a fifth of the pack.
  static double link_of_precharge(ContactorCase& c, const BoardTruck& truck, std::int32_t pack_uv) {
    if (!truck.outputs().precharge || !truck.outputs().main_minus) return truck.is_closed() ? pack_uv : 0;
    ++c.in_precharge;
    const int halves = c.in_precharge * step_ms / 250;
    if (c.above) c.condition_holds(halves >= 1);
    const double least = 1 - std::exp(-0.5 * halves / 1.5) - 0.2;
    if (!c.above && halves >= 11) return pack_uv;
    return pack_uv * std::max(0.0, least + (c.above ? -0.002 : 0.002));
  }
  static double precharged(ContactorCase& c, std::int32_t pack_uv) {
    ++c.in_precharge;
    return pack_uv * (1 - std::exp(-0.2 * c.in_precharge));
  }
  /// Both poles of an empty DC link are a little less or more than 1/256 of the pack below it, until the precharge
  /// relay alone brings them to the pack.
  static plant::LinkPoles poles_of_welded(ContactorCase& c, const BoardTruck& truck, std::int32_t pack_uv) {
    const Outputs o = truck.outputs();
    if (o.main_plus) return poles(truck, pack_uv, pack_uv);
    if (o.main_minus) return poles(truck, pack_uv, o.precharge ? precharged(c, pack_uv) : 0);
    if (o.precharge) c.condition_holds(c.above);
    const double both_v = 1e-6 * pack_uv * (o.precharge ? 1 : 1 - (c.above ? 0.95 : 1.05) / 256);
    return {both_v, both_v};
  }
  /// L+ is a sixteenth below the pack voltage with both contactors closed.
  static double link_of_not_closed(ContactorCase& c, const BoardTruck& truck, std::int32_t pack_uv) {
    const Outputs o = truck.outputs();
    if (o.precharge && o.main_minus && !o.main_plus) return precharged(c, pack_uv);
    if (!truck.is_closed()) return 0;
    c.condition_holds(c.above);
    return pack_uv - pack_uv / 16 - (c.above ? 1 : 0);
  }
  static void set_link(ContactorCase& c, BoardTruck& truck) {
    const auto from = [&](double (*link_of)(ContactorCase&, const BoardTruck&, std::int32_t)) {
      truck.link = [&c, &truck, link_of](const TruckPack& t) {
        return poles(truck, t.sample.pack_uv, link_of(c, truck, t.sample.pack_uv));
      };
    };
    if (c.fault == precharge) from(link_of_precharge);
    if (c.fault == welded) truck.link = [&](const TruckPack& t) { return poles_of_welded(c, truck, t.sample.pack_uv); };
    if (c.fault == not_closed) from(link_of_not_closed);
  }

  /// Starts to drive, then makes a pause of half a second between two samples, or stops the samples.
  static bool stop_samples(ContactorCase& c, BoardTruck& truck, const TruckPack::Change& change) {
    if (!truck.drive_off(change)) return false;
    c.condition_holds(c.above);
    for (int gap = 0; !c.above && gap < 4; ++gap) truck.wait();
    return true;
  }

  struct Times {
    int published_ms = -1, opened_ms = -1;
  };
  static Times run(ContactorCase& c, BoardTruck& truck, const TruckPack::Change& change) {
    Times t;
    for (; c.now_ms < (c.above ? 12'000 : 10'000); c.now_ms += step_ms) {
      if (c.fault == no_samples && c.above)
        truck.wait();
      else
        truck.step(change);
      if (t.published_ms < 0 && has(truck.faults, c.fault)) t.published_ms = c.now_ms;
      const Outputs o = truck.outputs();
      if (t.published_ms >= 0 && !o.main_plus && !o.main_minus && !o.precharge) {
        t.opened_ms = c.now_ms;
        break;
      }
    }
    return t;
  }

  /// other: a fault that is active before.
  static void contactors(std::size_t k, bool above, std::optional<std::size_t> other, MatrixResult& result) {
    BoardTruck truck(3'000 + 10 * k + (above ? 1 : 0), result);
    const auto change = [&](auto& s, auto& e, auto&) {
      if (other) keep(*other, truck, s, e);
    };
    truck.inputs.request = Request::none;
    for (int t = 0; t < (other ? delay_ms(*other) + 500 : 1'000); t += step_ms) truck.step(change);
    if (other && !has(truck.faults, *other)) return truck.complain("the other fault is not active");
    truck.inputs.request = Request::drive;
    ContactorCase c{k, above};
    set_link(c, truck);
    if (k == no_samples && !stop_samples(c, truck, change)) return truck.complain("does not start to drive");
    const Times t = run(c, truck, change);
    if (!above) {
      if (t.published_ms >= 0) truck.complain("false");
      if (!truck.is_closed()) truck.complain("does not drive");
      if (truck.wrong == 0) ++result.rows[k].silent;
      return;
    }
    if (t.published_ms < 0 || c.holds_since_ms < 0) return truck.complain("missed");
    const int before_ms = k == no_samples ? step_ms : 0;  // time without a sample counts from the last sample
    const int after_ms = t.published_ms - c.holds_since_ms + before_ms;
    const int stated_ms = k == no_samples ? 500 : expected_rows[k].delay_ms;
    if (after_ms > stated_ms + step_ms) truck.complain(fmt::format("published after {} ms: too late", after_ms));
    if (t.opened_ms < 0 || t.opened_ms > t.published_ms)
      truck.complain("a contactor is closed when the fault is published");
    result.rows[k].opened.add(t.opened_ms - c.holds_since_ms + before_ms);
    (other ? result.rows[k].during : result.rows[k].above).add(after_ms);
  }

  bool every_;
  plant::Random random_;
};

/// Time to detection according to the table of the protections.
std::string stated_time(std::size_t k) {
  if (k == charge_overload || k == discharge_overload)
    return fmt::format("{:.1f} s at twice the limit", 1e-3 * ideal_overload_ms());
  if (of_a_limit(k)) return fmt::format("{:.1f} s at {}C above it", 1e-3 * delay_ms(k), k == not_obeyed ? 2 : 1);
  return fmt::format("{:.1f} s", k == no_samples ? 0.5 : 1e-3 * expected_rows[k].delay_ms);
}

void merge(DetectionTime& into, const DetectionTime& from) {
  if (from.cases == 0) return;
  into.soonest_ms = into.cases == 0 ? from.soonest_ms : std::min(into.soonest_ms, from.soonest_ms);
  into.latest_ms = std::max(into.latest_ms, from.latest_ms);
  into.cases += from.cases;
}

void merge(MatrixResult& all, const MatrixResult& one, const std::string& name) {
  ++all.cases;
  all.samples += one.samples;
  all.shift_samples += one.shift_samples;
  all.missed += one.missed;
  all.falsely += one.falsely;
  for (const std::string& line : one.wrong) all.wrong.push_back(name + ": " + line);
  if (one.traced) all.trace += name + "\n" + one.trace;
  for (std::size_t k = 0; k < fault_count; ++k) {
    all.rows[k].silent += one.rows[k].silent;
    merge(all.rows[k].above, one.rows[k].above);
    merge(all.rows[k].in_noise, one.rows[k].in_noise);
    merge(all.rows[k].during, one.rows[k].during);
    merge(all.rows[k].opened, one.rows[k].opened);
  }
}

MatrixResult result_of(const Matrix::Case& one, bool traced) {
  MatrixResult result;
  result.rows.resize(fault_count);
  result.traced = traced;
  try {
    one.run(result);
  } catch (const std::exception& e) {
    result.wrong.push_back(e.what());
  }
  return result;
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
        const MatrixResult result = result_of(cases[c], !only.empty());
        const std::lock_guard lock(one_at_a_time);
        merge(matrix.result, result, cases[c].name);
      }
    });
  }
  for (std::thread& w : workers) w.join();
  return matrix.result;
}

std::string markdown(const MatrixResult& result) {
  const auto time = [](const DetectionTime& t) {
    if (t.cases == 0) return std::string("-");
    if (t.soonest_ms == t.latest_ms) return fmt::format("{:.1f} s", 1e-3 * t.latest_ms);
    return fmt::format("{:.1f} to {:.1f} s", 1e-3 * t.soonest_ms, 1e-3 * t.latest_ms);
  };
  std::string out =
      "| fault | table | silent below, number of cases | raised just above it after | three sigma above | during other "
      "faults | number of cases | open after |\n|---|---|---|---|---|---|---|---|\n";
  for (std::size_t k = 0; k < fault_count; ++k) {
    if (!in_frames(k)) continue;
    const MatrixRow& r = result.rows[k];
    out += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} |\n", expected_rows[k].name, stated_time(k), r.silent,
                       time(r.above), time(r.in_noise), time(r.during), r.during.cases, time(r.opened));
  }
  out += fmt::format("\n{} cases, {} samples: {} missed, {} false.", result.cases, result.samples, result.missed,
                     result.falsely);
  if (result.shift_samples > 0)
    out += fmt::format(" {} of the samples are the shift with noise, without a fault.", result.shift_samples);
  return out + "\n";
}

}  // namespace bms::protection
