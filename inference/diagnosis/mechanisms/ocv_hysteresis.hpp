// A hysteresis of the OCV. Its signature varies the two branch positions as well: times the half gap they are linear.
#pragma once

#include <fmt/format.h>

#include "diagnosis/dual.hpp"
#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/ocv_hysteresis.hpp"
#include "model/start.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::OcvHysteresis> : DefaultKnowledge<model::OcvHysteresis> {
  static constexpr MechanismText text = {
      .id = model::OcvHysteresis::id,
      .name = "a hysteresis of the OCV",
      .brief = "the open-circuit voltage remembers the direction of the last charge",
      .mark = "follows the direction of the charge moved and stays through every rest, however long",
      .meaning =
          "After charging the cell rests higher than after discharging at the same state of charge, as LiFePO4 does.",
      .action =
          "Use the extended cell file: with one curve for both directions, every estimate from a rest voltage is off."};
  static constexpr bool probes_places = true;
  static constexpr bool report_limit = true;
  static constexpr Fact facts = Fact::reversals | Fact::rests;
  static constexpr std::size_t half_gap = 0, ocv_at = 2, initial = 3, measured = 4;  ///< places of the parameters
  static constexpr double gap_share = 0.9, gap_sigma = 0.1;  ///< hysteresis over the cell file's gap, which contains a
                                                             ///< slow current's drop: C/30 has a tenth to a fifth
  static constexpr double lfp_gap_v = 0.0215, lfp_gap_sigma_v = 0.00925;  ///< [V] 3 to 40 mV are two sigma
  static constexpr double plateau_v_per_soc = 0.2;  ///< slope of an LFP cell's OCV at half charge, at most
  static constexpr double branch_sigma = 0.1;       ///< of the branch on which the cell file says that its OCV lies
  static constexpr double probing_share = 0.02;     ///< of the largest half gap: small enough to be linear
  static constexpr double smallest_start_v = 0.001, largest_start_v = 0.06;  ///< [V] half gap where a fit begins
  static constexpr double smallest_throughput_soc = 0.03;                    ///< charge moved, over the capacity

  static std::string claim(const MechanismSetting& s) {
    return fmt::format(
        "the open-circuit voltage depends on whether the cell was charged or discharged last, by {} to either side",
        size_text(s, half_gap));
  }
  static std::vector<double> probing_shapes(double) { return {12, 30, 80, 220}; }
  /// Form 0 relaxes exponentially with the charge moved, form 1 moves with it up to a branch (a play). In a drive with
  /// regenerative braking only form 1 stays near the discharge branch. Without it a chain of polarisations took its
  /// place. With it, and with the branch of the cell file's OCV known (ocv.lean), the slow charge of a real cell, which
  /// was not used, is predicted within 8.7 mV (46.5 mV before).
  static constexpr std::size_t forms = 2;
  static void choose_form(MechanismSetting& s, std::size_t form, const model::CellParameters<>&) {
    s.value[measured] = static_cast<double>(form);
  }
  static bool is_plateau(const model::OcvTable<double>& ocv) {
    std::size_t piece = 0;
    while (piece + 1 < ocv.b1_v.size && ocv.soc[piece + 1] <= numerics.middle_soc) ++piece;
    return ocv.b1_v[piece] < plateau_v_per_soc;
  }
  /// The gap of the cell file, or that of most LFP cells for one with a curve of one direction, and the branch on which
  /// its OCV lies.
  static std::optional<Usual> known(std::size_t parameter, const MechanismSetting& s,
                                    const model::CellParameters<>& cell) {
    const double gap_v = model::plateau_half_gap_v(cell.ocv);
    const bool from_one = gap_v <= 0 && cell.ocv.lean != 0;
    if (parameter == half_gap && from_one && is_plateau(cell.ocv)) return Usual{lfp_gap_v, lfp_gap_sigma_v};
    // form 0 has one gap from empty to full, which is not that of the plateau
    if (s.value[measured] < 1) return std::nullopt;
    if (parameter == half_gap && gap_v > 0) return Usual{gap_share * gap_v, gap_sigma * gap_v};
    if (parameter == ocv_at && (gap_v > 0 || cell.ocv.lean != 0)) return Usual{cell.ocv.lean, branch_sigma};
    return std::nullopt;
  }
  static void adjust_probe(MechanismSetting& probe, const RecordingFacts& seen) {
    probe.value[half_gap] = probing_share * model::OcvHysteresis::parameters[half_gap].upper(seen.capacity_ah);
  }
  /// The signature's strengths are the half gap and its products with the positions.
  static MechanismSetting start(const SignatureFit& s) {
    MechanismSetting start = s.probe;
    const double probed_v = s.probe.value[half_gap],
                 here_v = std::clamp(s.found[0] + probed_v, smallest_start_v, largest_start_v);
    start.value[half_gap] = here_v;
    start.value[ocv_at] = std::clamp(s.found[1] * probed_v / here_v, -1.0, 1.0);
    start.value[initial] = std::clamp(s.found[2] * probed_v / here_v, -1.0, 1.0);
    return start;
  }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    if (c.facts.throughput_soc < smallest_throughput_soc) return "too little charge is moved";
    return std::nullopt;
  }
  /// A cell file with the gap between charge and discharge, or with one of both curves, says that there is a
  /// hysteresis.
  static bool expected(const model::CellParameters<>& cell, const RecordingFacts&) {
    return cell.ocv.half_gap_v.size > 0 || cell.ocv.lean != 0;
  }
  /// The branch position at the start belongs to the recording. With that of another recording the error of a healthy
  /// one was ten times as large.
  static bool carry_over(MechanismSetting& s) {
    s.value[initial] = s.deviation[initial] = 0;
    return true;
  }
  static void after_full_charge(MechanismSetting& s) { s.value[initial] = 1; }
  /// A finding's `initial` is the first recording's; each other recording has a start of its own (model/start.hpp),
  /// which the calibration moves where the state of charge does not decide it.
  template <class S>
  static void set_up(SimulationSetup<S>& setup, const model::MechanismValues<S>& with) {
    model::MechanismValues<S> value = with;
    if (setup.own || setup.record > 0) {
      const model::StartPosition at = model::start_position(setup.own ? number(value[initial]) : 0, setup.start_soc);
      S start(at.position);
      if (!at.known) start += setup.branch_shift;
      if (number(start) > 1) start = S(1);
      if (number(start) < -1) start = S(-1);
      value[initial] = start;
    }
    setup.template choose<model::OcvHysteresis>(value);
  }
};

}  // namespace bms::diagnosis
