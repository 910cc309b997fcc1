// Cells of the study's tables.
#pragma once

#include <cmath>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "files/page_content.hpp"
#include "study/paper_tables.hpp"

namespace bms::study {

inline files::PageCell label(std::string text) { return {std::move(text), std::nullopt, std::nullopt}; }

inline files::PageCell percent_cell(double value, std::optional<double> paper = std::nullopt) {
  return {fmt::format("{:.2f} %", value), value, paper};
}

inline files::PageCell number_cell(double value, std::optional<double> paper = std::nullopt) {
  return {fmt::format("{:.5g}", value), value, paper};
}

/// value +- standard deviation
inline files::PageCell uncertain_cell(double value, double sigma, std::optional<double> paper = std::nullopt) {
  return {fmt::format("{:.5g} +- {:.2g}", value, sigma), value, paper};
}

inline files::PageCell millivolt_cell(double volts) {
  return {fmt::format("{:.2f} mV", 1e3 * volts), volts, std::nullopt};
}

/// A cell without a number.
inline files::PageCell failed(const std::string& why, std::optional<double> paper = std::nullopt) {
  return {why, std::nullopt, paper};
}

/// The paper's number, if the study is to be compared with the paper.
inline std::optional<double> paper_number(bool compare, int table, std::size_t row, std::size_t column) {
  if (!compare) return std::nullopt;
  const double number = paper_table(table).at(row, column);
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

}  // namespace bms::study
