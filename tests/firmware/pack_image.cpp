// What sixteen cells beside their mean cost on the board: a thousand steps of their differences over a load that turns,
// for the instruction counter. Exit code 0: a cell that was made weaker is found.
#include "cell_constants.hpp"
#include "estimator/cell_differences.hpp"

namespace bms::firmware {

using Pack = estimator::CellDifferences<float, 16>;

[[gnu::noinline, gnu::flatten]] void pack_step(Pack& pack, float soc, float current_a, float moved,
                                               const Pack::Observation& observation) {
  pack.step(generated::cell<float>, soc, 0.01F, current_a, moved, 60.0F, observation);
}

}  // namespace bms::firmware

int main() {
  using namespace bms;
  Pack pack;
  Pack::Observation observation;
  float soc = 0.95F;
  std::uint8_t interval = 0;
  for (int k = 0; k < 1'000; ++k) {
    const float current_a = k % 40 < 20 ? -6.0F : 1.5F, moved = current_a * 10 / (3'600 * 6);
    soc += moved;
    const auto at = model::look_up(generated::cell<float>, soc, interval);
    const float drop_v = (at.r0_ohm + at.r1_ohm) * current_a;
    for (std::size_t cell = 0; cell < 16; ++cell) {
      observation.usable[cell] = cell != 15 || k % 3 != 0;  // one channel comes and goes
      const float more = cell == 7 ? 0.3F : -0.02F;         // resistance of the eighth
      observation.voltage_v[cell] = at.ocv_v + drop_v * (1 + more);
    }
    pack_step(pack, soc, current_a, moved, observation);
  }
  return pack[7].resistance() > 0.15F && pack[0].resistance() < 0.05F ? 0 : 1;
}
