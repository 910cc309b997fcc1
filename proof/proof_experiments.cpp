// The experiments of bms proof. The list is at the end; each function fills in claims and what is drawn of them.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "diagnosis/texts.hpp"
#include "experiments/splitmix.hpp"
#include "identification/goodness_of_fit.hpp"
#include "model/cell.hpp"
#include "proof/proof_lab.hpp"

namespace bms::proof {

namespace {

using diagnosis::Finding;
using model::catalogue;

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

// --- what a diagnosis said

std::string stem(const std::string& name) { return name.substr(name.rfind('/') + 1); }

const Finding* found(const workflow::DiagnoseResult& r, std::string_view id) {
  if (!r.named()) return nullptr;
  for (const Finding& f : r.diagnosis.findings) {
    if (catalogue[f.setting.index].id == id) return &f;
  }
  return nullptr;
}

/// Itself, or as what the recording cannot tell from what is named.
bool in_the_set(const workflow::DiagnoseResult& r, std::string_view id) {
  if (!r.named()) return false;
  return std::any_of(r.diagnosis.findings.begin(), r.diagnosis.findings.end(), [&](const Finding& f) {
    return catalogue[f.setting.index].id == id || std::any_of(f.equivalent_to.begin(), f.equivalent_to.end(),
                                                              [&](std::size_t m) { return catalogue[m].id == id; });
  });
}

std::string said_of(const workflow::DiagnoseResult& r) {
  std::string text = name_of(r.diagnosis.verdict);
  if (!r.named()) return text;
  for (std::size_t k = 0; k < r.diagnosis.findings.size(); ++k) {
    const Finding& f = r.diagnosis.findings[k];
    text += fmt::format("{} {}", k == 0 ? ":" : ",", catalogue[f.setting.index].id);
    for (const std::size_t m : f.equivalent_to) text += fmt::format(" or {}", catalogue[m].id);
  }
  return text;
}

std::size_t parameter_index(const model::MechanismInfo& info, std::string_view name) {
  std::size_t k = 0;
  while (k + 1 < info.parameters && info.parameter[k].name != name) ++k;
  return k;
}

struct Value {
  double value = nothing, sigma = 0;
};
std::optional<Value> value_of(const workflow::DiagnoseResult& r, std::string_view id, std::string_view parameter) {
  const Finding* f = found(r, id);
  if (!f) return std::nullopt;
  const std::size_t k = parameter_index(catalogue[f->setting.index], parameter);
  return Value{f->setting.value[k], std::isfinite(f->setting.deviation[k]) ? f->setting.deviation[k] : 0};
}

/// What was found, moved by one standard deviation along each axis of what is known of a mechanism's parameters
/// together.
std::vector<diagnosis::Hypothesis> one_deviation_away(const diagnosis::Diagnosis& d, std::string_view id) {
  const std::vector<diagnosis::ParameterRef> sought = d.extended.sought();
  std::vector<Eigen::Index> of;
  for (std::size_t j = 0; j < sought.size(); ++j) {
    if (catalogue[d.extended.settings[sought[j].setting].index].id == id) of.push_back(static_cast<Eigen::Index>(j));
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(Eigen::MatrixXd(d.covariance(of, of)));
  std::vector<diagnosis::Hypothesis> list;
  for (Eigen::Index axis = 0; axis < axes.eigenvalues().size(); ++axis) {
    diagnosis::Hypothesis& h = list.emplace_back(d.extended);
    for (std::size_t k = 0; k < of.size(); ++k) {
      const diagnosis::ParameterRef& s = sought[static_cast<std::size_t>(of[k])];
      model::MechanismSetting& setting = h.settings[s.setting];
      const model::Parameter& p = catalogue[setting.index].parameter[s.parameter];
      const double capacity_ah = d.cell.capacity_ah;
      setting.value[s.parameter] =
          std::clamp(setting.value[s.parameter] + std::sqrt(std::max(axes.eigenvalues()[axis], 0.0)) *
                                                      axes.eigenvectors()(static_cast<Eigen::Index>(k), axis),
                     p.lower(capacity_ah), p.upper(capacity_ah));
    }
  }
  return list;
}

// --- claims

void claim_named(ProofExperiment& e, const std::string& id, const std::string& claim, const workflow::DiagnoseResult& r,
                 const std::vector<std::string>& any_of, const std::string& measured) {
  std::string expected;
  for (const std::string& one : any_of) expected += (expected.empty() ? "" : " or ") + one;
  const bool holds =
      std::any_of(any_of.begin(), any_of.end(), [&](const std::string& one) { return in_the_set(r, one); });
  e.claims.push_back(
      {e.id + "." + id, claim, said_of(r), measured, "named, alone or among others: " + expected, {}, {}, {}, holds});
}

/// said: nothing when the tool gave no such number; then `instead` tells what it gave.
void claim_number(ProofExperiment& e, const std::string& id, const std::string& claim,
                  const std::optional<Value>& claimed, const std::string& instead, const Value& measured,
                  const std::string& by, double allowed, const std::string& unit) {
  ProofNumber n{{}, 0, measured.value, measured.sigma, allowed, unit};
  const auto text = [&](double value, double sigma) { return diagnosis::quantity(value, sigma, unit); };
  ProofClaim c{e.id + "." + id,
               claim,
               "not sized; " + instead,
               text(measured.value, measured.sigma) + ", " + by,
               "within " + text(allowed, 0),
               n,
               {},
               {},
               false};
  if (claimed) {
    c.number->claimed = claimed->value;
    c.number->claimed_sigma = claimed->sigma;
    c.claimed = text(claimed->value, claimed->sigma);
    const double apart = std::abs(claimed->value - measured.value);
    // what is read off the data, as a moment or a limit, has no deviation
    if (claimed->sigma > 0) c.within_uncertainty = apart <= 2 * std::hypot(claimed->sigma, measured.sigma);
    c.holds = apart <= allowed;
  }
  e.claims.push_back(std::move(c));
}

std::string millivolts(double v) { return fmt::format("{:.2f} mV", 1e3 * v); }

/// The error on what was not used, before and after.
void claim_better(ProofExperiment& e, const std::string& id, const std::string& claim, const std::string& what,
                  double before_v, double after_v, double allowed = 0.5) {
  e.claims.push_back({e.id + "." + id,
                      claim,
                      fmt::format("{} with what was found", millivolts(after_v)),
                      fmt::format("{} with the cell file; {}", millivolts(before_v), what),
                      allowed == 0.5 ? "halved" : fmt::format("at most {:.0f} % of it", 100 * allowed),
                      {},
                      ProofErrors{before_v, after_v, allowed},
                      {},
                      after_v <= allowed * before_v});
}

// --- what is measured directly

double rms(const workflow::RecordingComparison& c, const std::vector<double>& simulated, double soc_from = -1,
           double soc_to = 2) {
  identification::ErrorFigure error;
  for (std::size_t k = 0; k < c.record.size(); ++k) {
    if (c.recording.soc_ref[k] >= soc_from && c.recording.soc_ref[k] <= soc_to)
      error.add(c.record.voltage_v[k] - simulated[k]);
  }
  return error.rms();
}

/// Mean voltage of a slow run within 2 % around a soc, at half its current and more.
double slow_voltage(const files::Recording& r, double soc) {
  double most_a = 0, sum = 0;
  for (const double i : r.current_a) most_a = std::max(most_a, std::abs(i));
  std::size_t count = 0;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (std::abs(r.current_a[k]) > 0.5 * most_a && std::abs(r.soc_ref[k] - soc) < 0.02) sum += r.voltage_v[k], ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : nothing;
}

double slow_current(const files::Recording& r) {
  double sum = 0;
  std::size_t count = 0;
  for (const double i : r.current_a) {
    if (std::abs(i) > 0.01) sum += std::abs(i), ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : 0;
}

double median(std::vector<double> values) {
  if (values.empty()) return nothing;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Ohmic resistance: median of voltage over current where the current jumps, and that median's standard error.
Value edge_resistance(const files::Recording& r, double least_a = 1) {
  std::vector<double> ratios;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double di = r.current_a[k] - r.current_a[k - 1];
    if (r.time_s[k] - r.time_s[k - 1] < 1.5 && std::abs(di) >= least_a)
      ratios.push_back((r.voltage_v[k] - r.voltage_v[k - 1]) / di);
  }
  const double middle = median(ratios);
  std::vector<double> apart;
  for (const double x : ratios) apart.push_back(std::abs(x - middle));
  return {middle, ratios.empty() ? 0 : 1.2533 * 1.4826 * median(apart) / std::sqrt(static_cast<double>(ratios.size()))};
}

struct Rows {
  std::size_t from = 0, to = 0;  ///< to: one behind
};
std::vector<Rows> rests(const files::Recording& r, double at_least_s) {
  std::vector<Rows> list;
  for (std::size_t k = 0; k < r.rows();) {
    std::size_t end = k;
    while (end < r.rows() && std::abs(r.current_a[end]) < 0.02) ++end;
    if (end > k && r.time_s[end - 1] - r.time_s[k] >= at_least_s) list.push_back({k, end});
    k = std::max(k + 1, end);
  }
  return list;
}

/// What the current reads while nothing flows and the channel is on, and for how long it is on. A cycler's own rests
/// read exactly 0.
struct Idle {
  Value reading_a;
  double on_s = 0;
};
Idle idle_of(const files::Recording& r) {
  Idle idle;
  double sum = 0, squares = 0;
  std::size_t count = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    if (r.current_a[k] == 0) continue;
    idle.on_s += r.time_s[k] - r.time_s[k - 1];
    if (std::abs(r.current_a[k]) < 0.03) sum += r.current_a[k], squares += r.current_a[k] * r.current_a[k], ++count;
  }
  if (count > 0) {
    const double n = static_cast<double>(count), mean = sum / n;
    idle.reading_a = {mean, std::sqrt(std::max(0.0, squares / n - mean * mean) / n)};
  }
  return idle;
}

// --- what is drawn

ProofLines errors_over_time(const workflow::RecordingComparison& c, const std::string& title) {
  ProofLines lines{title, {"cell file, mV", "extended, mV"}, {}, "h", {{}, {}}};
  for (const std::size_t k : [&] {
         std::vector<std::size_t> rows;
         const std::size_t every = std::max<std::size_t>(1, c.record.size() / 3'000);
         for (std::size_t row = 0; row < c.record.size(); row += every) rows.push_back(row);
         return rows;
       }()) {
    lines.x.push_back((c.record.time_s[k] - c.record.time_s.front()) / 3'600);
    lines.columns[0].push_back(1e3 * (c.record.voltage_v[k] - c.base_v[k]));
    lines.columns[1].push_back(1e3 * (c.record.voltage_v[k] - c.extended_v[k]));
  }
  return lines;
}

// --- 1 hysteresis

struct Concealed {
  std::string folder, cell, drive, diagnosed;
};

void one_hysteresis(ProofLab& lab, ProofExperiment& e, const Concealed& what) {
  const std::string at = what.folder + "/";
  const files::CellFile& cell = lab.identified(what.cell, {at + "ocv_P25_dis"}, at + what.drive);
  const files::Recording &charge = lab.recording(at + "ocv_P25_chg"), &discharge = lab.recording(at + "ocv_P25_dis");
  const double gap_v = slow_voltage(charge, 0.5) - slow_voltage(discharge, 0.5),
               slow_a = (slow_current(charge) + slow_current(discharge)) / 2;
  const auto& rc = cell.parameters.rc;
  ProofBars bars{"slow charge of " + what.folder + ", 20 to 90 % of charge", "mV", {}};
  const workflow::DiagnoseResult& r = lab.diagnosed(cell, {at + what.diagnosed});
  const std::string id = what.folder + "." + what.diagnosed;
  claim_named(e, id + ".named", fmt::format("{}: a cell file from discharge alone lacks hysteresis", what.diagnosed), r,
              {"ocv_hysteresis"}, "slow charge and discharge lie apart");
  double ohm = model::cell_detail::rc_value(rc, rc.r0_ohm, 0.5) + model::cell_detail::rc_value(rc, rc.r1_ohm, 0.5);
  if (const auto slow = value_of(r, "slow_polarisation", "resistance_ohm")) ohm += slow->value;
  // the overvoltage is known to what is not settled about the slow resistance; the gap to 1 % of soc
  claim_number(e, id + ".half_gap",
               fmt::format("{}: half the gap between charge and discharge at rest", what.diagnosed),
               value_of(r, "ocv_hysteresis", "half_gap_v"), said_of(r), {gap_v / 2 - slow_a * ohm, 0.0015},
               fmt::format("C/30 at 50 % of charge: half of {:.1f} mV less {:.1f} mV of overvoltage", 1e3 * gap_v,
                           1e3 * slow_a * ohm),
               0.005, "V");
  claim_number(e, id + ".ocv_at", fmt::format("{}: on which branch the cell file's OCV lies", what.diagnosed),
               value_of(r, "ocv_hysteresis", "ocv_at"), said_of(r), {-1, 0}, "made from discharge", 0.5, "1");
  const workflow::RecordingComparison slow = lab.scored(r, at + "ocv_P25_chg");
  const double before_v = rms(slow, slow.base_v, 0.2, 0.9), after_v = rms(slow, slow.extended_v, 0.2, 0.9);
  claim_better(e, id + ".slow_charge", fmt::format("{}: predicts the slow charge that nobody has seen", what.diagnosed),
               "ocv_P25_chg from 20 to 90 % of charge", before_v, after_v);
  bars.rows.push_back({what.diagnosed, 1e3 * before_v, 1e3 * after_v});
  ProofLines lines{fmt::format("Slow charge, {}: not used; with what {} told", what.folder, what.diagnosed),
                   {"measured, V", "cell file, V", "extended, V"},
                   {},
                   "h",
                   {{}, {}, {}}};
  for (std::size_t k = 0; k < slow.record.size(); k += std::max<std::size_t>(1, slow.record.size() / 2'000)) {
    if (slow.recording.soc_ref[k] < 0.15 || slow.recording.soc_ref[k] > 0.93) continue;
    lines.x.push_back((slow.record.time_s[k] - slow.record.time_s.front()) / 3'600);
    lines.columns[0].push_back(slow.record.voltage_v[k]);
    lines.columns[1].push_back(slow.base_v[k]);
    lines.columns[2].push_back(slow.extended_v[k]);
  }
  e.lines.push_back(std::move(lines));
  e.bars.push_back(std::move(bars));
}

const Concealed discharge_a{"a123_26650", "a123_26650_from_discharge", "dyn20_P25_A002", "udds_P25_A002"};
const Concealed discharge_b{"a123_esctoolbox", "a123_esctoolbox_from_discharge", "dyn50_P25", "dyn50_P25"};

void hysteresis(ProofLab& lab, ProofExperiment& e) { one_hysteresis(lab, e, discharge_a); }
void hysteresis_of_another(ProofLab& lab, ProofExperiment& e) { one_hysteresis(lab, e, discharge_b); }

// --- 2 temperature

struct AtTemperature {
  double temperature_c;
  const char* recording;
};
constexpr AtTemperature temperatures[] = {{-15, "a123_26650/dyn10_N15_A002"}, {-5, "a123_26650/dyn10_N05_A002"},
                                          {5, "a123_26650/dyn10_P05_A002"},   {15, "a123_26650/dyn10_P15_A002"},
                                          {25, "a123_26650/dyn20_P25_A002"},  {45, "a123_26650/dyn10_P45_A002"}};

void temperature(ProofLab& lab, ProofExperiment& e) {
  // what is missing at 25 degrees C already would be put down to the temperature elsewhere
  const workflow::DiagnoseResult& at_home =
      lab.diagnosed(lab.identified(discharge_a.cell, {"a123_26650/ocv_P25_dis"}, "a123_26650/" + discharge_a.drive),
                    {"a123_26650/" + discharge_a.drive});
  const files::CellFile& cell = at_home.extended_cell;
  e.notes.push_back("Found at 25 degrees C: " + said_of(at_home));
  const Value at_25 = edge_resistance(lab.recording("a123_26650/dyn20_P25_A002"));
  const auto measured_ratio = [&](const AtTemperature& t) {
    const Value r = edge_resistance(lab.recording(t.recording));
    const double ratio = r.value / at_25.value;
    return Value{ratio, ratio * std::hypot(r.sigma / r.value, at_25.sigma / at_25.value)};
  };
  ProofPoints points{
      "Resistance at current edges over that at 25 degrees C: measured, and of the simulation, diagnosed at one "
      "temperature",
      "degrees C",
      "ratio",
      {},
      {}};
  for (const AtTemperature& t : temperatures) {
    const Value ratio = measured_ratio(t);
    points.measured.push_back({t.temperature_c, ratio.value, ratio.sigma});
  }
  for (const AtTemperature& from : {temperatures[2], temperatures[1], temperatures[5]}) {
    const workflow::DiagnoseResult& r = lab.diagnosed(cell, std::vector<std::string>{from.recording});
    const std::string id = fmt::format("{:g}C", from.temperature_c),
                      at = fmt::format("from {:g} degrees C", from.temperature_c);
    claim_named(e, id + ".named", at + ": a cell file made at 25 degrees C lacks the resistances' temperature", r,
                {"temperature_resistance"},
                fmt::format("resistance at edges {:.2f} times that at 25 degrees C", measured_ratio(from).value));
    const bool named = found(r, "temperature_resistance") != nullptr;
    // an edge shows the ohmic resistance and what is faster than a sample; the same of the simulation, and how far its
    // parameters let it go
    std::map<double, workflow::RecordingComparison> scored;
    const auto ratios_with = [&](const diagnosis::Hypothesis& extended, bool keep) {
      std::map<double, double> ohm;
      for (const AtTemperature& t : temperatures) {
        workflow::RecordingComparison c = lab.scored(r, t.recording, &extended);
        files::Recording simulated = c.recording;
        simulated.voltage_v = c.extended_v;
        ohm[t.temperature_c] = edge_resistance(simulated).value;
        if (keep) scored[t.temperature_c] = std::move(c);
      }
      const double at_25_ohm = ohm.at(25);
      for (auto& [temperature_c, value] : ohm) value /= at_25_ohm;
      return ohm;
    };
    const std::map<double, double> ratios = ratios_with(r.diagnosis.extended, true);
    std::map<double, double> squares;
    if (named) {
      for (const diagnosis::Hypothesis& other : one_deviation_away(r.diagnosis, "temperature_resistance")) {
        for (const auto& [temperature_c, value] : ratios_with(other, false))
          squares[temperature_c] += std::pow(value - ratios.at(temperature_c), 2);
      }
    }
    const auto predicted = [&](double temperature_c) {
      return Value{ratios.at(temperature_c), std::sqrt(squares.at(temperature_c))};
    };
    ProofPoints::Curve curve{at, {}};
    for (const AtTemperature& t : temperatures) {
      if (!named) break;
      const Value p = predicted(t.temperature_c);
      curve.points.push_back({t.temperature_c, p.value, p.sigma});
    }
    if (named) points.predicted.push_back(std::move(curve));
    ProofBars bars{"open loop, not used; diagnosed " + at, "mV", {}};
    for (const AtTemperature& t : temperatures) {
      if (t.temperature_c == 25 || t.temperature_c == from.temperature_c) continue;
      const Value ratio = measured_ratio(t);
      claim_number(e, fmt::format("{}.r0_at_{:g}C", id, t.temperature_c),
                   fmt::format("{}: resistance at edges at {:g} degrees C over that at 25", at, t.temperature_c),
                   named ? std::optional<Value>(predicted(t.temperature_c)) : std::nullopt, said_of(r), ratio,
                   "voltage over current at edges",
                   named ? std::clamp(2 * predicted(t.temperature_c).sigma, 0.2 * ratio.value, 0.5 * ratio.value)
                         : 0.2 * ratio.value,
                   "1");
      const workflow::RecordingComparison& other = scored.at(t.temperature_c);
      const double before_v = rms(other, other.base_v), after_v = rms(other, other.extended_v);
      if (from.temperature_c == 5)
        claim_better(e, fmt::format("{}.rmse_at_{:g}C", id, t.temperature_c),
                     fmt::format("{}: open loop at {:g} degrees C", at, t.temperature_c), stem(t.recording), before_v,
                     after_v);
      bars.rows.push_back({stem(t.recording), 1e3 * before_v, 1e3 * after_v});
      if (from.temperature_c == 5 && t.temperature_c == -5)
        e.lines.push_back(
            errors_over_time(other, "Measured less simulated at -5 degrees C; diagnosed at 5: " + stem(t.recording)));
    }
    e.bars.push_back(std::move(bars));
  }
  e.points.push_back(std::move(points));
}

// --- 3 slow polarisation

void relaxation(ProofLab& lab, ProofExperiment& e) {
  // the built-in cell has seen the pulse recording
  const files::CellFile& cell =
      lab.identified(discharge_a.cell, {"a123_26650/ocv_P25_dis"}, "a123_26650/" + discharge_a.drive);
  const std::string diagnosed = "udds_P25_A002";
  const workflow::DiagnoseResult& r = lab.diagnosed(cell, {"a123_26650/" + diagnosed});
  claim_named(e, diagnosed + ".named", diagnosed + ": one RC pair lacks what relaxes over minutes and hours", r,
              {"slow_polarisation"}, "the voltage still moves an hour into a rest");
  const workflow::RecordingComparison c = lab.scored(r, "a123_26650/pulse_P25_A002");
  const auto found_rests = rests(c.recording, 5'400);
  for (std::size_t n = 0; n < found_rests.size(); ++n) {
    const Rows rest = found_rests[n];
    const std::size_t last = rest.to - 1;
    identification::ErrorFigure before, after;
    ProofLines lines{fmt::format("Rest {} of pulse_P25_A002, relative to its end; diagnosed: {}", n + 1, diagnosed),
                     {"measured, mV", "cell file, mV", "extended, mV"},
                     {},
                     "min",
                     {{}, {}, {}}};
    for (std::size_t k = rest.from; k < rest.to; ++k) {
      const double measured = c.record.voltage_v[k] - c.record.voltage_v[last], base = c.base_v[k] - c.base_v[last],
                   extended = c.extended_v[k] - c.extended_v[last];
      before.add(measured - base);
      after.add(measured - extended);
      lines.x.push_back((c.record.time_s[k] - c.record.time_s[rest.from]) / 60);
      lines.columns[0].push_back(1e3 * measured);
      lines.columns[1].push_back(1e3 * base);
      lines.columns[2].push_back(1e3 * extended);
    }
    claim_better(e, fmt::format("{}.rest_{}", diagnosed, n + 1),
                 fmt::format("{}: the shape of rest {} ({:.1f} h)", diagnosed, n + 1,
                             (c.record.time_s[last] - c.record.time_s[rest.from]) / 3'600),
                 "pulse_P25_A002, voltage relative to the rest's end", before.rms(), after.rms());
    e.lines.push_back(std::move(lines));
  }
}

// --- 4 balance of charge

/// Charge that is read and does not arrive, as the findings have it, in Ah over a recording; of capacity_change
/// nothing.
std::optional<Value> lost_charge(const workflow::DiagnoseResult& r) {
  const files::Recording& recording = r.recordings.front().recording;
  double charged_ah = 0;
  for (std::size_t k = 1; k < recording.rows(); ++k)
    charged_ah += std::max(0.0, recording.current_a[k]) * (recording.time_s[k] - recording.time_s[k - 1]) / 3'600;
  const double hours = recording.duration_s() / 3'600;
  Value sum{0, 0};
  bool any = false;
  for (const auto& [id, parameter, factor] :
       {std::tuple{"current_offset", "offset_a", hours}, std::tuple{"coulombic_loss", "loss_fraction", charged_ah},
        std::tuple{"leakage", "current_a", hours}}) {
    if (const auto v = value_of(r, id, parameter)) {
      sum.value += v->value * factor;
      sum.sigma = std::hypot(sum.sigma, v->sigma * factor);
      any = true;
    }
  }
  if (!any) return std::nullopt;
  return sum;
}

void charge_balance(ProofLab& lab, ProofExperiment& e) {
  const files::CellFile& cell = lab.built_in("a123_26650");
  // what the cycler's counters have from full to full, Ah: the recordings' README, "soc_ref"
  const std::map<std::string, double> missing_ah = {
      {"dyn10_P05_A002", 0.0697}, {"dyn10_P15_A002", 0.0686}, {"dyn20_P25_A002", 0.0888}, {"dyn10_P45_A002", 0.0836}};
  ProofPoints points{
      "Charge read and not arrived: measured by the idle current, and as found", "", "mAh", {}, {{"as found", {}}}};
  for (const auto& [name, counters_ah] : missing_ah) {
    const workflow::DiagnoseResult& r = lab.diagnosed(cell, std::vector<std::string>{"a123_26650/" + name});
    claim_named(e, name + ".named", name + ": the cycler's charge does not balance", r,
                {"current_offset", "coulombic_loss", "leakage"},
                fmt::format("{:.0f} mAh missing from full to full, by the cycler's counters", 1e3 * counters_ah));
    const Idle idle = idle_of(lab.recording("a123_26650/" + name));
    const double idle_ah = idle.reading_a.value * idle.on_s / 3'600;
    const auto claimed = lost_charge(r);
    // what the idle current gives and what the counters give are two measurements of it
    claim_number(e, name + ".size", name + ": charge that is read and does not arrive", claimed, said_of(r),
                 {(idle_ah + counters_ah) / 2, std::abs(idle_ah - counters_ah) / 2},
                 fmt::format("{:+.1f} mA read while idle over {:.1f} h: {:.0f} mAh; counters {:.0f} mAh",
                             1e3 * idle.reading_a.value, idle.on_s / 3'600, 1e3 * idle_ah, 1e3 * counters_ah),
                 0.02, "Ah");
    const double x = static_cast<double>(points.measured.size() + 1);
    points.measured.push_back({x, 1e3 * (idle_ah + counters_ah) / 2, 1e3 * std::abs(idle_ah - counters_ah) / 2});
    if (claimed) points.predicted[0].points.push_back({x, 1e3 * claimed->value, 1e3 * claimed->sigma});
    points.names.push_back(name);
  }
  e.points.push_back(std::move(points));
}

void charge_balance_of_another(ProofLab& lab, ProofExperiment& e) {
  const files::CellFile& cell =
      lab.identified(discharge_b.cell, {"a123_esctoolbox/ocv_P25_dis"}, "a123_esctoolbox/dyn50_P25");
  for (const char* name : {"dyn50_P25", "dyn45_P05"}) {
    const workflow::DiagnoseResult& r =
        lab.diagnosed(cell, std::vector<std::string>{std::string("a123_esctoolbox/") + name});
    const bool any = found(r, "current_offset") || found(r, "coulombic_loss") || found(r, "leakage");
    // who has refused to look has not found it in order
    const bool looked = r.diagnosis.verdict != diagnosis::Verdict::data_fault &&
                        r.diagnosis.verdict != diagnosis::Verdict::not_testable;
    const Idle idle = idle_of(lab.recording(std::string("a123_esctoolbox/") + name));
    e.claims.push_back(
        {e.id + "." + name,
         std::string(name) + ": charge that balances is not called lost",
         said_of(r),
         fmt::format("{:+.1f} mA read while idle; the counters balance within 0.6 %", 1e3 * idle.reading_a.value),
         "diagnosed, and none of current_offset, coulombic_loss, leakage",
         {},
         {},
         {},
         looked && !any});
    if (const auto claimed = lost_charge(r))
      e.notes.push_back(
          fmt::format("{}: {:.0f} +- {:.0f} mAh as found", name, 1e3 * claimed->value, 1e3 * claimed->sigma));
  }
  e.notes.push_back(
      "dyn50_P25 as sampled ends 2.1 % (43 mAh) higher than the cycler's counters: its current was resampled. A loss "
      "of that size is in the recording, though not in the cell.");
}

// --- 5 faults put into a recording

struct Sizes {
  const char *parameter, *unit;
  double put_in;
  double allowed;
};
struct Injected {
  const char *id, *what;
  std::vector<Sizes> (*into)(files::Recording& r);  ///< changes the recording; what was put in
};

double half_time_s(const files::Recording& r) { return std::round((r.time_s.front() + r.time_s.back()) / 2); }

constexpr double clipped_a = 25, burst_ohm = 0.010;

std::vector<Sizes> offset_by_150_ma(files::Recording& r) {
  for (double& i : r.current_a) i += 0.15;
  return {{"offset_a", "A", 0.15, 0.03}};
}
std::vector<Sizes> gain_of_8_percent(files::Recording& r) {
  for (double& i : r.current_a) i *= 1.08;
  return {{"gain_error", "1", 0.08, 0.016}};
}
std::vector<Sizes> late_by_two_samples(files::Recording& r) {
  for (std::size_t k = r.rows(); k-- > 0;) r.current_a[k] = r.current_a[k >= 2 ? k - 2 : 0];
  const double delay_s = 2 * r.duration_s() / static_cast<double>(r.rows() - 1);
  return {{"delay_s", "s", delay_s, 0.2 * delay_s}};
}
std::vector<Sizes> clipped(files::Recording& r) {
  double more_a = 0;
  std::size_t count = 0;
  for (double& i : r.current_a) {
    if (std::abs(i) <= clipped_a) continue;
    more_a += std::abs(i) - clipped_a;
    ++count;
    i = std::copysign(clipped_a, i);
  }
  const double mean_a = count > 0 ? more_a / static_cast<double>(count) : 0;
  return {{"limit_a", "A", clipped_a, 0.2 * clipped_a}, {"excess_a", "A", mean_a, 0.2 * mean_a}};
}
std::vector<Sizes> contact_worse_at_half_time(files::Recording& r) {
  const double since_s = half_time_s(r);
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (r.time_s[k] >= since_s) r.voltage_v[k] += 0.003 * r.current_a[k];
  }
  return {{"resistance_ohm", "ohm", 0.003, 0.0006}, {"onset_s", "s", since_s, 120}};
}
/// Bursts of 5 to 30 s, a minute or more apart, as a loose plug has them.
std::vector<Sizes> contact_bursts(files::Recording& r) {
  experiments::SplitMix chance(20);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(chance.bits() >> 11) * 0x1p-53;
  };
  double begin_s = r.time_s.front() + between(60, 400), end_s = begin_s + between(5, 30);
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (r.time_s[k] > end_s) {
      begin_s = end_s + between(60, 400);
      end_s = begin_s + between(5, 30);
    }
    if (r.time_s[k] >= begin_s && r.time_s[k] <= end_s) r.voltage_v[k] += burst_ohm * r.current_a[k];
  }
  return {{"resistance_ohm", "ohm", burst_ohm, 0.2 * burst_ohm}};
}
std::vector<Sizes> voltage_higher_by_15_mv(files::Recording& r) {
  for (double& v : r.voltage_v) v += 0.015;
  return {{"offset_v", "V", 0.015, 0.003}};
}

const Injected faults[] = {
    {"current_offset", "current reads 150 mA too much", offset_by_150_ma},
    {"current_gain", "current reads 8 % too much", gain_of_8_percent},
    {"channel_skew", "current is two samples late", late_by_two_samples},
    {"current_clipping", "current reads 25 A at most", clipped},
    {"contact_step", "a contact is 3 mOhm worse from half time", contact_worse_at_half_time},
    {"contact_intermittent", "a contact of 10 mOhm comes and goes", contact_bursts},
    {"voltage_offset", "voltage reads 15 mV too much", voltage_higher_by_15_mv},
};

void instrument_faults(ProofLab& lab, ProofExperiment& e) {
  const std::string base = "a123_26650/udds_P25_A002";
  const workflow::DiagnoseResult& untouched = lab.diagnosed(lab.built_in("a123_26650"), {base});
  e.notes.push_back("The untouched recording: " + said_of(untouched));
  ProofPoints points{"Size found over size put in", "", "found / put in", {}, {{"found", {}}}};
  for (const Injected& fault : faults) {
    files::Recording r = lab.recording(base);
    const std::vector<Sizes> sizes = fault.into(r);
    const workflow::DiagnoseResult& d = lab.diagnosed(untouched.extended_cell, base + ", " + fault.what, {r});
    claim_named(e, std::string(fault.id) + ".named", fault.what, d, {fault.id}, "put into the recording");
    for (const Sizes& s : sizes) {
      const auto claimed = value_of(d, fault.id, s.parameter);
      claim_number(e, fmt::format("{}.{}", fault.id, s.parameter), fmt::format("{}: {}", fault.what, s.parameter),
                   claimed, said_of(d), {s.put_in, 0}, "put into the recording", s.allowed, s.unit);
      if (&s != &sizes.back()) continue;
      const double x = static_cast<double>(&fault - std::begin(faults) + 1);
      points.measured.push_back({x, 1, 0});
      if (claimed)
        points.predicted[0].points.push_back({x, claimed->value / s.put_in, claimed->sigma / std::abs(s.put_in)});
    }
    points.names.push_back(fault.id);
  }
  e.points.push_back(std::move(points));
}

// --- 6 nothing where nothing is

void no_mismatch(ProofLab& lab, ProofExperiment& e) {
  const files::CellFile& cell = lab.built_in("a123_26650");
  struct Pair {
    const char *learned, *asked;
  };
  for (const Pair& p : {Pair{"a123_26650/udds_P25_A002", "a123_26650/udds_P25_A002"},
                        Pair{"a123_26650/dyn10_P05_A002", "a123_26650/dyn10_P05_A002"},
                        Pair{"a123_26650/dyn10_P05_A002", "a123_26650/dyn10_P15_A002"}}) {
    const workflow::DiagnoseResult& learned = lab.diagnosed(cell, std::vector<std::string>{p.learned});
    const workflow::DiagnoseResult& again = lab.diagnosed(learned.extended_cell, std::vector<std::string>{p.asked});
    e.claims.push_back(
        {fmt::format("{}.{}.{}", e.id, stem(p.learned), stem(p.asked)),
         fmt::format("extended by {}, {} is no mismatch", stem(p.learned), stem(p.asked)),
         said_of(again),
         fmt::format("{} open loop; the noise floor is {}", millivolts(again.baseline ? again.baseline->rmse_v : 0),
                     millivolts(again.diagnosis.noise_floor_v)),
         "NO_MISMATCH",
         {},
         {},
         {},
         again.diagnosis.verdict == diagnosis::Verdict::no_mismatch});
    e.lines.push_back(errors_over_time(
        again.recordings.front(),
        fmt::format("Measured less simulated, {}: cell extended by {}, and what the second diagnosis adds",
                    stem(p.asked), stem(p.learned))));
    e.lines.back().labels = {"extended, mV", "extended again, mV"};
  }
}

// --- 7 recordings that were not used

void holdouts(ProofLab& lab, ProofExperiment& e) {
  const files::CellFile& cell = lab.built_in("a123_26650");
  const workflow::DiagnoseResult& r =
      lab.diagnosed(cell, std::vector<std::string>{"a123_26650/udds_P25_A002", "a123_26650/dyn10_P05_A002"});
  e.notes.push_back("Found: " + said_of(r));
  ProofBars bars{"open loop on recordings that the diagnosis did not use", "mV", {}};
  for (const char* name : {"a123_26650/dyn20_P25_A002", "a123_26650/pulse_P25_A002", "a123_26650/cccv1C_P25_A002",
                           "a123_26650/dyn10_P15_A002", "a123_26650/dyn10_P45_A002", "a123_26650/dyn10_N05_A002",
                           "a123_26650/fsae_P25_A004"}) {
    const workflow::RecordingComparison c = lab.scored(r, name);
    // where the file's resistances were identified; nearer to full and empty they are no more than drawn on
    const double before_v = rms(c, c.base_v, 0.1, 0.95), after_v = rms(c, c.extended_v, 0.1, 0.95);
    claim_better(e, stem(name), fmt::format("open loop on {}", stem(name)),
                 fmt::format("10 to 95 % of charge; all of it {} and {}", millivolts(rms(c, c.base_v)),
                             millivolts(rms(c, c.extended_v))),
                 before_v, after_v);
    bars.rows.push_back({stem(name), 1e3 * before_v, 1e3 * after_v});
    if (std::string_view(name).find("dyn20") != std::string_view::npos)
      e.lines.push_back(errors_over_time(c, "Measured less simulated, not used: " + stem(name)));
  }
  e.bars.push_back(std::move(bars));
}

}  // namespace

const std::vector<ProofEntry>& proof_list() {
  const auto of = [](const std::string& folder, std::vector<std::string> names) {
    for (std::string& name : names) name.insert(0, folder + "/");
    return names;
  };
  const std::string a = "a123_26650", b = "a123_esctoolbox";
  // the long ones first: two may run beside each other
  static const std::vector<ProofEntry> list = {
      {"hysteresis", "Hysteresis",
       "Cell file from a slow discharge alone, R0, R1, C1 from a drive recording at 25 degrees C; another drive "
       "recording diagnosed. Confirmed by the slow charge.",
       hysteresis, of(a, {"ocv_P25_dis", "ocv_P25_chg", "dyn20_P25_A002", "udds_P25_A002"}), 8'000},
      {"hysteresis_b", "Hysteresis, another laboratory", "The same with another cell of the type and another cycler.",
       hysteresis_of_another, of(b, {"ocv_P25_dis", "ocv_P25_chg", "dyn50_P25"}), 37'000},
      {"temperature", "Temperature",
       "Cell file made at 25 degrees C, extended by the diagnosis of a drive recording at 25 degrees C; one at another "
       "temperature diagnosed. Confirmed by the voltage at current edges and by the open loop at the other "
       "temperatures.",
       temperature,
       of(a, {"ocv_P25_dis", "dyn10_N15_A002", "dyn10_N05_A002", "dyn10_P05_A002", "dyn10_P15_A002", "dyn20_P25_A002",
              "dyn10_P45_A002"}),
       151'000},
      {"relaxation", "Slow polarisation",
       "Cell file from a slow discharge and a drive recording, one RC pair; another drive recording diagnosed. "
       "Confirmed by the two long rests of a pulse recording, predicted in open loop.",
       relaxation, of(a, {"ocv_P25_dis", "dyn20_P25_A002", "udds_P25_A002", "pulse_P25_A002"}), 8'000},
      {"balance", "Balance of charge",
       "Built-in cell; drive recordings diagnosed, each by itself. Confirmed by what the current reads while idle and "
       "by the cycler's counters from full to full.",
       charge_balance, of(a, {"dyn10_P05_A002", "dyn10_P15_A002", "dyn20_P25_A002", "dyn10_P45_A002"}), 75'000},
      {"balance_b", "Balance of charge, another laboratory",
       "A cycler whose counters balance: nothing may be called lost.", charge_balance_of_another,
       of(b, {"ocv_P25_dis", "dyn50_P25", "dyn45_P05"}), 39'000},
      {"faults", "Faults put into a recording",
       "udds_P25_A002 with a fault of the instrument put into it; the cell file is extended by the diagnosis of the "
       "untouched recording first.",
       instrument_faults, of(a, {"udds_P25_A002"}), 58'000},
      {"no_mismatch", "Nothing where nothing is",
       "The cell file extended by a diagnosis, and recordings that it should reproduce.", no_mismatch,
       of(a, {"udds_P25_A002", "dyn10_P05_A002", "dyn10_P15_A002"}), 83'000},
      {"holdouts", "Recordings that were not used",
       "Built-in cell; udds_P25_A002 and dyn10_P05_A002 diagnosed together. The cell file itself was identified from "
       "udds_P25_A002, dyn20_P25_A002 and pulse_P25_A002; fsae is another cell (A004).",
       holdouts,
       of(a, {"udds_P25_A002", "dyn10_P05_A002", "dyn20_P25_A002", "pulse_P25_A002", "cccv1C_P25_A002",
              "dyn10_P15_A002", "dyn10_P45_A002", "dyn10_N05_A002", "fsae_P25_A004"}),
       46'000},
  };
  return list;
}

}  // namespace bms::proof
