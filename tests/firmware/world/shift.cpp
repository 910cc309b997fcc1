// A working day with noise on all readings: driving, lifting, recuperation, pauses and charging at random. No fault may
// be published, and the contacts may open only when the key is off.
#include <algorithm>

#include <fmt/format.h>

#include "tests/firmware/world/promise.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

namespace {

constexpr double cell_noise_v = 0.0015, shunt_noise_v = 5e-6, latest_ms = 5;

class Shift {
 public:
  Shift(const Pack& pack, std::uint64_t seed, Outcome& outcome)
      : pack_(pack),
        world_(pack.image, random_setup(pack, seed)),
        judge_(world_,
               promised_rows(BMS_SOURCE_DIR "/firmware/protection/README.md", truck_ah / printed_ah, pack.cells),
               pack.limit_a),
        random_(seed + 7),
        outcome_(outcome) {
    world_.set_noise(cell_noise_v, shunt_noise_v);
    world_.make_late(latest_ms);
    world_.each_step = [this] { judge_.step(); };
  }

  void run(double minutes) {
    const double end_ms = 60e3 * minutes;
    while (world_.now_ms() < end_ms && outcome_.good) {
      const double soc = world_.truck.cells().soc(0);
      if (soc < 0.3 || random_.uniform() < 0.05) {
        charge(std::min(120.0, 60 * minutes / 4));
      } else {
        drive(std::min(300.0, 60 * minutes / 2));
      }
      if (key_off(world_) < 0) outcome_.fail("key off: stays closed: " + summary(world_));
      world_.run_ms(1e3 * between(0.5, 20));
      check();
    }
    outcome_.values["samples"] = world_.vehicle.frames[0x180];
    outcome_.values["shortest"] = world_.vehicle.shortest_cycle_ms;
    outcome_.values["longest"] = world_.vehicle.longest_cycle_ms;
    outcome_.values["starts"] = starts_;
    outcome_.values["minutes"] = world_.now_ms() / 60e3;
    outcome_.values["soc error"] = std::abs(world_.vehicle.soc_percent() - 100 * mean_soc());
  }

 private:
  double between(double least, double most) { return least + random_.uniform() * (most - least); }
  double mean_soc() {
    double soc = 0;
    const std::size_t cells = world_.truck.cell_count();
    for (std::size_t k = 0; k < cells; ++k) soc += world_.truck.cells().soc(k);
    return soc / static_cast<double>(cells);
  }

  bool start(Operating state) {
    ++starts_;
    const std::string problem = bring_to(world_, pack_, state);
    if (!problem.empty()) outcome_.fail(problem);
    return problem.empty();
  }

  void drive(double seconds) {
    if (!start(Operating::standby)) return;
    for (double s = 0; s < seconds && outcome_.good;) {
      const double lasts_s = between(0.5, 12);
      const bool recuperates = random_.uniform() < 0.25;
      const double most_a = recuperates ? world_.vehicle.allowed_charge_a() : world_.vehicle.allowed_discharge_a();
      const double a = std::min(pack_.limit_a, most_a) * between(0, 0.95);
      set_drive_a(world_, recuperates ? 0.5 * a : -a);
      for (double k = 0; k < lasts_s; k += 0.5) {
        world_.set_temperature(static_cast<std::size_t>(4 * random_.uniform()), 25 + between(-0.2, 0.2));
        world_.run_ms(500);
        if (!world_.both_mains_closed()) outcome_.fail("opens while driving: " + summary(world_));
      }
      s += lasts_s;
    }
  }

  void charge(double seconds) {
    if (!start(Operating::charge)) return;
    for (double s = 0; s < seconds && outcome_.good; s += 1) {
      const double most_a = std::min(pack_.limit_a, world_.vehicle.allowed_charge_a());
      set_charger_a(world_, 0.9 * most_a);
      world_.run_ms(1'000);
      if (!world_.both_mains_closed()) outcome_.fail("opens while charging: " + summary(world_));
    }
  }

  void check() {
    for (const std::string& finding : judge_.findings()) outcome_.fail(finding);
    if (!world_.closings_below_v(closing_limit_v).empty()) outcome_.fail(summary(world_));
    if (world_.vehicle.silent_ms() > 1'000) outcome_.fail("no Faults message for a second");
  }

  const Pack& pack_;
  TruckWorld world_;
  Judge judge_;
  plant::Random random_;
  Outcome& outcome_;
  int starts_ = 0;
};

}  // namespace

Result run_shift(const Extent& extent) {
  const Pack pack = pack_of(truck_ah, extent.cells);
  Cases cases(extent.at_once);
  const std::size_t trucks = extent.count == 0 ? extent.at_once : extent.count;
  const double minutes = extent.minutes / static_cast<double>(trucks);
  extent.set(cases, fmt::format("shift_{:.0f}s", 60 * minutes), pack);
  for (std::size_t k = 0; k < trucks; ++k) {
    const std::uint64_t seed = extent.seed + k;
    cases.start(fmt::format("truck {}", seed),
                [&, seed](Outcome& outcome) { Shift(pack, seed, outcome).run(minutes); });
  }
  Result result{extent.named("shift"), "", cases.finish()};
  double samples = 0, starts = 0, done = 0, soc_error = 0, shortest = 1e9, longest = 0;
  for (const Outcome& o : result.outcomes) {
    samples += o.value("samples", 0);
    starts += o.value("starts", 0);
    done += o.value("minutes", 0);
    shortest = std::min(shortest, o.value("shortest", 1e9));
    longest = std::max(longest, o.value("longest", 0));
    soc_error = std::max(soc_error, o.value("soc error", 0));
  }
  result.table = fmt::format(
      "| trucks | minutes | samples | time between two samples [ms] | starts | trucks with a fault | error of the "
      "state "
      "of charge at the end |\n"
      "|---|---|---|---|---|---|---|\n| {} | {:.0f} | {:.0f} | {:.1f} to {:.1f} | {:.0f} | {} | {:.1f} % |\n",
      result.outcomes.size(), done, samples, shortest, longest, starts, result.failed(), soc_error);
  return result;
}

}  // namespace bms::world
