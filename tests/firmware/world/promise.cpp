#include "tests/firmware/world/promise.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <stdexcept>

#include <fmt/format.h>

namespace bms::world {

namespace {

std::vector<std::string> columns(const std::string& line) {
  std::vector<std::string> found;
  for (std::size_t at = 1, end = 0; (end = line.find('|', at)) != std::string::npos; at = end + 1) {
    const auto first = line.find_first_not_of(' ', at), last = line.find_last_not_of(' ', end - 1);
    found.push_back(first >= end ? "" : line.substr(first, last - first + 1));
  }
  return found;
}

double seconds(const std::string& text) { return text.empty() || text == "-" ? 0 : std::stod(text); }

Reaction reaction_of(const std::string& text) {
  if (text == "warn") return Reaction::warn;
  if (text == "derate") return Reaction::derate;
  if (text == "forbid charge") return Reaction::forbid_charge;
  if (text == "forbid discharge") return Reaction::forbid_discharge;
  if (text == "open") return Reaction::open;
  if (text == "open now") return Reaction::open_now;
  throw std::runtime_error(fmt::format("no such reaction: {}", text));
}

Row row_of(const std::vector<std::string>& c) {
  Row row;
  row.bit = static_cast<unsigned>(std::stoul(c[0]));
  row.name = c[1];
  const auto sign = c[2].find_last_of("<>");
  if (sign == std::string::npos || sign < 1) throw std::runtime_error(fmt::format("no threshold in: {}", c[2]));
  row.quantity = c[2].substr(0, sign - 1);
  row.above = c[2][sign] == '>';
  row.threshold = std::stod(c[2].substr(sign + 1));
  row.delay_s = seconds(c[3]);
  row.released_above = !c[4].empty() && c[4][0] == '>';
  row.release_threshold = c[4].size() > 2 ? std::stod(c[4].substr(2)) : 0;
  row.release_s = seconds(c[5]);
  row.recovery = c[6];
  row.reaction = reaction_of(c[7]);
  return row;
}

constexpr double printed_cells = 16;         ///< of the table
constexpr double stack_error_v = 0.2;        ///< of the stack's own measurement, with any number of cells
constexpr double overload_from = 1.05;       ///< of the continuous limit, as the table says
constexpr double rest_current_share = 0.02;  ///< rest current at 1C

/// Thresholds of the pack, for another number of cells than the table's.
void fit_to_cells(Row& row, double factor) {
  if (row.quantity == "pack") {
    row.threshold *= factor;
    row.release_threshold *= factor;
  }
  if (row.quantity == "sum of cells minus pack") {
    row.threshold = stack_error_v + (row.threshold - stack_error_v) * factor;
    row.release_threshold = stack_error_v + (row.release_threshold - stack_error_v) * factor;
  }
}

bool begins(const std::string& text, const char* with) { return text.rfind(with, 0) == 0; }

}  // namespace

std::vector<Row> promised_rows(const std::filesystem::path& readme, double current_factor, std::size_t cells) {
  std::ifstream file(readme);
  std::vector<Row> rows;
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    if (line == "<!-- figures: table -->") inside = true;
    if (line == "<!-- end of figures -->") inside = false;
    if (!inside || line.empty() || line[0] != '|' || line.find_first_of("0123456789") != 2) continue;
    const auto c = columns(line);
    if (c.size() < 8) throw std::runtime_error(fmt::format("too few columns: {}", line));
    rows.push_back(row_of(c));
    const bool current = rows.back().quantity == "magnitude of the current";
    if (current) rows.back().threshold *= current_factor;
    fit_to_cells(rows.back(), static_cast<double>(cells) / printed_cells);
  }
  if (rows.empty()) throw std::runtime_error(fmt::format("{} has no table of protections", readme.string()));
  return rows;
}

Judge::Judge(TruckWorld& world, std::vector<Row> rows, double limit_a)
    : world_(world),
      rows_(std::move(rows)),
      watches_(rows_.size()),
      limit_a_(limit_a),
      last_s_(world.now_s()),
      before_(world.vehicle.faults()) {}

const Row& Judge::row(unsigned bit) const {
  for (const Row& r : rows_) {
    if (r.bit == bit) return r;
  }
  throw std::runtime_error(fmt::format("no protection with bit {}", bit));
}

