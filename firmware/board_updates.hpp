// What the application does for updates on a board whose images have them (firmware/update_service.hpp). On every other
// board these functions are nothing.
#pragma once

#include <algorithm>
#include <cstdint>

#include "estimator/estimate.hpp"
#include "firmware/messages.hpp"
#include "measurement/pack_sample.hpp"
#include "protection/protection.hpp"

namespace bms::firmware {

/// While an image is on trial, nothing is requested: its contactors stay open until it has confirmed itself.
template <class Board>
protection::Request allowed(protection::Request request) {
  if constexpr (requires { Board::update(); }) {
    if (Board::update().on_trial()) return protection::Request::none;
  }
  return request;
}

/// Hash of the cell file that stored data belong to: that of the build. Cell constants of an update describe the same
/// cell with the same capacity, so nothing stored is lost when they come or go.
template <class Board>
std::uint32_t hash_of_stored_data(std::uint32_t of_identity) {
  if constexpr (requires { Board::cell_hash_of_build(); }) return Board::cell_hash_of_build();
  return of_identity;
}

/// Call after each sample. at_rest: contactors open, no request. fit: self-tests and storage. Restarts after `store`,
/// if an update or a failed trial asks for it.
template <class Board, std::size_t Cells, class Estimate, class Store>
void serve_update(const measurement::PackSample<Cells>& pack, const Estimate& estimate, bool at_rest, bool fit,
                  Store&& store) {
  if constexpr (requires { Board::update(); }) {
    const auto known = [](std::int32_t reading) { return reading != measurement::no_reading; };
    const bool measured = known(pack.current_ua) && std::ranges::all_of(pack.cell_uv, known);
    const bool estimated = messages::is_number(estimate) && (estimate.flags & estimator::not_a_number) == 0;
    if (!Board::update().restart_due({pack.time_us, at_rest, measured, fit && estimated})) return;
    store();
    Board::restart();
  }
}

}  // namespace bms::firmware
