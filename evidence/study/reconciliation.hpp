// Which published table cannot be reconciled with a simulated cell: its differences in units of those expected between
// two such experiments, with the table in the fit, and predicted from all other tables.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "study/paper_figures.hpp"

namespace bms::study {

struct TableMisfit {
  std::string table;
  double used = 0;                 ///< RMS of the differences over the expected one
  std::optional<double> left_out;  ///< missing: not predicted
  double limit = 0;                ///< exceeded in 1 % of such experiments, by the number of independent figures
  std::string worst_figure;        ///< with the table in the fit
  double worst = 0;                ///< its difference over the expected one; differences are limited

  bool contradicts() const { return used > limit; }
  bool predicted() const { return !left_out || *left_out <= limit; }
  const char* verdict() const;
};

/// left_out: by table, the figures simulated after a fit without it; empty, or an empty entry: not predicted.
std::vector<TableMisfit> table_misfits(const std::vector<Figure>& simulated,
                                       const std::vector<std::vector<Figure>>& left_out,
                                       const std::vector<Figure>& published);

/// One or two sentences for the reader.
std::string reconciliation_text(const std::vector<TableMisfit>& misfits);

}  // namespace bms::study
