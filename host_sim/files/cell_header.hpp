// The constexpr header of a cell for firmware, made from its cell file.
//
// Mechanisms that an estimator cannot run (on_board in model/mechanism.hpp) are left out, as in the host's estimator.
// Numbers have the digits that give back the same double. The compiler prepares the tables for the scalar of the board
// with the constexpr function that the host runs, too.
#pragma once

#include <span>
#include <string>

#include "files/cell_file.hpp"

namespace bms::files {

/// What a cell header includes in a program that uses the installed headers.
inline constexpr char installed_model[] = "<greybox/model.hpp>";

/// Text of the header: bms::generated with cell_name, cell_hash, parameters, Model<S> and cell<S>. include: the header
/// with the model, in its brackets or quotes; empty: those of this source tree.
std::string cell_header(const CellFile& file, const std::string& include = "");

/// Text of a header with the parameters of built-in cells alone, one constant for each. Throws BadInput.
std::string parameters_header(std::span<char* const> names);

}  // namespace bms::files
