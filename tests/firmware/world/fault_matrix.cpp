// Every protection of the published table, caused at its physical source: just below its threshold, just above, with
// noise, and during another fault, in each operating state. Reaction times count to the physical opening of a main
// contact.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "tests/firmware/world/fault_causes.hpp"
#include "tests/firmware/world/scenarios.hpp"

namespace bms::world {

namespace {

constexpr double noise_v = 0.004, noise_a = 0.15, shunt_ohm = 1e-4;

enum class Kind { below, above, noise_below, noise_above, during };

struct Case {
  std::string name;
  Kind kind = Kind::above;
  const Row* row = nullptr;
  const Cause* cause = nullptr;  ///< if not by a quantity
  const Background* background = nullptr;
  double current_share = 0;  ///< of the limit, if the quantity is a current
};

double margin_of(const Row& row, Kind kind) {
  const std::string& q = row.quantity;
  double margin = 1.2;  // degrees
  if (q == "highest cell" || q == "lowest cell") margin = 0.006;
  if (q == "pack") margin = 0.1;
  if (q == "highest minus lowest cell") margin = 0.015;
  if (q == "sum of cells minus pack") margin = 0.08;
  if (q == "opposite shift of neighbours") margin = 0.04;
  const bool noise = kind == Kind::noise_above || kind == Kind::noise_below;
  return noise && margin < 1 ? margin + (q == "pack" || q == "sum of cells minus pack" ? 12 : 5) * noise_v : margin;
}

class FaultCase {
 public:
  FaultCase(TruckWorld& world, const std::vector<Row>& rows, const Pack& pack, const Case& c, Outcome& outcome)
      : world_(world), judge_(world, rows, pack.limit_a), pack_(pack), case_(c), outcome_(outcome) {}

