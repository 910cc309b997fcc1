// The statements of the paper on many cells: the share of runs in which each holds.
#pragma once

#include <cstdint>
#include <vector>

#include "study/statements.hpp"
#include "study/study.hpp"

namespace bms::study {

/// A kind of cell. Each seed draws another cell of it, other currents of the experiments (the paper does not publish
/// them), and other noise.
struct PlantKind {
  const char* name;
  bool hysteresis, slow_polarisation;
};
inline constexpr std::array<PlantKind, 4> plant_kinds = {{{"one RC branch", false, false},
                                                          {"with hysteresis", true, false},
                                                          {"with slow polarisation", false, true},
                                                          {"with both", true, true}}};

/// R0, R1, C1 within 5 % (one sigma), half gap 6 to 20 mV, slow resistance 4 to 16 mohm and time constant 5 to 40 min,
/// HIGH current 0.4 to 1 C, LOW 0.1 to 0.4 of it, noise 1 mV and 10 mA, offset of the current 20 mA (one sigma).
Bench drawn(const PlantKind& kind, std::uint64_t seed);

/// Judges every statement on `seeds` cells of each kind and, if there are recordings, on as many pairs of thirds of
/// them. Adds table, shares and the number of identifications.
void add_statistics(const model::CellParameters<>& cell, std::size_t seeds, std::uint64_t first_seed,
                    const std::vector<StudyData>& recordings, StudyResult& result);

/// From which starts each optimiser reaches the best fit, on one cell: a map per model, and the share.
void add_success_maps(const model::CellParameters<>& cell, std::uint64_t seed, StudyResult& result);

}  // namespace bms::study
