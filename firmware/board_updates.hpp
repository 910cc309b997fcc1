// What the application does for updates on a board whose images have them (firmware/update_service.hpp). On every other
// board these functions are nothing.
#pragma once

#include <algorithm>
#include <cstdint>

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

/// Call after each sample. at_rest: contactors open, no request. fit: self-tests and storage. Restarts after `store`,
/// if an update or a failed trial asks for it.
template <class Board, std::size_t Cells, class Store>
void serve_update(const measurement::PackSample<Cells>& pack, bool at_rest, bool fit, Store&& store) {
  if constexpr (requires { Board::update(); }) {
    const auto known = [](std::int32_t reading) { return reading != measurement::no_reading; };
    const bool measured = known(pack.current_ua) && std::ranges::all_of(pack.cell_uv, known);
    if (!Board::update().restart_due({pack.time_us, at_rest, measured, fit})) return;
    store();
    Board::restart();
  }
}

}  // namespace bms::firmware
