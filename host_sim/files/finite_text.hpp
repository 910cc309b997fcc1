// Whether a text that is about to be written holds a number that is not finite: "nan", "-inf". Summaries and
// results pass this check (host_sim/tool/output.cpp), so that a fault of ours is an error and never a result; files of
// import, parameters and images do not.
#pragma once

#include <string_view>

namespace bms::files {

/// The place of such a word, with some characters around it; otherwise empty. A word in quotes, in a file name
/// or in a script of a page is not one.
std::string_view not_finite_in(std::string_view text);

/// Throws std::runtime_error that quotes the place.
void require_finite(std::string_view text);

}  // namespace bms::files
