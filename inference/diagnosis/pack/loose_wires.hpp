// Sense wires with an intermittent contact.
//
// The wire between two cells in series carries the reading of both. While it is bad, one cell reads x too high and its
// neighbour x too low, so that half their difference leaps and their sum does not:
//
//   d = (v_c - v_c+1) / 2        s = (v_c + v_c+1) / 2 - median of the other cells
//
// No cell does that: a resistance, a charge or a late channel changes the sum as well. A balancing current lowers one
// cell twice as much as it raises its neighbours, or moves other cells too. The sum of the leaps says in which rows the
// wire is bad.
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/pack/pack_recording.hpp"
#include "diagnosis/pack/pack_verdict.hpp"

namespace bms::diagnosis::pack {

/// A wire between cells `cell` and `cell` + 1, from 0.
struct LooseWire {
  std::size_t cell = 0;
  std::size_t rows = 0;  ///< in which it is bad
  PackFinding finding;
};

/// Finds them and removes both cells' readings of the bad rows from `pack`. quiet_a: a smaller step of the current
/// shows no resistance.
std::vector<LooseWire> take_loose_wires(PackRecording& pack, double quiet_a);

/// Adds their findings, in place of the readings that are missing because they were removed. rows: of the recording.
void add_loose_wires(const std::vector<LooseWire>& wires, std::size_t rows, std::vector<PackFinding>& findings);

}  // namespace bms::diagnosis::pack
