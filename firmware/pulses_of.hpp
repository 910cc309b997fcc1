// Whether a board publishes currents for pulses: Board::Pulses (firmware/pulse_currents.hpp), for tests and boards that
// define it.
#pragma once

namespace bms::firmware {

struct NoPulses {
  template <class Board, class... Rest>
  constexpr void publish(const Rest&...) {}
};

template <class Board>
struct PulsesOfBoard {
  using Type = NoPulses;
};
template <class Board>
requires requires { typename Board::Pulses; }
struct PulsesOfBoard<Board> {
  using Type = typename Board::Pulses;
};
template <class Board>
using PulsesOf = typename PulsesOfBoard<Board>::Type;

}  // namespace bms::firmware
