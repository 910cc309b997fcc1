// The tables that act on this board: those of the build, or in an image for a slot of the boot loader those of an
// update (firmware/cell_of_update.hpp). Both have the same type, so most code exists once.
#pragma once

#include <algorithm>
#include <type_traits>

#include "cell_update/format.hpp"
#include "firmware/board_cell.hpp"

namespace bms::firmware {

using BoardLaws = std::remove_cvref_t<decltype(model::laws_of(generated::cell<BoardScalar>))>;

inline constexpr std::size_t most_intervals =
    std::max(cell_update::room_for_intervals, model::interval_count(generated::parameters));

namespace tables_detail {

/// With room for those of an update.
template <class S>
constexpr auto with_room() {
  if constexpr (requires { generated::cell<S>.laws; })
    return model::ExtendedCell<S, most_intervals, BoardLaws>{{model::prepare<S, most_intervals>(generated::parameters)},
                                                             generated::cell<S>.laws};
  else
    return model::prepare<S, most_intervals>(generated::parameters);
}
template <class S>
inline constexpr auto roomy = with_room<S>();

template <class S>
constexpr const auto& of_build() {
  if constexpr (BMS_IN_SLOT)
    return roomy<S>;
  else
    return generated::cell<S>;
}

}  // namespace tables_detail

inline constexpr const auto& tables_of_build = tables_detail::of_build<BoardScalar>();
using BoardTables = std::remove_cvref_t<decltype(tables_of_build)>;

/// Those of an update; nullptr: those of the build act.
extern const BoardTables* tables_of_update;
/// Hash of the cell file that acts.
extern std::uint32_t acting_cell_hash;

/// The estimator step with them. A function of its own: for that of the build, the tables are constants.
BoardEstimator::Result step_of_update(BoardEstimator& estimator, const measurement::Sample& sample);

inline const BoardTables& tables() {
  if constexpr (BMS_IN_SLOT) {
    if (tables_of_update != nullptr) return *tables_of_update;
  }
  return tables_of_build;
}

}  // namespace bms::firmware
