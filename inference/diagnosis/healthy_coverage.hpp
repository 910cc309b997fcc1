// Whether healthy recordings stand for a recording: were they at its states of charge, temperatures and currents?
#pragma once

#include <string>
#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "healthy_data/healthy_data.hpp"

namespace bms::diagnosis {

/// Where recordings go and the healthy ones did not, along one axis.
struct BeyondHealthy {
  std::string axis;                     ///< "soc", "current_a" (absolute value) or "temperature_c"
  double share = 0;                     ///< of the rows, 0 to 1
  healthy_data::HealthyRange recorded;  ///< of all rows
  healthy_data::HealthyRange healthy;   ///< not known: no healthy block
};

struct HealthyCoverage {
  double share = 0;  ///< that healthy blocks stand for: of the rows or, if less, of the squared current
  double least = 0;  ///< the same of the recording that has the least
  std::vector<BeyondHealthy> beyond;  ///< the axis with most rows first; without those that no row leaves
};

HealthyCoverage coverage_of(const std::vector<PreparedRecording>& records, const healthy_data::HealthyData& healthy,
                            double capacity_ah);

}  // namespace bms::diagnosis