  void run() {
    world_.vehicle.forget();
    run_ms_ = world_.now_ms();
    judge_.allowed = second_line | repeats;
    watched_s_ = world_.now_s();
    world_.each_step = [this] {
      judge_.step();
      watch_currents();
    };
    if (noise()) add_noise();
    if (case_.background != nullptr) {
      judge_.allowed |= case_.background->faults;
      case_.background->happens(world_);
      world_.run_ms(4'000);
    }
    was_closed_ = world_.both_mains_closed();
    begun_ms_ = world_.now_ms();
    if (case_.cause != nullptr) {
      by_cause(*case_.cause);
    } else if (case_.current_share != 0) {
      by_current();
    } else {
      by_quantity();
    }
    judge();
  }

 private:
  /// Voltage stuck, temperature stuck: a cell that is held, or a thermistor without noise, repeats its reading exactly.
  static constexpr std::uint64_t repeats = std::uint64_t{1} << 21 | std::uint64_t{1} << 24;
  static constexpr std::uint64_t second_line = std::uint64_t{1} << 32 | std::uint64_t{1} << 28;

  bool noise() const { return case_.kind == Kind::noise_above || case_.kind == Kind::noise_below; }
  bool silent() const { return case_.kind == Kind::below || case_.kind == Kind::noise_below; }

  void add_noise() {
    world_.set_noise(noise_v, noise_a * shunt_ohm);
    judge_.more_tolerance_v = 3.5 * noise_v;
    judge_.more_tolerance_a = 3 * noise_a;
    judge_.more_delay_share = 0.3;
    world_.run_ms(500);
  }

  void by_quantity() {
    const SetQuantity set = actuator_of(*case_.row);
    const double margin = margin_of(*case_.row, case_.kind), sign = case_.row->above == !silent() ? 1 : -1;
    if (case_.row->quantity == "pack") approach(set, case_.row->threshold + (case_.row->above ? -1 : 1) * margin);
    set(world_, case_.row->threshold + sign * margin);
    world_.run_ms(1e3 * ((1 + judge_.more_delay_share) * case_.row->delay_s + (silent() ? 2 : grace_s + 1.5)));
  }

  /// A jump of the pack would be a short circuit through the capacitor of the DC link: 20 V/s are 0.2 A.
  void approach(const SetQuantity& set, double value) {
    constexpr double step_v = 0.1, step_ms = 5;
    for (double v = world_.pack_v(); std::abs(value - v) > step_v; v += value > v ? step_v : -step_v) {
      set(world_, v);
      world_.run_ms(step_ms);
    }
    begun_ms_ = world_.now_ms();
  }

  void by_current() {
    const double a = case_.current_share * pack_.limit_a;
    world_.fine_steps(3'000, 1);
    set_drive_a(world_, a);
    const double f = std::abs(case_.current_share);
    const double over = f / 1.05;  // the integral begins at 1.05 of the limit
    if (case_.row->reaction == Reaction::warn) {
      world_.run_ms(1e3 * (case_.row->delay_s + 2));
    } else {
      world_.run_ms(f < 1.05 ? 12'000 : 1e3 * (30 / (over * over - 1) * 1.3 + grace_s + 1.5));
    }
  }

  void by_cause(const Cause& cause) {
    judge_.expected = std::uint64_t{1} << cause.bit;
    judge_.allowed |= cause.also;
    judge_.blind = cause.blind;
    cause.happens(world_);
    const double rest_s = judge_.row(cause.bit).delay_s + cause.within_s + grace_s + 2;
    for (double s = 0; s < rest_s; s += 1) {
      if (cause.each_second) cause.each_second(world_);
      world_.run_ms(1'000);
    }
    const double raised_ms = world_.vehicle.raised_ms(cause.bit, begun_ms_);
    const double limit_s = judge_.row(cause.bit).delay_s + cause.within_s + chain_s;
    if (raised_ms < 0) {
      missed_ = 1;
      outcome_.fail(fmt::format("missed: {} ({})", judge_.row(cause.bit).name, summary(world_)));
    }
    if (raised_ms >= 0 && raised_ms - begun_ms_ > 1e3 * limit_s)
      outcome_.fail(fmt::format("late: {} after {:.2f} s", judge_.row(cause.bit).name, 1e-3 * (raised_ms - begun_ms_)));
  }

  unsigned bit() const { return case_.cause != nullptr ? case_.cause->bit : case_.row->bit; }

  /// As the table and the invariants below it say.
  Reaction reaction_of(const Row& row) const {
    constexpr unsigned temperature_lost = 23;
    const bool no_charge = row.bit == temperature_lost && case_.cause != nullptr && case_.cause->no_temperature;
    return no_charge ? Reaction::forbid_charge : row.reaction;
  }

  /// Current in the direction that a fault forbids, while the fault was published.
  bool forbidden_current(Reaction reaction) const {
    if (reaction == Reaction::forbid_charge) return charged_;
    return reaction == Reaction::forbid_discharge && discharged_;
  }
  /// The grace time has passed with such a current.
  bool forbidden_for_long(Reaction reaction) const {
    if (reaction == Reaction::forbid_charge) return longest_charged_s_ > grace_s + chain_s;
    return reaction == Reaction::forbid_discharge && longest_discharged_s_ > grace_s + chain_s;
  }

  void watch_currents() {
    const double now_s = world_.now_s(), step_s = now_s - watched_s_, a = world_.truck.current_a();
    watched_s_ = now_s;
    bool no_charge = false, no_discharge = false;
    for (const Row& row : judge_.rows()) {
      if (!world_.vehicle.fault(row.bit)) continue;
      no_charge = no_charge || reaction_of(row) == Reaction::forbid_charge;
      no_discharge = no_discharge || reaction_of(row) == Reaction::forbid_discharge;
    }
    const double rest_a = 0.1 * pack_.limit_a;
    charged_ = charged_ || (no_charge && a > rest_a);
    discharged_ = discharged_ || (no_discharge && a < -rest_a);
    charged_s_ = no_charge && a > rest_a ? charged_s_ + step_s : 0;
    discharged_s_ = no_discharge && a < -rest_a ? discharged_s_ + step_s : 0;
    longest_charged_s_ = std::max(longest_charged_s_, charged_s_);
    longest_discharged_s_ = std::max(longest_discharged_s_, discharged_s_);
  }

  /// The contacts open because of a published fault with this reaction: not before it, and when they must. The front
  /// end's own pins open before the message; if it was reset, it is configured before the firmware asks it.
  void judge_opening() {
    const bool opened = was_closed_ && world_.isolated();
    bool must_open = false;
    double earliest_ms = std::numeric_limits<double>::infinity(), by = -1;
    for (const Row& row : judge_.rows()) {
      const double raised_ms = world_.vehicle.raised_ms(row.bit, run_ms_);
      if (raised_ms < 0) continue;
      const Reaction reaction = reaction_of(row);
      const bool opens = reaction == Reaction::open || reaction == Reaction::open_now;
      must_open = must_open || ((opens || forbidden_for_long(reaction)) && row.bit == bit() && !silent());
      if (!opens && !forbidden_current(reaction)) continue;
      const double ms = row.bit == 32 ? run_ms_ : raised_ms + 1e3 * (opens ? 0 : grace_s) - 1e3 * chain_s;
      if (ms > earliest_ms || (ms == earliest_ms && row.bit != bit())) continue;
      earliest_ms = ms;
      by = row.bit;
    }
    if (was_closed_ && must_open && !opened) outcome_.fail("not opened: " + summary(world_));
    if (!opened) return;
    outcome_.values["opened"] = 1e-3 * (world_.opened_ms() - begun_ms_);
    if (by < 0) return outcome_.fail("opened without a published cause: " + summary(world_));
    outcome_.values["opened by"] = by;
    if (world_.opened_ms() < earliest_ms) outcome_.fail("opened before its cause: " + summary(world_));
  }

  void judge() {
    outcome_.values["bit"] = bit();
    outcome_.values["silent"] = silent();
    outcome_.values["missed"] = judge_.missed() + missed_;
    outcome_.values["false"] = judge_.falsely();
    const double raised_ms = world_.vehicle.raised_ms(bit(), begun_ms_);
    if (raised_ms >= 0) outcome_.values["raised"] = 1e-3 * (raised_ms - begun_ms_);
    judge_opening();
    for (const std::string& finding : judge_.findings()) outcome_.fail(finding);
    if (!world_.closings_below_v(closing_limit_v).empty()) outcome_.fail(summary(world_));
    world_.each_step = {};
  }

  TruckWorld& world_;
  Judge judge_;
  const Pack& pack_;
  const Case& case_;
  Outcome& outcome_;
  double run_ms_ = 0, begun_ms_ = 0, watched_s_ = 0, charged_s_ = 0, discharged_s_ = 0, longest_charged_s_ = 0,
         longest_discharged_s_ = 0;
  unsigned missed_ = 0;
  bool was_closed_ = false, charged_ = false, discharged_ = false;
};

void add_quantity_cases(const std::vector<Row>& rows, const std::vector<Background>& background,
                        std::vector<Case>& list) {
  for (const Row& row : rows) {
    if (!actuator_of(row)) continue;
    const bool voltage = row.quantity.find("sensor") == std::string::npos;
    const auto add = [&](Kind kind, const std::string& text, const Background* b = nullptr) {
      list.push_back({.name = row.name + ", " + text, .kind = kind, .row = &row, .background = b});
    };
    add(Kind::below, "below");
    add(Kind::above, "above");
    if (voltage) add(Kind::noise_below, "noise below");
    if (voltage) add(Kind::noise_above, "noise above");
    for (std::size_t k = 0; k < 2; ++k) {
      const Background& b = background[(row.bit + 2 * k) % background.size()];
      const bool temperature_is_used = !voltage && b.name != "worn-out flash" && b.name != "a lost temperature";
      const Background& chosen = temperature_is_used ? background.back() : b;
      if (k == 0 || !temperature_is_used) add(Kind::during, "during " + chosen.name, &chosen);
    }
  }
}

const Row* row_named(const std::vector<Row>& rows, const std::string& name) {
  for (const Row& row : rows) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

std::vector<Case> cases_in(Operating state, const std::vector<Row>& rows, const std::vector<Cause>& causes,
                           const std::vector<Background>& background) {
  std::vector<Case> list;
  add_quantity_cases(rows, background, list);
  for (std::size_t k = 0; k < causes.size(); ++k) {
    if (causes[k].needs_current && (state == Operating::off || state == Operating::standby)) continue;
    list.push_back({.name = causes[k].name, .cause = &causes[k]});
    list.push_back({.name = causes[k].name + ", during worn-out flash",
                    .kind = Kind::during,
                    .cause = &causes[k],
                    .background = &background.back()});
  }
  if (state != Operating::drive && state != Operating::standby) return list;
  for (const double current_share : {1.0, -1.0, 1.25, -1.25}) {
    if (const Row* row = row_named(rows, "allowed current exceeded"); row != nullptr) {
      list.push_back({.name = fmt::format("{} at {} of the limit", row->name, current_share),
                      .kind = std::abs(current_share) > 1.1 ? Kind::above : Kind::below,
                      .row = row,
                      .current_share = current_share});
    }
  }
  for (const double share : {1.0, 1.03, 1.3, 1.5, 2.0, 3.0, 4.5, 6.0, 20.0}) {
    for (const int sign : {-1, 1}) {
      std::string name = sign < 0 ? "discharge overcurrent" : "charge overcurrent";
      if (share > 5) name = "short circuit";
      const Row* row = row_named(rows, name);
      if (row == nullptr) continue;
      list.push_back({.name = fmt::format("{} at {} of the limit", name, share),
                      .kind = share < 1.05 ? Kind::below : Kind::above,
                      .row = row,
                      .current_share = sign * share});
    }
  }
  return list;
}

struct Line {
  int silent = 0, raised = 0, opened = 0, deviations = 0;
  std::map<unsigned, int> opened_by_others;
  double soonest = 1e9, latest = -1, opened_soonest = 1e9, opened_latest = -1;
};

std::string table_of(const std::vector<Row>& rows, const std::vector<Outcome>& outcomes) {
  std::map<unsigned, Line> lines;
  double missed = 0, falsely = 0;
  int deviations = 0;
  for (const Outcome& o : outcomes) {
    deviations += o.good ? 0 : 1;
    Line& line = lines[static_cast<unsigned>(o.value("bit", 63))];
    missed += o.value("missed", 0);
    falsely += o.value("false", 0);
    line.deviations += o.good ? 0 : 1;
    line.silent += o.value("silent", 0) > 0 ? 1 : 0;
    const double raised = o.value("raised", -1), opened = o.value("opened", -1);
    if (raised >= 0) {
      ++line.raised;
      line.soonest = std::min(line.soonest, raised);
      line.latest = std::max(line.latest, raised);
    }
    const auto by = static_cast<unsigned>(o.value("opened by", o.value("bit", 63)));
    if (opened >= 0 && by != static_cast<unsigned>(o.value("bit", 63))) {
      ++line.opened_by_others[by];
    } else if (opened >= 0) {
      ++line.opened;
      line.opened_soonest = std::min(line.opened_soonest, opened);
      line.opened_latest = std::max(line.opened_latest, opened);
    }
  }
  std::string table =
      "| fault | table | silent below, cases | raised, cases | raised after [s] | contacts open after [s] | opened by "
      "another fault, cases | deviations |\n"
      "|---|---|---|---|---|---|---|---|\n";
  for (const Row& row : rows) {
    const auto found = lines.find(row.bit);
    if (found == lines.end()) continue;
    const Line& l = found->second;
    std::string others;
    for (const auto& [bit, count] : l.opened_by_others) {
      others += fmt::format("{}{} ({})", others.empty() ? "" : ", ", fault_names(std::uint64_t{1} << bit), count);
    }
    table += fmt::format("| {} | {} s | {} | {} | {} | {} | {} | {} |\n", row.name, row.delay_s, l.silent, l.raised,
                         l.raised == 0 ? "-" : fmt::format("{:.2f} to {:.2f}", l.soonest, l.latest),
                         l.opened == 0 ? "-" : fmt::format("{:.2f} to {:.2f}", l.opened_soonest, l.opened_latest),
                         others.empty() ? "-" : others, l.deviations);
  }
  return table + fmt::format("\n{} cases: {:.0f} missed, {:.0f} false, {} with a deviation of any kind.\n",
                             outcomes.size(), missed, falsely, deviations);
}

}  // namespace

Result run_fault_matrix(const Extent& extent) {
  const Pack pack = pack_of(printed_ah, extent.cells);
  const std::vector<Row> rows = promised_rows(BMS_SOURCE_DIR "/firmware/protection/README.md", 1, pack.cells);
  const std::vector<Cause> causes = other_causes(pack.cells);
  const std::vector<Background> background = backgrounds();
  Cases cases(extent.at_once);
  extent.set(cases, "faults", pack);
  std::vector<Outcome> broken;
  plant::Random random(extent.seed);
  for (const Operating state :
       {Operating::off, Operating::standby, Operating::drive, Operating::recuperate, Operating::charge}) {
    const std::vector<Case> list = cases_in(state, rows, causes, background);
    const auto named = [&](const Case& c) { return fmt::format("{}: {}", name_of(state), c.name); };
    if (cases.over() || std::none_of(list.begin(), list.end(), [&](const Case& c) { return extent.has(named(c)); }))
      continue;
    TruckWorld world(pack.image, typical_setup(pack, extent.seed));
    if (const std::string problem = bring_to(world, pack, state); !problem.empty()) {
      broken.emplace_back().name = name_of(state);
      broken.back().fail(problem);
      fmt::print("FAILED {}\n", problem);
      continue;
    }
    world.run_ms(3'000);
    std::size_t left = extent.count == 0 ? list.size() : extent.count / 5;
    const double share = static_cast<double>(left) / static_cast<double>(list.size());
    for (const Case& c : list) {
      const std::string name = named(c);
      if (!extent.has(name) || left == 0 || (extent.count != 0 && random.uniform() > share)) continue;
      --left;
      world.run_ms(37 * random.uniform());  // any phase of the sample
      cases.start(name, [&](Outcome& outcome) { FaultCase(world, rows, pack, c, outcome).run(); });
    }
  }
  Result result{extent.named("fault matrix"), "", cases.finish()};
  if (!cases.kept.empty()) result.outcomes = cases.all_kept();
  result.table = table_of(rows, result.outcomes);
  result.outcomes.insert(result.outcomes.end(), broken.begin(), broken.end());
  return result;
}

}  // namespace bms::world
