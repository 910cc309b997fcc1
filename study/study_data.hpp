// Data sets of the study: experiments run on the plant, and parts of them.
#pragma once

#include <cstdint>
#include <string>

#include "identification/data.hpp"

namespace bms::study {

/// A data set, and the states of charge that it covers.
struct StudyData {
  std::string name;
  identification::Data data;
  double soc_from = 0;              ///< at the start
  double soc_min = 1, soc_max = 0;  ///< of all samples
  double middle_soc() const { return (soc_min + soc_max) / 2; }
};

/// Runs an experiment (experiments/experiment.hpp) on the plant, with 1 mV and 10 mA of measurement noise.
StudyData run_on_plant(const std::string& experiment, double soc_from, std::uint64_t seed);

/// The discharging half of an OCV test between two states of charge, counted with the nominal capacity.
StudyData window(const StudyData& whole, const std::string& name, double high_soc, double low_soc);

}  // namespace bms::study
