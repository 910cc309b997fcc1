// The scenarios of the world matrix. Each returns its outcomes and its table for the README of this folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/firmware/world/cases.hpp"
#include "tests/firmware/world/operating.hpp"

namespace bms::world {

struct Result {
  std::string name;   ///< of the table in README.md
  std::string table;  ///< Markdown
  std::vector<Outcome> outcomes;
  unsigned failed() const;
};

struct Extent {
  std::size_t count = 0;  ///< 0: all
  std::uint64_t seed = 1;
  std::string only;        ///< cases whose name contains one of these texts, separated by |; empty: all
  double minutes = 10;     ///< of the shift
  std::size_t days = 30;   ///< of the month
  std::size_t cells = 16;  ///< in series
  unsigned at_once = 2;
  /// Of a cell in the contact failures.
  double capacity_ah = truck_ah;
  bool continues = false;     ///< good outcomes of an earlier run with the same image and seed count
  bool only_kept = false;     ///< runs nothing: the table of the outcomes that are known
  std::size_t from = 0;       ///< leaves so many cases to other parts
  std::size_t most = 0;       ///< runs at most so many cases; 0: any number
  double within_minutes = 0;  ///< starts no case later; 0: at any time
  /// Gives the cases of a scenario their folder and their part.
  void set(Cases& cases, const std::string& scenario, const Pack& pack) const;
  std::string named(const std::string& scenario) const;  ///< of its table, which names another number of cells than 16
  bool has(const std::string& name) const;               ///< `only` selects the case
};

Result run_starts(const Extent& extent);            ///< key on, drive, recuperate, charge, key off, restart
Result run_contact_failures(const Extent& extent);  ///< failures of contactors, resistor, wires
Result run_supply_dips(const Extent& extent);
Result run_fault_matrix(const Extent& extent);
Result run_overloads(const Extent& extent);
Result run_shift(const Extent& extent);
Result run_charges(const Extent& extent);  ///< chargers of both protocols, on images with their profiles
Result run_month(const Extent& extent);    ///< ordinary days: three shifts each, with what a driver does
Result run_groups(const Extent& extent);   ///< two and four batteries at one DC link (BMS_PARALLEL)

}  // namespace bms::world
