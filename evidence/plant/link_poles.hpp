// Voltages of both poles of the DC link against the negative end of the cells, as the wiring of
// boards/stm32f405_forklift gives them.
//
//   plus closed (main plus or precharge relay)   L+ = pack
//   minus closed                                 L- = 0
//   both open     L+ and L- float: each has a divider of 1 Mohm and 28 kohm to 1.605 V, and L+ also the pin LD of the
//                 front end, 2.01 Mohm to 0 V; L+ - L- is the voltage of the capacitor
#pragma once

namespace bms::plant {

struct LinkPoles {
  double plus_v = 0, minus_v = 0;
};

/// dc_link_v: voltage of the capacitor. The current through a precharge relay on a divider is too small to count.
constexpr LinkPoles link_poles(bool plus_closed, bool minus_closed, double pack_v, double dc_link_v) {
  if (minus_closed) return {dc_link_v, 0};
  if (plus_closed) return {pack_v, pack_v - dc_link_v};
  constexpr double bias_v = 1.605, divider_s = 1 / 1.028e6, ld_s = 1 / 2.01e6;
  const double minus_v = (2 * bias_v * divider_s - dc_link_v * (divider_s + ld_s)) / (2 * divider_s + ld_s);
  return {minus_v + dc_link_v, minus_v};
}

}  // namespace bms::plant
