// DBC files of batteries in the field that are built into the tool (host_sim/files/dbc/).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "files/logs/dbc.hpp"

namespace bms::files {

extern const std::string_view pylontech_dbc;

/// The signals of a DBC file, or of the built-in one of this name ("pylontech"). Throws BadInput.
std::vector<DbcSignal> signals_of(const std::string& name);
/// The columns of a recording that a built-in one fills, as lines of --map; empty for a file. Throws never.
std::vector<std::string> shipped_map_of(const std::string& name);

}  // namespace bms::files
