// Cell constants for the forklift board, which is built with table9.
#pragma once

#include <string>
#include <vector>

#include "files/cell_file.hpp"
#include "tests/firmware/boot/bench.hpp"
#include "update/cell_payload.hpp"

namespace bms::boot {

/// A model that was improved without another limit.
inline files::CellFile better(double r0_factor = 1.2) {
  files::CellFile cell = files::read_cell("table9");
  for (std::size_t k = 0; k < cell.parameters.rc.r0_ohm.size; ++k) cell.parameters.rc.r0_ohm[k] *= r0_factor;
  for (std::size_t k = 0; k < cell.parameters.rc.c1_f.size; ++k) cell.parameters.rc.c1_f[k] *= 0.9;
  cell.parameters.tolerance.resistance_fraction = 0.04;
  return files::parse_cell(files::cell_text(cell), "better.toml");
}

inline std::vector<update::Container> signed_payloads(std::vector<update::Payload> payloads,
                                                      std::uint32_t security_version = 1) {
  for (update::Payload& p : payloads) {
    std::ranges::copy(std::string("stm32f405_forklift"), p.header.board.begin());
    p.header.version = 0x010000;
    p.header.security_version = security_version;
    p.header.oldest_loader = 0x000200;
  }
  return sign(std::move(payloads), key_of("product"));
}
/// For both slots.
inline std::vector<update::Container> signed_cell(const files::CellFile& cell, std::uint32_t security_version = 1) {
  return signed_payloads(update::cell_payloads(cell, files::read_cell("table9")), security_version);
}

}  // namespace bms::boot
