// How often the diagnosis of a pack names the planted cell and cause.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "benchmark/truth/packs.hpp"
#include "diagnosis/pack/pack_verdict.hpp"

namespace bms::benchmark {

/// One planted fault: what became of it.
struct PlantedOutcome {
  truth::PackFault fault;
  bool named = false;       ///< cell and cause right, as the first answer
  bool listed = false;      ///< not first, but among what else it could be: the answer is AMBIGUOUS
  bool foretold = false;    ///< listed, and the matrix of the diagnosis says that this recording cannot separate them
  bool cell_right = false;  ///< the cell, with any cause
  double limit = 0;         ///< smallest size of this cause that the diagnosis says it would name; 0: not stated
  bool below = false;       ///< not named, and smaller than that
  std::string instead;      ///< what was said of this cell, if another cause was named first
  double found = 0;         ///< size, if named
  double pull = 0;          ///< (size - truth) / sigma, if named
  double after_s = 0;       ///< time to name; 0: unknown
};

struct PackOutcome {
  std::string name;
  bool healthy = false;
  double hours = 0, wall_s = 0;
  std::size_t cells = 0;
  std::string verdict, statement;
  std::vector<PlantedOutcome> planted;
  std::vector<std::string> wrong;  ///< what was named, and neither it nor what else it could be was planted
};

PackOutcome score_pack(const truth::PackCase& c, const diagnosis::pack::PackDiagnosis& d);

/// The table of a run, as Markdown.
std::string pack_table(const std::vector<PackOutcome>& outcomes);
/// Every outcome as JSON.
std::string pack_json(const std::vector<PackOutcome>& outcomes);

}  // namespace bms::benchmark
