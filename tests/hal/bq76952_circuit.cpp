#include "tests/hal/bq76952_circuit.hpp"

namespace bms {

std::vector<ChipVariant> all_chip_variants() {
  std::vector<ChipVariant> all(1);
  const auto add = [&](const char* name, auto change) {
    ChipVariant variant;
    variant.name = name;
    change(variant);
    all.push_back(variant);
  };
  add("pins_follow_fet_drivers", [](ChipVariant& v) { v.pins_follow_fet_drivers = true; });
  add("config_update_keeps_pins", [](ChipVariant& v) { v.config_update_asserts_pins = false; });
  add("recovers_only_with_fet_en", [](ChipVariant& v) { v.recovers_only_with_fet_en = true; });
  add("alarm_latches_again", [](ChipVariant& v) { v.alarm_latches_on_edge = false; });
  add("user_current_wraps", [](ChipVariant& v) { v.user_current_wraps = true; });
  add("adc_limit_200mv", [](ChipVariant& v) { v.adc_limit_v = 0.2; });
  add("open_thermistor_672", [](ChipVariant& v) { v.open_thermistor_dk = 672; });
  add("shorted_thermistor_5051", [](ChipVariant& v) { v.shorted_thermistor_dk = 5051; });
  add("balancing_without_limit", [](ChipVariant& v) { v.balancing_lasts_s = 1e9; });
  add("comm_type_needs_swap", [](ChipVariant& v) { v.comm_type_needs_swap = true; });
  add("tears_within_transfer", [](ChipVariant& v) { v.tears_within_transfer = true; });
  add("transfer_ends_after_a_command", [](ChipVariant& v) { v.transfer_spans_commands = false; });
  add("cc3_moving_mean", [](ChipVariant& v) { v.cc3_moving_mean = true; });
  add("dastatus_checksum_wrong", [](ChipVariant& v) { v.dastatus_checksum_right = false; });
  add("latch_limit_zero_latches", [](ChipVariant& v) { v.latch_limit_zero_latches = true; });
  return all;
}

}  // namespace bms
