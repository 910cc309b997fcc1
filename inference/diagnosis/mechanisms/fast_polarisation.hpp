// A fast polarisation: needs samples that are as fast.
#pragma once

#include <fmt/format.h>

#include "diagnosis/mechanism.hpp"
#include "model/mechanisms/fast_polarisation.hpp"

namespace bms::diagnosis {

template <>
struct Knowledge<model::FastPolarisation> : DefaultKnowledge<model::FastPolarisation> {
  static constexpr MechanismText text = {
      .id = model::FastPolarisation::id,
      .name = "a fast polarisation",
      .brief = "the voltage bends in the first seconds after an edge",
      .mark = "builds up and decays within seconds of every edge of the current",
      .meaning = "There is a faster polarisation between the ohmic step and the cell file's RC element.",
      .action =
          "Use the extended cell file. With R0 alone, the sampling rate decides how much of it is counted as R0."};
  static constexpr std::size_t time_constant = 1;  ///< place of the parameter
  static constexpr double slowest_step_s = 3;      ///< [s] between rows
  static constexpr double rc_times = 3;  ///< R1 C1 over the time constant, at least: what is as slow is R1 C1,
  static constexpr double ceiling_at_least_s = 1;  ///< [s] but the bound is not lowered below this

  static std::string claim(const MechanismSetting& s) {
    return fmt::format("the voltage bends in the first seconds after every step of the current, by {} in {}",
                       size_text(s, 0), size_text(s, time_constant));
  }
  static std::vector<double> probing_shapes(double) { return {0.5, 1.5, 4, 12}; }
  static std::optional<std::string> not_testable(const TestConditions& c) {
    if (c.facts.step_s > slowest_step_s) return fmt::format("a sample every {:g} s is too slow", c.facts.step_s);
    return std::nullopt;
  }
  static Bounds bounds(std::size_t parameter, Bounds file, double rc_s) {
    if (parameter != time_constant) return file;
    return {file.low, std::clamp(rc_s / rc_times, ceiling_at_least_s, file.high)};
  }
};

}  // namespace bms::diagnosis
