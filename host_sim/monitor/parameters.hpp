// The parameters of a battery as a person writes them: names, units, and the frames ParameterValue that carry them.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc

namespace bms::monitor {

/// A parameter in SI units; its raw value is an integer on the bus.
struct ParameterName {
  std::uint8_t number;
  const char* name;
  const char* unit;
  double scale;  ///< SI value of one raw unit
  int digits;    ///< after the point
  bool hexadecimal = false;
};

/// By number. The names are those of ParameterValue.Number in the DBC file.
const std::vector<ParameterName>& parameter_names();
/// By name; nullptr if there is no such name.
const ParameterName* find_parameter(const std::string& name);
/// As a person reads it, and as TOML: "3.650", "0x180".
std::string text_of(const ParameterName& parameter, std::int32_t raw);
/// Nearest raw value.
std::int32_t raw_of(const ParameterName& parameter, double value);

/// What a battery has sent of its parameters.
class ReceivedParameters {
 public:
  struct Values {
    std::optional<std::int32_t> value, lowest, highest, initial;
    bool complete() const { return value && lowest && highest && initial; }
  };

  /// Returns true if the frame is new to it.
  bool receive(const can::Frame& frame);
  /// By number; 0: the block, with check code, revision, number of parameters and state.
  const std::map<std::uint8_t, Values>& values() const { return values_; }
  /// Returns true if all parameters have arrived and fit to the check code of the block.
  bool complete() const;
  /// The raw values in the order of their numbers. Needs complete().
  std::vector<std::int32_t> raw() const;
  /// "initial", "stored", "clamped" or "lost".
  std::string state() const;

  /// Requests the parameters.
  static can::Frame request(std::uint8_t counter);

 private:
  std::map<std::uint8_t, Values> values_;
};

/// CRC-32 (IEEE 802.3) of the values, little-endian: the argument of `apply parameters`.
std::uint32_t check_code(const std::vector<std::int32_t>& raw);
/// The commands that make `raw` the parameters of a battery: begin, all values that differ from `now`, apply.
std::vector<can::Command> commands_to_set(const std::vector<std::int32_t>& now, const std::vector<std::int32_t>& raw);

}  // namespace bms::monitor
