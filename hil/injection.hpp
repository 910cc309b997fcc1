// What is broken on purpose between the simulated pack and the board: on the wire, in a sensor, in the power path.
//
//   NAME[=VALUE]@START[-END]        seconds; without an end it stays
//
//   drop=P  corrupt=P  delay=P      frames to the board: lost, a bit turned over, late by a sample; P: the part of them
//   cell_stuck=K  cell_open=K       reading of cell K stays, is missing
//   sense_wire=K                    the wire between cells K and K + 1 is broken: their readings part in opposite ways
//   cell_high=K  cell_low=K         cell K reads what no cell may have
//   current_stuck  current_open  temperature_open  temperature_stuck
//   overcurrent                     the load takes what it was not allowed
//   welded                          main+ does not open any more
//   precharge_open                  the pre-charge resistor is burnt through
//   silence                         no samples at all
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "hal/can.hpp"
#include "hil/simulated_pack.hpp"
#include "measurement/pack_sample.hpp"

namespace bms::hil {

struct Injection {
  std::string text, name;
  double value = 0, from_s = 0, to_s = 1e300;
  /// The DBC file's signal in Faults that has to come, and how long after; empty: none has to.
  std::string expected;
  double within_s = 0;
};

/// From the command line; throws BadInput with the names that there are.
Injection injection(const std::string& text, std::size_t cells);

class Injector {
 public:
  Injector(std::vector<Injection> all, std::uint32_t seed) : all_(std::move(all)), random_(seed) {}

  bool active(const char* name, double time_s) const;
  /// Sensors.
  void apply(double time_s, measurement::PackSample<max_cells>& sample);
  /// The wire. Frames that are late come with the next call's.
  std::vector<can::Frame> apply(double time_s, std::vector<can::Frame> frames);

  const std::vector<Injection>& all() const { return all_; }

 private:
  const Injection* find(const char* name, double time_s) const;

  std::vector<Injection> all_;
  std::mt19937_64 random_;
  std::vector<can::Frame> late_;
  measurement::PackSample<max_cells> last_;
};

}  // namespace bms::hil
