#include "firmware/cell_of_update.hpp"

#include <new>

#include "cell_update/contents.hpp"
#include "firmware/board_tables.hpp"

namespace bms::firmware {

namespace {

using Contents = cell_update::Contents<BoardScalar, most_intervals, BoardLaws>;
static_assert(std::is_same_v<Contents::Tables, BoardTables>);

// Static, because they are larger than the stack; without a value, which would stand in flash.
alignas(Contents) std::byte room_for_contents[sizeof(Contents)];
alignas(BoardTables) std::byte room_for_tables[sizeof(BoardTables)];

/// Nothing if they are refused.
const Contents* accepted(std::span<const std::uint8_t> payload, boot::Refusal& refusal) {
  auto* const contents = new (room_for_contents) Contents;
  static constexpr auto built = cell_update::of_build(generated::parameters);
  refusal = contents->read(payload, built);
  return refusal == boot::Refusal::none ? contents : nullptr;
}

}  // namespace

const BoardTables* tables_of_update = nullptr;
std::uint32_t acting_cell_hash = generated::cell_hash;

std::uint32_t cell_hash_of_build() { return generated::cell_hash; }

boot::Refusal check_cell_constants(std::span<const std::uint8_t> payload) {
  boot::Refusal refusal{};
  accepted(payload, refusal);
  return refusal;
}

boot::Refusal use_cell_constants(std::span<const std::uint8_t> payload, std::uint32_t hash) {
  boot::Refusal refusal{};
  if (const Contents* const contents = accepted(payload, refusal)) {
    tables_of_update = new (room_for_tables) BoardTables(contents->tables());
    acting_cell_hash = hash;
  }
  return refusal;
}

}  // namespace bms::firmware
