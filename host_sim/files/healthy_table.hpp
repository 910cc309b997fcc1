// The table [healthy] of a cell file: what healthy recordings of the cell leave unexplained.
#pragma once

#include <string>

#include "files/toml_table.hpp"
#include "healthy_data/healthy_data.hpp"

namespace bms::files {

/// Throws BadInput. `source` must have been read.
healthy_data::HealthyData read_healthy(TomlTable& healthy);

/// Empty if no healthy recordings were given.
std::string healthy_text(const healthy_data::HealthyData& healthy, const std::string& source);

}  // namespace bms::files
