// What protecting sixteen cells costs on the board: a thousand samples of a pack with everything happening to it, for
// the instruction counter. Exit code 0: the board decides what the host decides.
#include "tests/protection/scenario.hpp"

namespace bms::protection {

[[gnu::noinline, gnu::flatten]] const Decision& protection_step(Protection<16>& protection,
                                                                const measurement::PackSample<16>& sample,
                                                                const PackEstimate<16>& estimate,
                                                                const ExternalInputs& inputs) {
  return protection.update(sample, estimate, inputs);
}

}  // namespace bms::protection

int main() {
  using namespace bms::protection;
  static Scenario scenario;
  return scenario.run(1'000,
                      [](auto& p, const auto& sample, const auto& estimate, const auto& inputs) -> const Decision& {
                        return protection_step(p, sample, estimate, inputs);
                      }) == expected_scenario_hash
             ? 0
             : 1;
}
