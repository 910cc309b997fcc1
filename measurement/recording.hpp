// A recording in memory: current, voltage and temperature over time, one column each. host_sim/files/recording.hpp
// reads it from CSV; replay, identification and diagnosis view the same columns (measurement/column.hpp).
//
// Row k: current_a is the mean current over the interval that ends at time_s (> 0 charges); voltage_v is sampled at
// time_s. NaN is a missing reading; time_s has none.
//
// current_ref_a and voltage_ref_v are the readings of a trusted instrument in the same row. An open contactor is 0 A.
// voltage_ref_v is measured at the terminals of the cell. With the contactor open it may be the voltage of a reference
// source in place of the cell: in a row with current_ref_a = 0 and a voltage_ref_v, voltage_v is not the cell's.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "measurement/column.hpp"
#include "measurement/sample.hpp"

namespace bms::measurement {

/// A doubt about a recording that can be used nevertheless. The ids are part of the JSON output.
struct Warning {
  std::string id;    ///< "gap"; the list: measurement/recording_checks.hpp
  std::string text;  ///< one sentence for the user
};

/// A column without a meaning here, kept for the file that it is written to again.
struct OtherColumn {
  std::string name;
  std::vector<std::string> text;  ///< as in the file
};

/// A pack of N cells in series has the mean of its cells in voltage_v and temperature_c, and each reading in a column
/// of its own; cell() makes a recording of one cell.
struct Recording {
  std::string path;     ///< for messages
  std::string read_as;  ///< format, columns, units and sign as detected or as the user named them; one line
  Column time_s;        ///< does not decrease
  Column current_a;
  Column voltage_v;                        ///< empty: a profile
  Column temperature_c;                    ///< empty: not recorded
  Column soc_ref;                          ///< reference state of charge, 0 .. 1; empty: unknown
  Column current_ref_a;                    ///< NaN: no reading; empty: no such column
  Column voltage_ref_v;                    ///< NaN: no reading; empty: no such column
  std::vector<Column> cell_voltage_v;      ///< of a pack: one column for each cell
  std::vector<Column> cell_temperature_c;  ///< of a pack: one column for each sensor
  Column pack_voltage_v;                   ///< of a pack; empty: not recorded
  std::vector<OtherColumn> others;         ///< only if the reader was asked to keep them
  std::vector<Warning> warnings;
  double read_mb_per_second = 0;  ///< speed of reading and parsing the file

  std::size_t rows() const { return time_s.size(); }
  double duration_s() const { return time_s.empty() ? 0 : time_s.back() - time_s.front(); }
};

/// One cell of a pack recording, from 0: its voltage, the temperature of the nearest sensor, the current of the pack.
Recording cell(const Recording& pack, std::size_t index);

/// The recording as the estimator receives it: integers in micro-units, time from the first row. A voltage that may be
/// a reference source's is left out.
std::vector<Sample> samples(const Recording& recording);

/// Samples to read one part after the other. Those of a recording are made when they are read: a recording of millions
/// of rows is not stored twice. Views the list or the recording.
class SampleList {
 public:
  SampleList(const std::vector<Sample>& list) : list_(list) {}  // NOLINT(google-explicit-constructor): a list of them
  explicit SampleList(const Recording& recording) : recording_(&recording) {}

  std::size_t size() const { return recording_ != nullptr ? recording_->rows() : list_.size(); }
  /// `count` samples from `first` on, or fewer at the end; `space` is where they are made.
  std::span<const Sample> part(std::size_t first, std::size_t count, std::vector<Sample>& space) const;

 private:
  std::span<const Sample> list_;
  const Recording* recording_ = nullptr;
};

/// One of these samples. time_s: since the first; a reading that is NaN is missing.
Sample sample_of(double time_s, double current_a, double voltage_v, double temperature_c);

}  // namespace bms::measurement
