// How a recording is to be read: what the user says about a file, where it is not found in the file itself.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "measurement/recording.hpp"

namespace bms::files {

/// Sign of the current in the file.
enum class CurrentSign {
  detected,            ///< as the format defines it; an inverted one is refused
  charge_positive,     ///< confirmed by the user
  discharge_positive,  ///< is inverted while reading
};

struct ReadOptions {
  std::string format;             ///< name of a format (host_sim/files/logs/log_formats.hpp); empty: detected
  std::vector<std::string> map;   ///< "current_a=COLUMN"; of CAN frames "current_a=SIGNAL" or "MESSAGE.SIGNAL"
  std::string map_file;           ///< such lines in a file
  std::vector<std::string> unit;  ///< "current_a=mA"
  CurrentSign sign = CurrentSign::detected;
  std::string separator;            ///< one character, "tab" or "\t"; empty: detected
  bool decimal_comma = false;       ///< also detected
  bool day_first = false;           ///< dates as 31/12/2026; otherwise 12/31/2026, if both are possible
  std::string dbc;                  ///< DBC file that describes the frames of a CAN log
  std::string channel;              ///< the only channel of a CAN log that is read; empty: any
  std::size_t cells_in_series = 0;  ///< divides a pack voltage; 0: unknown
  bool refuse_doubtful = false;     ///< an inverted current and impossible readings are errors, not warnings
  std::string steps, cycles;        ///< "3:7": only rows of these steps or cycles of a tester; empty: all
  bool keep_all = false;            ///< columns without a meaning here are kept in Recording::others
  std::map<std::string, measurement::Recording> in_memory;  ///< by path: used in place of such a file
};

}  // namespace bms::files
