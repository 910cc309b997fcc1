// A fault monitor without faults, whose quantities a test sets; an oracle checks every step.
#pragma once

#include <cstdint>
#include <iterator>
#include <vector>

#include <gtest/gtest.h>

#include "tests/firmware/protection/oracle.hpp"
#include "tests/firmware/protection/protection_bench.hpp"
#include "tests/firmware/protection/simulated_truck.hpp"

namespace bms::protection {

/// A fault monitor in which the quantity of every row has a good value.
class FaultRig {
 public:
  FaultRig() {
    for (const ExpectedRow& e : expected_rows) set(e, levels(e).good);
    // Quantities that several rows share: a value that is good for all of them.
    at(values, Quantity::highest_cell_uv) = 3'300'000;
    at(values, Quantity::lowest_cell_uv) = 3'300'000;
    at(values, Quantity::pack_uv) = 52'800'000;
    at(values, Quantity::highest_cdegc) = at(values, Quantity::lowest_cdegc) = 2'500;
  }
  static Quantity of(const ExpectedRow& e) {
    return forklift_plan.rules[static_cast<std::size_t>(&e - expected_rows)].quantity;
  }
  void set(const ExpectedRow& e, std::int32_t value) { at(values, of(e)) = value; }

  /// One sample. Compares the active faults with the oracle of every row.
  FaultSet step(Clear clear = Clear::none, bool may_serve = false) {
    time_us += step_us;
    const bool pressed = clear != Clear::none && before_ == Clear::none;
    before_ = clear;
    monitor.update(values, step_us, time_us, clear, may_serve);
    for (std::size_t k = 0; k < fault_count; ++k) {
      const std::int32_t value = at(values, of(expected_rows[k]));
      const bool ends =
          pressed && (expected_rows[k].recovery == 'c' ||
                      (expected_rows[k].recovery == 's' && clear == Clear::service && has(latched, k) && may_serve));
      const bool there = oracle_[k].check(value == measurement::no_reading ? Value() : Value(value), step_ms, ends);
      if (there != has(monitor.active(), k)) {
        ADD_FAILURE() << expected_rows[k].name << (there ? " missed" : " false") << " at " << time_us << " us with "
                      << value;
        wrong = true;
      }
    }
    return monitor.active();
  }
  void run(int ms, Clear clear = Clear::none) {
    for (int t = 0; t < ms && !wrong; t += step_ms) step(clear);
  }

  Quantities values = unknown_quantities();
  FaultSet latched = 0;
  FaultMonitor monitor{forklift_plan.rules, 0};
  std::uint64_t time_us = 0;
  bool wrong = false;

 private:
  std::vector<RowOracle> oracle_{std::begin(expected_rows), std::end(expected_rows)};
  Clear before_ = Clear::none;
};

/// Numbers of the rows for which `is` returns true.
template <class Is>
std::vector<std::size_t> rows(const Is& is) {
  std::vector<std::size_t> all;
  for (std::size_t k = 0; k < fault_count; ++k) {
    if (is(k)) all.push_back(k);
  }
  return all;
}
inline const auto signal_name = [](const auto& row) { return std::string(expected_rows[row.param].signal); };

}  // namespace bms::protection
