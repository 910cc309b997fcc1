// Generates the constexpr header of a cell for the firmware.
//
//   cell_header CELL OUT.hpp [fixed|aged]       CELL: a built-in name or a path; fixed: for a board that computes in
//                                               integers; aged: the resistances are known to a half at best, for the
//                                               batteries of a group (firmware/parallel/README.md)
//   cell_header --parameters OUT.hpp CELL...    only the parameters of built-in cells, one constant for each: for tests
//
// A rejected cell gives exit code 2 and one line.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string_view>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/cell_header.hpp"
#include "files/text_file.hpp"

int main(int argc, char** argv) {
  const bool parameters_only = argc >= 4 && argv[1] == std::string_view("--parameters");
  const bool fixed = argc == 4 && argv[3] == std::string_view("fixed"),
             aged = argc == 4 && argv[3] == std::string_view("aged");
  if (argc != 3 && !fixed && !aged && !parameters_only) {
    std::fputs("usage: cell_header CELL OUT.hpp [fixed|aged]\n       cell_header --parameters OUT.hpp CELL...\n",
               stderr);
    return 2;
  }
  try {
    if (parameters_only) {
      bms::files::write_file(argv[2], bms::files::parameters_header({argv + 3, argv + argc}));
      return 0;
    }
    bms::files::CellFile cell = bms::files::read_cell(argv[1]);
    double& resistance_fraction = cell.parameters.tolerance.resistance_fraction;
    if (aged) resistance_fraction = std::max(resistance_fraction, 0.5);
    if (fixed) bms::files::reject_if_fpu_needed(cell);
    bms::files::write_file(argv[2], bms::files::cell_header(cell));
  } catch (const bms::files::BadInput& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cell_header: %s\n", error.what());
    return 3;
  }
  return 0;
}