double Judge::value(const Row& row) const {
  const std::string& q = row.quantity;
  const SensorFaults& s = world_.sensors;
  if (q == "highest cell") return world_.highest_cell_v();
  if (q == "lowest cell") return world_.lowest_cell_v();
  if (q == "pack") return world_.pack_v();
  if (q == "magnitude of the current") return std::abs(world_.truck.current_a());
  if (q == "highest minus lowest cell") return world_.highest_cell_v() - world_.lowest_cell_v();
  if (begins(q, "current above 1.1 times the allowed current")) {
    const double a = world_.truck.current_a();
    return std::abs(a) - 1.1 * (a > 0 ? world_.vehicle.allowed_charge_a() : world_.vehicle.allowed_discharge_a()) -
           rest_current_share * limit_a_;
  }
  if (begins(q, "overload integral I²t of charging")) return charge_overload_s_;
  if (begins(q, "overload integral I²t of discharging")) return discharge_overload_s_;
  if (q == "sum of cells minus pack") {
    double sum_v = -s.stack_error_v;
    for (const double v : s.cell_error_v) sum_v += v;
    return std::abs(sum_v);
  }
  if (q == "opposite shift of neighbours") {
    double shift_v = 0;
    for (std::size_t k = 0; k + 1 < world_.truck.cell_count(); ++k) {
      if (s.cell_error_v[k] * s.cell_error_v[k + 1] >= 0) continue;
      shift_v = std::max(shift_v, std::min(std::abs(s.cell_error_v[k]), std::abs(s.cell_error_v[k + 1])));
    }
    return shift_v;
  }
  if (q == "die of the measuring chip") return std::max(world_.die_c, world_.upper_die_c);
  const bool warmest = q == "warmest sensor";
  if (!warmest && q != "coldest sensor") return std::nan("");
  double c = std::nan("");
  for (std::size_t k = 0; k < 4; ++k) {
    const double t = world_.temperature_c(k);
    if (std::isnan(t)) continue;
    if (std::isnan(c) || (warmest ? t > c : t < c)) c = t;
  }
  return c;
}

/// Upper bound of the charge above the allowed current: against the published one, which is lower than what the cell
/// carries while the contactors have just closed or a load is lowered. Negative for other rows.
double Judge::most_excess_s(const Row& row) const {
  if (begins(row.quantity, "charge above the allowed charge current")) return charge_excess_s_;
  if (begins(row.quantity, "charge above the allowed discharge current")) return discharge_excess_s_;
  if (begins(row.quantity, "charge above the allowed current")) return std::max(charge_excess_s_, discharge_excess_s_);
  return -1;
}

bool Judge::judged(const Row& row) const { return !std::isnan(value(row)); }

/// Of the measurement: 1 mV of a cell and its filter, 0.1 K of the front end and the thermistor's curve, half a per
/// cent of the current.
double Judge::tolerance(const Row& row) const {
  const std::string& q = row.quantity;
  if (q == "highest cell" || q == "lowest cell") return 0.004 + more_tolerance_v;
  if (q == "pack") return 0.08 + 4 * more_tolerance_v;
  if (q == "magnitude of the current") return 0.01 * row.threshold + 0.1 + more_tolerance_a;
  if (q == "highest minus lowest cell") return 0.01 + 2 * more_tolerance_v;
  if (q == "sum of cells minus pack") return 0.06 + 4 * more_tolerance_v;
  if (q == "opposite shift of neighbours") return 0.03 + 2 * more_tolerance_v;
  if (begins(q, "overload integral")) return 0.2 * row.threshold;
  if (begins(q, "current above")) return 0.03 * limit_a_ + more_tolerance_a;
  return 0.7;
}

