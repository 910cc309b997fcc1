#include "hal/bq76952/stack.hpp"

#include <algorithm>

#include "hal/bq76952/pack_readings.hpp"
#include "hal/clock.hpp"
#include "hal/i2c.hpp"
#include "hal/isolated_i2c.hpp"

namespace bms::hal::bq76952 {

namespace {

constexpr std::size_t lower = 0, upper = 1;
constexpr std::size_t cells_below = lower_cells(pack_cells);
static_assert(stacked && pack_cells - cells_below >= 8 && pack_cells <= 2 * cell_inputs);

}  // namespace

void Stack::start() {
  i2c_start();
  isolated_i2c_start();
  halves_[lower].chip.use(board_configuration);
  halves_[upper].chip.use(upper_configuration, Bus{.isolated = true});
}

/// Reads one chip and judges its place and its clock by what it has measured.
void Stack::read_half(std::size_t which, measurement::PackSample<cell_inputs>& inputs) {
  Half& half = halves_[which];
  half.chip.bleed(inputs_of(configuration(which), half.place == Place::wrong ? 0 : half.wanted));
  const bool measured = half.chip.state() == FrontEnd::State::measure;
  half.chip.read(inputs);
  trips_ |= half.chip.trips();
  if (!measured || half.chip.state() != FrontEnd::State::measure) {
    half.place = Place::unknown;
    half.clock.pause();
    half.stale = false;
    return;
  }
  half.stale = !half.chip.fresh();
  half.clock.update(inputs.time_us, half.chip.charge_time_s());
  const std::int32_t strap_uv = half.chip.strap_uv();
  if (strap_uv != measurement::no_reading)
    half.place = (strap_uv >= strap_high_uv) == (which == upper) ? Place::right : Place::wrong;
}

void Stack::read(Inputs& inputs, const SensorCalibration& by, measurement::PackSample<pack_cells>& into) {
  const bool neither = halves_[lower].chip.state() != FrontEnd::State::measure &&
                       halves_[upper].chip.state() != FrontEnd::State::measure;
  turn_ = 1 - turn_;
  trips_ = 0;
  into.time_us = inputs.time_us;
  for (const std::size_t which : {lower, upper}) {
    auto& half = inputs.of_half[which];
    half.time_us = which == lower ? inputs.time_us : now_us();
    if (!neither || which == turn_) read_half(which, half);
    if (!halves_[which].usable()) half = {.time_us = half.time_us};
    const Configuration& c = configuration(which);
    for (std::size_t k = 0; k < c.cells; ++k)
      into.cell_uv[which * cells_below + k] =
          corrected_reading(half.cell_uv[c.input_of_cell[k]], by.voltage_gain_ppm, by.voltage_offset_uv);
    for (std::size_t k = 0; k < 2; ++k) into.temperature_cdegc[2 * which + k] = half.temperature_cdegc[k];
  }
  const auto &below = inputs.of_half[lower], &above = inputs.of_half[upper];
  into.current_ua = corrected_reading(below.current_ua, by.current_gain_ppm, by.current_offset_ua);
  into.pack_uv = measurement::no_reading;
  if (below.pack_uv == measurement::no_reading || above.pack_uv == measurement::no_reading) return;
  into.pack_uv = corrected_reading(below.pack_uv + above.pack_uv, by.voltage_gain_ppm,
                                   static_cast<std::int64_t>(pack_cells) * by.voltage_offset_uv);
  longest_skew_us_ = std::max(longest_skew_us_, static_cast<std::uint32_t>(above.time_us - below.time_us) + scan_us);
}

bool Stack::silent() const { return halves_[lower].chip.silent() || halves_[upper].chip.silent(); }

void Stack::clear_latch() {
  for (Half& half : halves_) half.chip.clear_latch();
}

std::int32_t Stack::dc_link_uv() const {
  std::int32_t highest_uv = 0;
  for (const Half& half : halves_) {
    if (half.chip.dc_link_uv() == measurement::no_reading) return measurement::no_reading;
    highest_uv = std::max(highest_uv, half.chip.dc_link_uv());
  }
  return highest_uv;
}

void Stack::shut_down() {
  for (Half& half : halves_) half.chip.shut_down();
}

FrontEnd::AfterShutdown Stack::after_shut_down() {
  using enum FrontEnd::AfterShutdown;
  const auto below = halves_[lower].chip.after_shut_down(), above = halves_[upper].chip.after_shut_down();
  if (below == held_on || above == held_on) return held_on;
  return below == restarted ? below : above;
}

void Stack::bleed(std::uint32_t cells) {
  halves_[lower].wanted = cells & ((1U << cells_below) - 1);
  halves_[upper].wanted = cells >> cells_below;
}

/// What keeps a half from having readings; FrontEndState::measuring if nothing does.
FrontEndState Stack::problem_of(std::size_t which) const {
  const Half& half = halves_[which];
  const auto named = [&](FrontEndState of_lower, FrontEndState of_upper) {
    return which == lower ? of_lower : of_upper;
  };
  using enum FrontEndState;
  if (half.chip.state() == FrontEnd::State::absent) return named(lower_absent, upper_absent);
  if (half.chip.state() != FrontEnd::State::measure) return named(lower_configuring, upper_configuring);
  if (half.place == Place::wrong) return named(lower_misplaced, upper_misplaced);
  if (half.clock.wrong()) return named(lower_clock_wrong, upper_clock_wrong);
  if (half.stale || half.place == Place::unknown) return named(lower_stale, upper_stale);
  return measuring;
}

FrontEndHealth Stack::health() const {
  using enum FrontEndState;
  const FrontEndState of_lower = problem_of(lower), of_upper = problem_of(upper);
  FrontEndHealth health{of_lower == measuring ? of_upper : of_lower};
  if (of_lower == lower_misplaced && of_upper == upper_misplaced) health.state = swapped;
  if (of_lower == lower_absent && of_upper == upper_absent) health.state = absent;
  if (of_lower == lower_configuring && of_upper == upper_configuring) health.state = configuring;
  for (const Half& half : halves_) {
    health.lost += half.chip.counters().lost;
    health.resets += half.chip.counters().resets;
    health.bad_crc += half.chip.wire().bad_crc;
    health.die_cdegc = std::max(health.die_cdegc, half.chip.die_cdegc());  // no_temperature is less than any
  }
  return health;
}

}  // namespace bms::hal::bq76952
