// What the user says about columns: --map and --unit, each for one column or for a group of them.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "files/logs/units.hpp"

namespace bms::files {

/// Number of a target that means every cell: "v_*", "t_*".
inline constexpr std::size_t every_number = 0;

/// "current_a=I_batt" as target and the rest; "v_*=CP*" is a group. Throws BadInput if it names no column; option is
/// for the message.
std::pair<Target, std::string> assignment(const std::string& text, const std::string& option);

/// Returns true if what is said about `said` holds for `column`: it is the same, or a group that has it.
bool holds_for(const Target& said, const Target& column);

/// The columns of a group: the number that stands in place of the '*', and the index of the heading. Spaces and upper
/// case do not count.
std::vector<std::pair<std::size_t, std::size_t>> group_of(std::string_view pattern,
                                                          const std::vector<std::string>& headings);

/// The unit that the options state for this column; nothing if they state none.
std::optional<std::string> stated_unit(const std::vector<std::string>& unit_options, const Target& column);

/// Its scale. Throws BadInput if what they state is not a unit of the column.
std::optional<Scale> stated_scale(const std::vector<std::string>& unit_options, const Target& column);

}  // namespace bms::files
