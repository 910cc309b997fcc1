// The options --from and --until: a part of a recording.
#pragma once

#include <optional>

#include <CLI/CLI.hpp>

#include "measurement/recording.hpp"

namespace bms::tool {

/// In s since the first row; empty: not given.
struct RecordingPart {
  std::optional<double> from_s, until_s;
};

/// --from and --until.
void add_part(CLI::App& command, RecordingPart& part);

/// Leaves the rows of that part. Throws BadInput if they are fewer than a recording has.
void cut(const RecordingPart& part, measurement::Recording& recording);

}  // namespace bms::tool
