// The paper's comparison, done again: four models, five optimisers, seven experiments, ten states of charge (Tables 4
// to 9).
//
// On the plant (plant/, whose parameters are known) or on recordings. The paper's own recordings are not published, so
// its figures cannot come out; its procedure can, and its order.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "files/page_content.hpp"
#include "identification/data.hpp"
#include "measurement/recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::study {

/// A statement of the paper and whether it holds here.
struct StudyClaim {
  std::string claim, evidence;
  bool holds = false;
};

struct StudyResult {
  std::string source;  ///< what was studied
  std::vector<files::PageTable> tables;
  std::vector<StudyClaim> claims;
  std::vector<files::PageChart> charts;
  std::vector<measurement::Warning> warnings;
  std::size_t fits = 0;  ///< identifications done
  double seconds = 0;
};

/// Called with what is done and what there is to do.
using StudyProgress = std::function<void(std::size_t done, std::size_t all)>;

/// The whole of it on the plant, with 1 mV and 10 mA of noise.
StudyResult study_plant(const model::CellParameters<>& cell, std::uint64_t seed, const StudyProgress& progress);

/// Models, optimisers and the cross matrix on recordings, in the order given: the first is identified from, the second
/// validates. Throws BadInput with less than two.
StudyResult study_recordings(const model::CellParameters<>& cell, const std::vector<std::string>& paths,
                             const StudyProgress& progress);

}  // namespace bms::study