void Judge::watch(const Row& row, Watch& w, double now_s, double step_s) {
  const double v = value(row);
  if (std::isnan(v)) return;
  const double tol = tolerance(row), over = row.above ? v - row.threshold : row.threshold - v;
  w.beyond_s = over > tol && !blind ? w.beyond_s + step_s : 0;
  w.perhaps_s = over > -tol ? w.perhaps_s + step_s : std::max(0.0, w.perhaps_s - step_s);
  w.recent.emplace_back(now_s, w.perhaps_s);
  while (w.recent.front().first < now_s - 1.0) w.recent.pop_front();
  const bool published = world_.vehicle.fault(row.bit);
  if (published) w.reported = false;
  if (w.beyond_s > row.delay_s * (1 + more_delay_share) + chain_s && !published && !w.reported) {
    w.reported = true;
    ++missed_;
    find(fmt::format("missed: {} ({} is {:.3f} for {:.2f} s)", row.name, row.quantity, v, w.beyond_s));
  }
}

void Judge::check_raised(std::uint64_t raised, double now_s) {
  for (unsigned bit = 0; bit < 64; ++bit) {
    if ((raised >> bit & 1) == 0 || ((expected | allowed) >> bit & 1) != 0) continue;
    bool right = false;
    double longest_s = 0, v = std::nan("");
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      if (rows_[k].bit == bit) right = right || most_excess_s(rows_[k]) > 0.8 * rows_[k].threshold;
      if (rows_[k].bit != bit || watches_[k].recent.empty()) continue;
      for (const auto& [at, perhaps] : watches_[k].recent) longest_s = std::max(longest_s, perhaps);
      v = value(rows_[k]);
      right = right || (longest_s > 0 && longest_s > 0.97 * rows_[k].delay_s - 0.15);
    }
    if (right) continue;
    ++falsely_;
    find(fmt::format("false: {} at {:.2f} s (true value {:.3f}, for {:.2f} s)", fault_names(std::uint64_t{1} << bit),
                     now_s, v, longest_s));
  }
}

/// A published fault whose reaction is to open has opened after the grace time at the latest.
void Judge::check_open(double now_s) {
  double allowed_s = std::numeric_limits<double>::infinity();
  for (const Row& row : rows_) {
    if (!world_.vehicle.fault(row.bit)) continue;
    if (row.reaction == Reaction::open_now) allowed_s = 0;
    if (row.reaction == Reaction::open) allowed_s = std::min(allowed_s, grace_s);
  }
  bool driven = false;  // a weld keeps a contact closed although its output is low
  for (const plant::Relay relay : {plant::Relay::main_plus, plant::Relay::main_minus, plant::Relay::precharge}) {
    driven = driven || world_.pin(relay) == Level::high;
  }
  if (!std::isfinite(allowed_s) || world_.isolated() || !driven) {
    opening_since_s_ = -1;
    return;
  }
  if (opening_since_s_ < 0) opening_since_s_ = now_s;
  if (now_s - opening_since_s_ < allowed_s + chain_s || opening_since_s_ > 1e8) return;
  find(fmt::format("not opened: faults {} are published, contacts closed", fault_names(world_.vehicle.faults())));
  opening_since_s_ = 1e9;
}

void Judge::step() {
  const double now_s = world_.now_s(), step_s = now_s - last_s_;
  last_s_ = now_s;
  const double ratio = world_.truck.current_a() / (overload_from * limit_a_), heating = ratio * ratio - 1;
  double& overload_s = ratio > 0 ? charge_overload_s_ : discharge_overload_s_;
  double& other_s = ratio > 0 ? discharge_overload_s_ : charge_overload_s_;
  overload_s = std::max(0.0, overload_s + heating * step_s);
  other_s = std::max(0.0, other_s - step_s);
  const double a = world_.truck.current_a(), leak_a = 0.005 * limit_a_;  // 1C is the limit
  const auto integrate = [&](double& excess_s, double current_a, double allowed_a) {
    const double above_a = std::max(0.0, current_a - overload_from * allowed_a);
    excess_s = std::max(0.0, excess_s + (above_a - leak_a) / limit_a_ * step_s);
  };
  integrate(charge_excess_s_, a, world_.vehicle.allowed_charge_a());
  integrate(discharge_excess_s_, -a, world_.vehicle.allowed_discharge_a());
  for (std::size_t k = 0; k < rows_.size(); ++k) watch(rows_[k], watches_[k], now_s, step_s);
  const std::uint64_t faults = world_.vehicle.faults();
  check_raised(faults & ~before_, now_s);
  before_ = faults;
  check_open(now_s);
}

}  // namespace bms::world
