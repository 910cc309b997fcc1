// Measures the cost of protecting sixteen cells on a board: a thousand samples with all kinds of faults, for the
// instruction counter. Exit code 0: the board decides as the host.
#include "tests/firmware/protection/scenario.hpp"

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
