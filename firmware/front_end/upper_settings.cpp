// Settings of the upper chip of a pack of more than 16 cells: those of the lower one, which settings.cpp compares with
// the rows, but for the inputs that have a cell.
#include <bit>

#include "firmware/board_pack.hpp"
#include "firmware/front_end/second_line.hpp"

namespace bms {

namespace {

constexpr hal::bq76952::Board upper_board() {
  using namespace firmware;
  hal::bq76952::Board board =
      front_end_board(board_pack, protection::rules_of(protection::protection_table(board_pack)));
  board.cell_inputs = hal::bq76952::inputs_of_pack(hal::pack_cells - hal::bq76952::lower_cells(hal::pack_cells));
  return board;
}

constexpr hal::bq76952::Board board = upper_board();
constexpr auto upper_settings = hal::bq76952::settings(board);

static_assert(hal::pack_cells > hal::bq76952::cell_inputs);

}  // namespace

constexpr hal::bq76952::Configuration hal::bq76952::upper_configuration =
    hal::bq76952::configuration(board, upper_settings);

}  // namespace bms
