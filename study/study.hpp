// The paper's comparison, repeated: four models, five optimisers, seven experiments, ten states of charge (Tables 4 to
// 9).
//
// It runs on the plant (plant/), whose parameters are known, or on recordings. The paper's own recordings are not
// published, so its numbers cannot be reproduced; its procedure and its ranking can.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "files/page_content.hpp"
#include "measurement/recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::study {

/// A statement of the paper, and whether it holds here.
struct StudyClaim {
  std::string claim;
  std::string result;  ///< what was found
  bool holds = false;
};

struct StudyResult {
  std::string source;  ///< the data of the study
  std::vector<files::PageTable> tables;
  std::vector<StudyClaim> claims;
  std::vector<files::PageChart> charts;
  std::vector<measurement::Warning> warnings;
  std::size_t fits = 0;  ///< number of identifications
  double seconds = 0;
};

/// done: identifications that are finished, of `all`.
using StudyProgress = std::function<void(std::size_t done, std::size_t all)>;

/// The whole study on the plant, with 1 mV and 10 mA of noise. seed: of the noise.
StudyResult study_plant(const model::CellParameters<>& cell, std::uint64_t seed, const StudyProgress& progress);

/// Models, optimisers and cross-validation on recordings. The models are identified from the first recording and
/// validated with the second. Throws BadInput if there are fewer than two, or one cannot be used.
StudyResult study_recordings(const model::CellParameters<>& cell, const std::vector<std::string>& paths,
                             const StudyProgress& progress);

}  // namespace bms::study
