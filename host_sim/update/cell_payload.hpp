// Cell constants for an update, from cell files (firmware/cell_update/format.hpp).
#pragma once

#include <vector>

#include "files/cell_file.hpp"
#include "update/container_file.hpp"

namespace bms::update {

/// The payloads of `cell` for both slots, for applications that were built with `built`. Throws BadInput if such an
/// application would refuse them: other limits, another capacity, another model.
std::vector<Payload> cell_payloads(const files::CellFile& cell, const files::CellFile& built);

}  // namespace bms::update
