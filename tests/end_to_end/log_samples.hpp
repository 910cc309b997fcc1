// Logs as testers, loggers and CAN tools write them, made from the public descriptions of their formats and from one
// known signal. Nothing here uses the reader.
#pragma once

#include <string>
#include <vector>

namespace bms::log_samples {

/// The signal that every sample contains: 60 s at 1 Hz, in seconds, amperes (> 0 charges), volts and degrees C.
struct Row {
  double time_s, current_a, voltage_v, temperature_c;
};
std::vector<Row> signal();

enum class Answer { read, refused };

struct Sample {
  std::string what;     ///< for the table of docs/log_formats.md
  std::string file;     ///< name of the file that is written
  std::string content;  ///< its bytes
  std::string options;  ///< of bms import
  Answer answer = Answer::read;
  std::string says;              ///< part of "read as", or of the refusal
  double voltage_step_v = 5e-4;  ///< resolution of the file
  double current_step_a = 5e-3;
  std::size_t missing_rows = 0;  ///< at the end
  double time_factor = 1;        ///< the file's time is so many times that of the signal
};
std::vector<Sample> samples();

/// The DBC file that the samples of CAN frames name: bus.dbc.
std::string dbc();

}  // namespace bms::log_samples
