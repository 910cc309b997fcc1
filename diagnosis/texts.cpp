#include "diagnosis/texts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "diagnosis/decision.hpp"

namespace bms::diagnosis {

namespace {

using model::catalogue;

constexpr std::array<MechanismText, model::mechanism_count> vocabulary = {{
    {"channel_skew", "a time skew of the channels", "current and voltage are not read at the same moment",
     "shows as spikes at the edges of the current, up at one and down at the next, and nowhere else",
     "The current that stands in a row was flowing a moment before or after its voltage was read.",
     "Synchronise the two channels, or shift the current by the time found before anything else is concluded."},
    {"current_offset", "an offset of the current sensor", "the current sensor's zero is off",
     "lets the counted charge run away with time and can be read off the sensor when nothing flows",
     "The sensor reads a current where none flows; the charge count drifts as long as it runs.",
     "Zero the current sensor with the contactor open, or let the extended cell file subtract the offset."},
    {"current_gain", "a gain error of the current sensor", "the current sensor's scale is off",
     "scales the voltage drop and the counted charge alike",
     "Shunt value or amplifier gain is not what the software believes.",
     "Check the shunt's value and the scaling against a reference current."},
    {"current_clipping", "clipping of the current sensor", "the current sensor ends before the current does",
     "shows only where the current reads its largest value, while the voltage goes on falling",
     "The sensor saturates: what flows beyond its end is neither seen nor counted.",
     "Use a sensor or an amplifier of wider range; the charge counted at its end is too small."},
    {"temperature_sensor", "an error of the temperature sensor", "the temperature sensor reads wrong or late",
     "follows the rate of change of the temperature, or shifts all that depends on it",
     "What is measured is not the temperature of the cell, or comes late.", "Check the sensor and how it is mounted."},
    {"initial_soc", "a wrong state of charge at the start", "the state of charge at the start was another",
     "is there from the first sample on and does not grow",
     "The recording began at another state of charge than was believed.",
     "Let the cell rest before a recording and read its start from the voltage, outside the flat part of the curve."},
    {"capacity_change", "a change of capacity", "the cell holds another charge than its file says",
     "grows with the charge moved and comes back where the charge does",
     "The cell has aged, or its file was made for another one.",
     "Measure the capacity with one full slow discharge and put it into the cell file."},
    {"coulombic_loss", "a coulombic loss", "part of the charge put in does not come back",
     "grows with the charge put in, not with time", "Side reactions take part of the charging current.",
     "Give the charge count a coulombic efficiency; look at charging voltage and temperature if it is more than 1 %."},
    {"leakage", "a leakage", "the cell loses charge by itself",
     "empties the cell with time, so that it is lower after a rest with nothing connected",
     "A current inside the cell or beside the sensor empties it all the time.",
     "Look for loads that bypass the sensor and for balancing resistors that stay on; if there are none, watch the "
     "cell for an internal short."},
    {"slow_polarisation", "a slow polarisation", "the voltage goes on relaxing for long",
     "builds up under load and fades in every rest, with the time and not with the charge",
     "Diffusion in the cell: the voltage needs minutes to hours to settle, one RC element is too few.",
     "Use the extended cell file: its second, slow element follows the relaxation."},
    {"fast_polarisation", "a fast polarisation", "the voltage bends in the first seconds after an edge",
     "builds up and fades within seconds of every edge of the current",
     "Between the ohmic step and the cell file's polarisation lies a faster one.",
     "Use the extended cell file; for its R0 alone the sampling rate decides what is counted in."},
    {"ocv_hysteresis", "a hysteresis of the OCV", "the open-circuit voltage remembers the direction of the last charge",
     "turns with the direction of the charge moved and stays through every rest, however long",
     "After charging the cell rests higher than after discharging at the same state of charge, as LiFePO4 does.",
     "Use the extended cell file: with one curve for both directions every estimate from a rest voltage is off."},
    {"self_heating", "self-heating", "the cell is warmer inside than its sensor says",
     "lowers the resistance minutes after the load rises, and lets it come back minutes after",
     "Losses warm the core; its resistance is that of a warmer cell.",
     "Use the extended cell file, or move the temperature sensor nearer to the core."},
    {"resistance_growth", "a change of the ohmic resistance", "the ohmic resistance is another than the file's",
     "shows at every edge of the current, at once and in proportion to it",
     "Ageing, another contact resistance, or a cell file of another cell.",
     "Check the contacts first; if they are good the cell has aged: identify R0 anew."},
    {"polarisation_growth", "a change of the polarisation", "the polarisation is larger or slower than the file's",
     "builds up with the cell file's own time constant after every edge",
     "Ageing, or a cell file of another cell or temperature.", "Identify R1 and C1 anew from pulses with rests."},
    {"direction_asymmetry", "a resistance that differs between charge and discharge",
     "charging and discharging meet different resistances",
     "is in proportion to the current, with another factor when charging",
     "The electrodes take lithium in and give it back at different cost.",
     "Use the extended cell file, which has a factor for charging."},
    {"temperature_resistance", "a resistance that follows the temperature", "the resistance follows the temperature",
     "changes the voltage drop with the temperature that is measured, at any load",
     "A cold cell resists more; the cell file knows one temperature only.",
     "Use the extended cell file, or identify at the temperatures that occur."},
    {"charge_transfer", "a charge transfer that bends with the current", "the resistance falls as the current rises",
     "makes large currents cost less than in proportion, at once",
     "The reaction at the electrodes (Butler-Volmer) is not proportional, most of all in the cold.",
     "Use the extended cell file where currents of several sizes occur."},
    {"contact_step", "a contact that has become worse", "a contact has changed at a moment",
     "begins at one moment and is in proportion to the current from then on",
     "A terminal, a fuse or a connector has loosened or corroded.",
     "Check and tighten the connections of this cell before it gets hot."},
    {"contact_intermittent", "an intermittent contact", "a contact opens now and then",
     "comes in bursts, in proportion to the current, and leaves no trace between them",
     "A loose contact: the resistance jumps for moments, often with vibration.",
     "Find and fasten the loose connection; what was measured in the bursts is no property of the cell."},
    {"ocv_shape", "an OCV curve that has slid", "the steps of the OCV lie at another state of charge",
     "moves the steps of the OCV curve along the state of charge and leaves its ends",
     "The electrodes have slipped against each other: loss of lithium or of active material.",
     "Take a new slow OCV curve; the capacity should be measured with it."},
    {"entropic_ocv", "an OCV that follows the temperature", "the open-circuit voltage follows the temperature",
     "follows the temperature with no current flowing, by an amount that depends on the state of charge",
     "The entropy of the reaction: a few tenths of a millivolt per kelvin.",
     "Use the extended cell file where temperatures change by more than 10 K."},
    {"voltage_offset", "an offset of the voltage sensor", "the voltage sensor's zero is off",
     "is the same at every load, in both directions and at rest",
     "The voltage channel reads a constant too much or too little.",
     "Calibrate the voltage channel; look at the sense wires."},
    {"voltage_gain", "a gain error of the voltage sensor", "the voltage sensor's scale is off",
     "is the same part of the voltage at every load", "The divider or the reference of the voltage channel is off.",
     "Calibrate the voltage channel at two voltages."},
}};

constexpr bool in_order() {
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    if (vocabulary[m].id != catalogue[m].id) return false;
  }
  return true;
}
static_assert(in_order(), "one entry for every mechanism, in the catalogue's order");

struct Scaled {
  double factor;
  std::string_view unit;
};

/// The unit in which a number of this size is said.
Scaled scaled(double size, std::string_view unit) {
  if (unit == "V") return size < 1 ? Scaled{1e3, " mV"} : Scaled{1, " V"};
  if (unit == "ohm") return size < 1 ? Scaled{1e3, " mOhm"} : Scaled{1, " Ohm"};
  if (unit == "A") return size < 1 ? Scaled{1e3, " mA"} : Scaled{1, " A"};
  if (unit == "V/K") return {1e3, " mV/K"};
  if (unit == "J/mol") return {1e-3, " kJ/mol"};
  if (unit == "%") return {100, " %"};
  if (unit == "s")
    return size < 1        ? Scaled{1e3, " ms"}
           : size < 300    ? Scaled{1, " s"}
           : size < 10'000 ? Scaled{1.0 / 60, " min"}
                           : Scaled{1.0 / 3'600, " h"};
  if (unit == "degC") return {1, " degrees C"};
  return {1, unit == "1" ? "" : unit == "K" ? " K" : unit == "K/W" ? " K/W" : ""};
}

/// One digit of the deviation, two where it begins with 1; without one two or three digits of the value.
int decimals(double value, double deviation) {
  const double last = deviation > 0 ? deviation : std::abs(value) / 30;
  if (!(last > 0) || !std::isfinite(last)) return 0;
  const double power = std::floor(std::log10(last));
  const bool begins_with_1 = last < 1.95 * std::pow(10, power);
  return std::clamp(static_cast<int>(-power) + (begins_with_1 && deviation > 0 ? 1 : 0), 0, 6);
}

std::string strength(const MechanismSetting& s, std::size_t k, std::string_view unit = "") {
  const model::Parameter& p = catalogue[s.index].parameter[k];
  return quantity(std::abs(s.value[k]), s.deviation[k], unit.empty() ? p.unit : unit);
}

/// The digits of a parameter's name: the place that it speaks of.
std::string number_in(std::string_view name) {
  std::string digits;
  for (const char c : name) {
    if (c >= '0' && c <= '9') digits += c;
  }
  return digits;
}

std::string capital(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

std::string millivolts(double v) { return fmt::format("{:.{}f} mV", 1e3 * v, std::abs(v) < 1e-3 ? 2 : 1); }

std::string share_of_error(const Finding& f, const RecordingFacts& o) {
  if (o.error_v > 0 && f.rms_contribution_v <= o.error_v)
    return fmt::format("{:.1f} mV of the {} error", 1e3 * f.rms_contribution_v, millivolts(o.error_v));
  return millivolts(f.rms_contribution_v);
}

std::string range(const Regime& g) {
  if (g.axis == "soc") return fmt::format("at {:.0f} to {:.0f} % state of charge", 100 * g.from, 100 * g.to);
  if (g.axis == "current_c") return fmt::format("at currents of {:.2g} to {:.2g} C", g.from, g.to);
  if (g.axis == "temperature_c") return fmt::format("at {:.0f} to {:.0f} degrees C", g.from, g.to);
  if (g.axis == "since_edge_s")
    return fmt::format("{} to {} after a step of the current", duration_text(g.from), duration_text(g.to));
  return fmt::format("at {} {:.2g} to {:.2g}", g.axis, g.from, g.to);
}

/// Where a mismatch lies: its regime and its time, if it has any.
std::string place(const Diagnosis& d) {
  std::string text = d.regimes.empty() ? "" : range(d.regimes.front());
  if (!d.spans.empty() && d.spans.size() <= 3) {
    const model::Span widest = *std::max_element(d.spans.begin(), d.spans.end(), [](const auto& a, const auto& b) {
      return a.end_s - a.start_s < b.end_s - b.start_s;
    });
    text += fmt::format("{}between {} and {}", text.empty() ? "" : ", ", duration_text(widest.start_s),
                        duration_text(widest.end_s));
  }
  return text;
}

/// Limits that a technician can weigh, the sharpest of their range first.
std::string telling_limits(const Diagnosis& d, const RecordingFacts& o) {
  static const std::set<std::string_view> told = {
      "ocv_hysteresis", "resistance_growth", "current_offset",    "current_gain",
      "voltage_offset", "capacity_change",   "slow_polarisation", "leakage"};
  std::vector<std::pair<double, const DetectionLimit*>> order;
  for (const DetectionLimit& l : d.limits) {
    const model::MechanismInfo& info = catalogue[l.mechanism];
    if (told.contains(info.id)) order.emplace_back(l.value / info.parameter[l.parameter].upper(o.capacity_ah), &l);
  }
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::string> parts;
  for (const auto& [ratio, l] : order) {
    if (parts.size() == 3) break;
    const model::Parameter& p = catalogue[l->mechanism].parameter[l->parameter];
    parts.push_back(fmt::format("{} of {}", text_of_mechanism(l->mechanism).name, parameter_text(p, l->value, 0)));
  }
  return joined(parts, "or");
}

/// The best candidate that does without this finding's mechanism, everything else being there.
const Ranked* rival_of(const Diagnosis& d, const Finding& f, std::size_t& instead) {
  std::vector<std::size_t> others;
  for (const Finding& g : d.findings) {
    if (g.setting.index != f.setting.index) others.push_back(g.setting.index);
  }
  for (const Ranked& r : d.candidates) {
    if (std::find(r.ids.begin(), r.ids.end(), f.setting.index) != r.ids.end() || r.ids.size() != others.size() + 1)
      continue;
    const auto extra = std::find_if(r.ids.begin(), r.ids.end(), [&](std::size_t m) {
      return std::find(others.begin(), others.end(), m) == others.end();
    });
    if (extra == r.ids.end()) continue;
    instead = *extra;
    return &r;
  }
  return nullptr;
}

/// What in these recordings bears on telling two mechanisms apart.
std::string seen_in(std::size_t a, std::size_t b, const RecordingFacts& o) {
  const auto either = [&](std::initializer_list<std::string_view> ids) {
    return std::any_of(ids.begin(), ids.end(),
                       [&](std::string_view id) { return catalogue[a].id == id || catalogue[b].id == id; });
  };
  std::vector<std::string> parts;
  const auto times = [](std::size_t n) {
    return n == 1 ? std::string("once") : n == 2 ? std::string("twice") : fmt::format("{} times", n);
  };
  if (either({"ocv_hysteresis", "voltage_offset", "voltage_gain", "direction_asymmetry", "coulombic_loss"}))
    parts.push_back(o.reversals > 0 ? fmt::format("the charge turns {}", times(o.reversals))
                                    : "the charge never turns");
  if (either({"ocv_hysteresis", "slow_polarisation", "current_offset", "leakage"}))
    parts.push_back(o.longest_rest_s >= 60 ? fmt::format("the longest rest is {}", duration_text(o.longest_rest_s))
                                           : "there is no rest");
  if (either({"temperature_resistance", "self_heating", "entropic_ocv", "temperature_sensor"}))
    parts.push_back(o.temperature_span_k > 0 ? fmt::format("the temperature spans {:.1f} K", o.temperature_span_k)
                                             : "the temperature does not change");
  if (either({"charge_transfer", "current_clipping"}))
    parts.push_back(fmt::format("there are currents of {} sizes", o.rates));
  if (either({"capacity_change", "ocv_shape", "initial_soc"}))
    parts.push_back(fmt::format("the state of charge spans {:.0f} %", 100 * o.soc_span));
  return parts.empty() ? "" : " Here " + joined(parts, "and") + ".";
}

}  // namespace

std::string joined(const std::vector<std::string>& parts, const char* last) {
  std::string text;
  for (std::size_t k = 0; k < parts.size(); ++k)
    text += (k == 0 ? "" : k + 1 == parts.size() ? std::string(" ") + last + " " : std::string(", ")) + parts[k];
  return text;
}

const MechanismText& text_of_mechanism(std::size_t mechanism) { return vocabulary[mechanism]; }

std::string quantity(double value, double deviation, std::string_view unit) {
  const Scaled s = scaled(std::abs(value), unit);
  const double e = deviation * s.factor;
  const int digits = decimals(value * s.factor, e);
  const double v = std::abs(value * s.factor) < 0.5 * std::pow(10, -digits) ? 0 : value * s.factor;  // no "-0.0"
  if (!(deviation > 0) || !std::isfinite(deviation)) return fmt::format("{:.{}f}{}", v, digits, s.unit);
  return fmt::format("{:.{}f} +- {:.{}f}{}", v, digits, e, digits, s.unit);
}

std::string parameter_text(const model::Parameter& p, double value, double deviation) {
  const bool part = p.unit == "1" && (p.role == model::Role::strength || p.name.ends_with("share") ||
                                      p.name.ends_with("fraction") || p.name == "knee");
  return quantity(value, deviation, part ? "%" : p.unit);
}

std::string duration_text(double seconds) {
  const auto s = static_cast<long long>(std::llround(seconds));
  if (s >= 3'600) return fmt::format("{}:{:02} h", s / 3'600, s / 60 % 60);
  if (s >= 60)
    return s % 60 == 0 || s >= 600 ? fmt::format("{} min", (s + 30) / 60) : fmt::format("{}:{:02} min", s / 60, s % 60);
  return fmt::format("{} s", s);
}

std::string claim(const MechanismSetting& s) {
  const std::string_view id = catalogue[s.index].id;
  const bool positive = s.value[0] >= 0;
  const char *much = positive ? "much" : "little", *more = positive ? "more" : "less";
  if (id == "channel_skew")
    return fmt::format("the current is read {} {} than the voltage", strength(s, 0), positive ? "later" : "earlier");
  if (id == "current_offset")
    return fmt::format("the current sensor reads {} too {}", strength(s, 0), positive ? "high" : "low");
  if (id == "current_gain") return fmt::format("the current sensor reads {} too {}", strength(s, 0, "%"), much);
  if (id == "current_clipping")
    return fmt::format("the current sensor ends at {}, and {} more flows there on average",
                       quantity(s.value[1], 0, "A"), strength(s, 0));
  if (id == "temperature_sensor") {
    return std::abs(s.value[1]) > 2 * s.deviation[1] && s.value[1] > 30
               ? fmt::format("the temperature sensor lags by {} and reads {} too {}", strength(s, 1), strength(s, 0),
                             positive ? "high" : "low")
               : fmt::format("the temperature sensor reads {} too {}", strength(s, 0), positive ? "high" : "low");
  }
  if (id == "initial_soc")
    return fmt::format("the recording began {} of charge {} than was believed", strength(s, 0, "%"),
                       positive ? "higher" : "lower");
  if (id == "capacity_change")
    return fmt::format("the cell holds {} {} charge than its file says", strength(s, 0, "%"),
                       positive ? "less" : "more");
  if (id == "coulombic_loss")
    return positive ? fmt::format("{} of the charge put in does not come back", strength(s, 0, "%"))
                    : fmt::format("{} more charge comes back than was put in", strength(s, 0, "%"));
  if (id == "leakage")
    return fmt::format("the cell {} {} all the time that no sensor sees", positive ? "loses" : "gains", strength(s, 0));
  if (id == "slow_polarisation")
    return fmt::format("the voltage goes on relaxing long after the load, by {} in {}", strength(s, 0), strength(s, 1));
  if (id == "fast_polarisation")
    return fmt::format("the voltage bends in the first seconds after every step of the current, by {} in {}",
                       strength(s, 0), strength(s, 1));
  if (id == "ocv_hysteresis")
    return fmt::format(
        "the open-circuit voltage depends on whether the cell was charged or discharged last, by {} to either side",
        strength(s, 0));
  if (id == "self_heating")
    return fmt::format("the cell is warmer inside than its sensor says, by {} of loss", strength(s, 0));
  if (id == "resistance_growth")
    return fmt::format("the ohmic resistance is {} {} than in the cell file", strength(s, 0, "%"), more);
  if (id == "polarisation_growth") {
    return fmt::format("the polarisation is {} {} and its capacitance {} {} than in the cell file", strength(s, 0, "%"),
                       more, strength(s, 1, "%"), s.value[1] >= 0 ? "more" : "less");
  }
  if (id == "direction_asymmetry")
    return fmt::format("charging meets {} {} resistance than discharging", strength(s, 0, "%"), more);
  if (id == "temperature_resistance") {
    return fmt::format("the resistance follows the temperature, R0 with {} and R1 with {}",
                       quantity(s.value[0], s.deviation[0], "J/mol"), quantity(s.value[1], s.deviation[1], "J/mol"));
  }
  if (id == "charge_transfer")
    return fmt::format("{} of R0 and {} of R1 give way as the current passes {}", strength(s, 0, "%"),
                       strength(s, 1, "%"), quantity(2 * s.value[2], 2 * s.deviation[2], "A"));
  if (id == "contact_step")
    return fmt::format("a contact has {} resistance since {}, by {}", more, duration_text(s.value[1]), strength(s, 0));
  if (id == "contact_intermittent")
    return fmt::format("a contact opens in bursts, {} of the time and by {}", quantity(s.value[1], 0, "%"),
                       strength(s, 0));
  if (id == "ocv_shape") {
    return fmt::format("the OCV curve has slid along the state of charge, by {} at {} % and {} at {} %",
                       quantity(s.value[0], s.deviation[0], "%"), number_in(catalogue[s.index].parameter[0].name),
                       quantity(s.value[1], s.deviation[1], "%"), number_in(catalogue[s.index].parameter[1].name));
  }
  if (id == "entropic_ocv") {
    std::size_t k = 0;
    for (std::size_t j = 1; j < 4; ++j) {
      if (std::abs(s.value[j]) > std::abs(s.value[k])) k = j;
    }
    return fmt::format("the open-circuit voltage follows the temperature, {} at {} % state of charge",
                       quantity(s.value[k], s.deviation[k], "V/K"), number_in(catalogue[s.index].parameter[k].name));
  }
  if (id == "voltage_offset")
    return fmt::format("the voltage sensor reads {} too {}", strength(s, 0), positive ? "high" : "low");
  if (id == "voltage_gain") return fmt::format("the voltage sensor reads {} too {}", strength(s, 0, "%"), much);
  return std::string(text_of_mechanism(s.index).brief);
}

RecordingFacts recording_facts(const model::CellParameters<>& cell, const std::vector<PreparedRecording>& records,
                               const std::vector<RecordingView>& views) {
  RecordingFacts o;
  o.capacity_ah = cell.capacity_ah;
  double squares = 0, low_soc = 1e9, high_soc = -1e9, low_c = 1e9, high_c = -1e9;
  std::size_t count = 0;
  std::set<int> rates;
  for (std::size_t n = 0; n < records.size(); ++n) {
    const PreparedRecording& r = records[n];
    for (std::size_t k = 0; n < views.size() && k < views[n].base_v.size(); ++k) {
      const double e = r.voltage_v[k] - views[n].base_v[k];
      if (std::isfinite(e)) squares += e * e, ++count;
    }
    double soc = r.initial_soc, known_a = 0, rested_s = 0, turn = soc;
    int heading = 0;
    for (std::size_t k = 0; k < r.size(); ++k) {
      const double dt_s = k == 0 ? 0 : r.time_s[k] - r.time_s[k - 1];
      if (std::isfinite(r.current_a[k])) known_a = r.current_a[k];
      soc += known_a * dt_s / (3'600 * cell.capacity_ah);
      low_soc = std::min(low_soc, soc);
      high_soc = std::max(high_soc, soc);
      const double c_rate = std::abs(known_a) / cell.capacity_ah;
      rested_s = c_rate < 0.02 ? rested_s + dt_s : 0;
      o.longest_rest_s = std::max(o.longest_rest_s, rested_s);
      if (c_rate > 0.05) rates.insert(static_cast<int>(std::lround(std::log(c_rate) / std::log(1.33))));
      // the charge turns where it has gone back by 1 %
      if (heading > 0) turn = std::max(turn, soc);
      if (heading < 0) turn = std::min(turn, soc);
      if (heading == 0 && std::abs(soc - r.initial_soc) > 0.01)
        heading = soc > r.initial_soc ? 1 : -1, turn = soc;
      else if (heading != 0 && (turn - soc) * heading > 0.01)
        heading = -heading, turn = soc, ++o.reversals;
      if (!r.temperature_c.empty() && std::isfinite(r.temperature_c[k]))
        low_c = std::min(low_c, r.temperature_c[k]), high_c = std::max(high_c, r.temperature_c[k]);
    }
  }
  o.error_v = count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0;
  o.rates = rates.size();
  o.temperature_span_k = high_c > low_c ? high_c - low_c : 0;
  o.soc_span = high_soc > low_soc ? high_soc - low_soc : 0;
  return o;
}

std::string statement(const Diagnosis& d, const RecordingFacts& o) {
  switch (d.verdict) {
    case Verdict::no_mismatch: {
      const std::string limits = telling_limits(d, o);
      return fmt::format("The cell file reproduces the recording to {}, as well as its tolerance promises{}.",
                         millivolts(o.error_v), limits.empty() ? "" : "; it would have shown " + limits);
    }
    case Verdict::cause:
      return capital(claim(d.findings.front().setting)) + " (" + share_of_error(d.findings.front(), o) + ").";
    case Verdict::ambiguous: {
      const Finding& f = d.findings.front();
      std::vector<std::string> parts = {claim(f.setting)};
      for (const std::size_t m : f.equivalent_to) parts.emplace_back(text_of_mechanism(m).brief);
      return fmt::format("Either {}; this recording cannot tell ({}).", joined(parts, "or"), share_of_error(f, o));
    }
    case Verdict::causes: {
      // two in full, the others by name: a sentence must end
      constexpr std::array<std::string_view, 7> count = {"No cause",    "One cause",   "Two causes", "Three causes",
                                                         "Four causes", "Five causes", "Six causes"};
      std::vector<std::string> parts;
      for (const Finding& f : d.findings) {
        std::string part = fmt::format(
            "{} ({}", parts.size() < 2 ? claim(f.setting) : std::string(text_of_mechanism(f.setting.index).name),
            millivolts(f.rms_contribution_v));
        std::vector<std::string> rivals;
        for (const std::size_t m : f.equivalent_to) rivals.emplace_back(text_of_mechanism(m).brief);
        part += rivals.empty() ? ")" : ", or " + joined(rivals, "or") + ")";
        parts.push_back(std::move(part));
      }
      return fmt::format("{} at once in an error of {}: {}.", count[std::min(parts.size(), count.size() - 1)],
                         millivolts(o.error_v), joined(parts, "and"));
    }
    case Verdict::unknown: {
      const std::string where = place(d);
      std::string text =
          fmt::format("Something that the catalogue does not have parts the recording from the cell file, by {}{}",
                      millivolts(o.error_v), where.empty() ? "" : ", most of it " + where);
      if (!d.candidates.empty() && d.candidates.front().ids.size() == 1 &&
          d.candidates.front().explained_share >= 0.2) {
        text += fmt::format("; {} comes nearest and explains {:.0f} % of it",
                            text_of_mechanism(d.candidates.front().ids.front()).name,
                            100 * d.candidates.front().explained_share);
      }
      return text + ".";
    }
    case Verdict::data_fault:
      return d.faults.empty() ? "The recording cannot be right." : d.faults.front().text;
    case Verdict::not_testable:
      return "Nothing can be said about this recording.";
  }
  return "";
}

std::string because(const Diagnosis& d, const Finding& f, const RecordingFacts& o) {
  const MechanismText& own = text_of_mechanism(f.setting.index);
  std::size_t instead = f.setting.index;
  if (!f.equivalent_to.empty()) {
    const std::size_t other = f.equivalent_to.front();
    return fmt::format("{} {}; {} {}.{} That is not enough to tell them apart.", capital(std::string(own.name)),
                       own.mark, text_of_mechanism(other).name, text_of_mechanism(other).mark,
                       seen_in(f.setting.index, other, o));
  }
  const Ranked* rival = rival_of(d, f, instead);
  if (rival == nullptr)
    return fmt::format(
        "{} {}. No other mechanism of the catalogue comes near it: without it the fit is worse by {:.0f} ({:.0f} is "
        "what chance does not reach).",
        capital(std::string(own.name)), own.mark, f.gain, decision::detected);
  const MechanismText& other = text_of_mechanism(instead);
  double best = rival->gain, explained = 0;
  for (const Ranked& r : d.candidates) {
    if (r.ids.size() != d.findings.size()) continue;
    const bool all = std::all_of(d.findings.begin(), d.findings.end(), [&](const Finding& g) {
      return std::find(r.ids.begin(), r.ids.end(), g.setting.index) != r.ids.end();
    });
    if (all) best = std::max(best, r.gain), explained = r.explained_share;
  }
  return fmt::format(
      "{} {}; {} {}.{} The data side with the first by a gain of {:.0f} ({:.0f} or less would be a tie) and it "
      "explains {:.0f} % of the mismatch, the other {:.0f} %.",
      capital(std::string(own.name)), own.mark, other.name, other.mark, seen_in(f.setting.index, instead, o),
      best - rival->gain, decision::same, 100 * explained, 100 * rival->explained_share);
}

void describe(Diagnosis& d, const model::CellParameters<>& cell, const std::vector<PreparedRecording>& records) {
  const RecordingFacts o = recording_facts(cell, records, d.views);
  if (d.statement.empty()) d.statement = statement(d, o);
  for (Finding& f : d.findings) {
    if (f.because.empty()) f.because = because(d, f, o);
  }
}

}  // namespace bms::diagnosis
