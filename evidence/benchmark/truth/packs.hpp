// Simulated packs: 8 to 24 unequal cells in series with the instruments of a battery management system, healthy or with
// one to three planted faults.
//
// Everything follows from (seed, index, healthy). Cells differ in charge, capacity, resistances and temperature;
// voltage channels have an offset, a gain error and a drift of their own. In a third of the packs the channels are
// sampled one after the other. Half of the packs have a voltmeter of their own. Nothing here may come from model/,
// estimator/, inference/identification/ or inference/diagnosis/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "benchmark/truth/cases.hpp"
#include "benchmark/truth/pack_loads.hpp"

namespace bms::benchmark::truth {

struct PackSeries {
  std::vector<double> time_s, current_a;
  std::vector<std::vector<double>> cell_v, sensor_c;
  std::vector<double> pack_v;  ///< empty: no voltmeter
};

struct PackFault {
  std::string id;                   ///< as in the JSON of the diagnosis
  std::optional<std::size_t> cell;  ///< from 0; of a sense wire the lower cell; nothing: the pack. A thermistor: its
                                    ///< number
  double size = 0;       ///< in the unit of the diagnosis, as it can be measured: against the other cells, on
                         ///< average over the recording
  bool of_data = false;  ///< late, held or staggered channels
};

struct PackCase {
  std::string name;
  CalibratedCell cell;
  double given_initial_soc = 0;
  PackSeries recording;
  std::vector<PackFault> faults;
  double hours = 0;
};

/// only: of a pack that is not healthy: a single fault with this id.
PackCase make_pack(std::uint64_t seed, std::size_t index, bool healthy, std::string_view only = {});

/// How a pack of 3 to 24 cells is used and logged.
struct SlowLog {
  PackLoad load = PackLoad::shift;
  double rows_s = 10, hours = 8;
  bool samples_current = false;  ///< the current of a row is that of its last second, not the mean of the row
};

/// A pack whose log has a row every rows_s.
PackCase make_slow_pack(std::uint64_t seed, std::size_t index, bool healthy, std::string_view only, const SlowLog& log);

/// Rows of `rows_s`: voltages and temperatures of their last moment; of the current the mean or, with samples_current,
/// that of the last moment as well.
void slow_down(PackSeries& series, double rows_s, bool samples_current = false);

/// Columns time_s, current_a, v_1 .., t_1 .., pack_voltage_v.
std::string csv_of(const PackSeries& series);

}  // namespace bms::benchmark::truth
