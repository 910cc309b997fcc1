// Fault injection between the simulated pack and the board: on the CAN bus, in a sensor, or in the power path.
//
//   NAME[=VALUE]@START[-END]        in seconds; without END the fault stays
//
//   drop=P  corrupt=P  delay=P      each frame to the board is lost, has one bit flipped, or is one sample late, with
//                                   probability P
//   cell_stuck=K  cell_open=K       the reading of cell K does not change, is missing
//   sense_wire=K                    the wire between cells K and K + 1 is broken: one reads low, the other high
//   cell_high=K  cell_low=K         cell K reads far above, far below its limits
//   current_stuck  current_open  temperature_open  temperature_stuck
//   overcurrent                     the load takes more current than the board allows
//   welded                          the contactor main+ does not open
//   precharge_open                  the pre-charge resistor is open circuit
//   silence                         the board receives no samples
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
  /// The signal of the DBC message Faults that the board must publish within `within_s`; empty: none is required.
  std::string expected;
  double within_s = 0;
};

/// Parses the command line's notation. Throws files::BadInput, which lists the names.
Injection parse_injection(const std::string& text, std::size_t cells);

class Injector {
 public:
  Injector(std::vector<Injection> all, std::uint32_t seed) : all_(std::move(all)), random_(seed) {}

  bool active(const char* name, double time_s) const;
  /// Applies the faults of the sensors.
  void apply(double time_s, measurement::PackSample<max_cells>& sample);
  /// Applies the faults of the CAN bus. Delayed frames are returned by the next call.
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
