// A slow polarisation. Slow modes and the lag of the surface trade against each other, so fits begin at four places.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/constant_current.hpp"
#include "diagnosis/mechanisms/needs_current.hpp"
#include "model/mechanisms/slow_polarisation.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::SlowPolarisation> : DefaultKnowledge<model::SlowPolarisation> {
  static constexpr MechanismText text = {
      .id = model::SlowPolarisation::id,
      .name = "a slow polarisation",
      .brief = "the voltage keeps relaxing for a long time",
      .mark = "builds up under load and decays in every rest, with time and not with charge",
      .meaning = "Diffusion in the cell: the voltage needs minutes to hours to settle, and one RC element is too few.",
      .action = "Use the extended cell file: its second, slow element follows the relaxation."};
  static constexpr bool report_limit = true;
  static constexpr Fact facts = Fact::rests;
  static constexpr bool needs_first_strength = true;
  static constexpr std::size_t time_constant = 1, faster_share = 2;  ///< places of the parameters
  static constexpr double times_rc = 2;           ///< time constant over R1 C1, at least: what is as fast is R1 C1,
  static constexpr double floor_at_most_s = 600;  ///< [s] but the bound is not raised beyond this
  static constexpr std::array far_tau_s = {200.0, 600.0}, far_lag_s = {120.0, 300.0};  ///< [s]

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the voltage keeps relaxing long after the load, by {} in {}", size_text(s, 0),
                       size_text(s, time_constant));
  }
  static std::vector<double> probing_shapes(double) { return {120, 400, 1'300, 4'500}; }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    const auto reason = needs_current(c);
    return reason ? reason : constant_current::too_short(c);
  }
  static std::vector<std::vector<double>> far_starts(const MechanismSetting& s, const RecordingFacts&) {
    std::vector<std::vector<double>> starts;
    for (const double tau_s : far_tau_s) {
      for (const double lag_s : far_lag_s) starts.push_back({s.value[0], tau_s, s.value[faster_share], lag_s});
    }
    return starts;
  }
  static Bounds bounds(std::size_t parameter, Bounds file, double rc_s) {
    if (parameter != time_constant) return file;
    return {std::clamp(times_rc * rc_s, file.low, floor_at_most_s), file.high};
  }
};

}  // namespace bms::diagnosis
