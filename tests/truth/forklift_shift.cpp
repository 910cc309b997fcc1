#include "tests/truth/forklift_shift.hpp"

#include <array>
#include <charconv>

namespace bms::plant {

std::vector<RecordedRow> record(const std::vector<bms::experiments::ProfileRow>& profile, Cell& cell,
                                Instruments& instruments, const Ambient& ambient) {
  std::vector<RecordedRow> rows;
  double before_s = profile.front().time_s;
  for (const bms::experiments::ProfileRow& row : profile) {
    const double elapsed_s = row.time_s - before_s;
    const double done = row.time_s / profile.back().time_s;
    if (elapsed_s > 0) cell.run(row.current_a, ambient.start_c + done * (ambient.end_c - ambient.start_c), elapsed_s);
    rows.push_back({
        .time_s = row.time_s,
        .current_a = instruments.current_a.read(row.current_a, elapsed_s),
        .voltage_v = instruments.voltage_v.read(cell.voltage_v(), elapsed_s),
        .temperature_c = instruments.temperature_c.read(cell.temperature_c(), elapsed_s),
        .soc = cell.soc(),
    });
    before_s = row.time_s;
  }
  return rows;
}

namespace {

void append(std::string& text, double value, int decimals, char end) {
  std::array<char, 32> digits{};
  const auto written = std::to_chars(digits.data(), digits.data() + digits.size(), value + 0.0,
                                     std::chars_format::fixed, decimals);  // + 0.0: no "-0"
  text.append(digits.data(), written.ptr).push_back(end);
}

}  // namespace

std::string forklift_shift_csv() {
  constexpr std::uint64_t profile_seed = 1, instrument_seed = 1;
  Cell cell({.capacity_ah = 6.03}, {.soc = 0.98, .v_rc_v = 0, .temperature_c = 18});
  Instruments instruments({}, instrument_seed);
  const auto profile =
      bms::experiments::experiment("forklift_shift", {.capacity_ah = 6, .seed = profile_seed, .step_s = 1});

  std::string text =
      "# Eight hours of an electric forklift on one LiFePO4 cell of 6 Ah. Simulated, not measured.\n"
      "# Cell: evidence/plant/ (Table 9 made smooth, 6.03 Ah), from soc 0.98 at rest; ambient 18 to 22 degrees C.\n"
      "# Current: bms experiment forklift_shift, seed 1. Instruments: evidence/plant/instruments.hpp, seed 1.\n"
      "# soc_ref is the true soc. Written by the build target make_forklift_shift; see evidence/recordings/README.md.\n"
      "time_s,current_a,voltage_v,temperature_c,soc_ref\n";
  for (const RecordedRow& row : record(profile.value(), cell, instruments, {.start_c = 18, .end_c = 22})) {
    append(text, row.time_s, 0, ',');
    append(text, row.current_a, 3, ',');
    append(text, row.voltage_v, 3, ',');
    append(text, row.temperature_c, 1, ',');
    append(text, row.soc, 5, '\n');
  }
  return text;
}

}  // namespace bms::plant
