// The paper's comparison, repeated: four models, five optimisers, seven experiments, ten states of charge (Tables 4 to
// 9).
//
// It runs on the plant (evidence/plant/), whose parameters are known, or on recordings. The paper's own recordings are
// not published, so its numbers cannot be reproduced; its procedure and its ranking can.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "files/page_content.hpp"
#include "measurement/recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::study {

/// A statement, and whether it holds in the run that the tables show.
struct StudyClaim {
  std::string claim;
  std::string result;         ///< what was found, or why it is not judged
  std::optional<bool> holds;  ///< missing: not judged
};

/// Runs of one kind of cell in which a statement holds, of those in which it can be judged; 95 % interval (Wilson).
struct StatementShare {
  std::string plant;
  std::size_t holds = 0, judged = 0;
  double low = 0, high = 1;
  std::string example;  ///< what one run observed, or why it is not judged
};

struct StatementResult {
  std::string id, where, text, rule;
  std::vector<StatementShare> shares;
};

struct StudyResult {
  std::string source;  ///< the data of the study
  std::vector<files::PageTable> tables;
  std::vector<StudyClaim> claims;
  std::vector<StatementResult> statements;
  std::vector<files::PageChart> charts;
  std::vector<measurement::Warning> warnings;
  std::size_t fits = 0;  ///< number of identifications
  double seconds = 0;
};

/// done: identifications that are finished, of `all`.
using StudyProgress = std::function<void(std::size_t done, std::size_t all)>;

struct StudyOptions {
  std::uint64_t seed = 1;  ///< of the noise, and the first of the statistics
  std::size_t seeds = 20;  ///< cells of each kind; 0: no statistics and no success maps
};

/// The whole study on the plant, with 1 mV and 10 mA of noise.
StudyResult study_plant(const model::CellParameters<>& cell, const StudyOptions& options,
                        const StudyProgress& progress);

/// The same with models, optimisers and cross-validation on recordings instead of the plant. The models are identified
/// from the first recording and validated with the second. A recording from which nothing can be identified is left
/// out; a warning says why. Throws BadInput if fewer than two can be used.
StudyResult study_recordings(const model::CellParameters<>& cell, const std::vector<std::string>& paths,
                             const StudyOptions& options, const StudyProgress& progress);

}  // namespace bms::study
