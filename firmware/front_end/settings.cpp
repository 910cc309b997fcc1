// Settings of the measuring chip for this image: its board and its cell file. The upper chip of a pack of more than 16
// cells has those of the lower one, but for the inputs that have a cell.
#include <bit>

#include "firmware/board_pack.hpp"
#include "firmware/front_end/second_line.hpp"

namespace bms {

namespace {

using namespace firmware;

constexpr protection::Rules rules = protection::rules_of(protection::protection_table(board_pack));
constexpr hal::bq76952::Board board = front_end_board(board_pack, rules);
constexpr auto board_settings = hal::bq76952::settings(board);

/// Of a pack of more than 16 cells; the lower chip is `board`.
constexpr hal::bq76952::Board upper_board = [] {
  hal::bq76952::Board upper = board;
  if (hal::pack_cells > hal::bq76952::cell_inputs)
    upper.cell_inputs = hal::bq76952::inputs_of_pack(hal::pack_cells - hal::bq76952::lower_cells(hal::pack_cells));
  return upper;
}();
constexpr auto upper_settings = hal::bq76952::settings(upper_board);
constexpr bool halves_are_equal = upper_board.cell_inputs == board.cell_inputs;

constexpr SecondLine chip = second_line(board_settings, board.shunt_mohm);

static_assert(hal::bq76952::possible(board), "the chip cannot have a threshold or a delay that this cell file needs");
static_assert(current_is_in_range(board, rules), "the shunt cannot measure the current of the row short circuit");
static_assert(overvoltage_is_wider_and_slower(chip, rules, hal::sample_period_s));
static_assert(undervoltage_is_wider_and_slower(chip, rules, hal::sample_period_s));
static_assert(overcurrent_is_wider_and_slower(chip, rules, board_pack), "the shunt is too large for this cell file");
static_assert(charge_overcurrent_is_above_rated_pulses(chip, rules, board_pack),
              "the cell file rates a charge pulse at which the front end opens: state less, or use a smaller shunt");
static_assert(sustained_is_wider_and_slower(chip, board_pack));
static_assert(temperatures_are_wider_and_slower(chip, rules));
static_assert(die_opens_before_shutdown(board_settings, rules));
static_assert(chip.all_on, "docs/safety/assumptions.md, L-24, names what is off");
static_assert(host_silence_is_slower(chip, rules));
static_assert(std::popcount(board.cell_inputs) == hal::bq76952::lower_cells(hal::pack_cells));

}  // namespace

constexpr hal::bq76952::Configuration hal::bq76952::board_configuration =
    hal::bq76952::configuration(board, board_settings);
/// Two equal halves share a table: 496 bytes of flash.
constexpr hal::bq76952::Configuration hal::bq76952::upper_configuration =
    hal::bq76952::configuration(upper_board, halves_are_equal ? board_settings : upper_settings);

}  // namespace bms
