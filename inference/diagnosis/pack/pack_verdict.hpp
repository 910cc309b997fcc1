// The result of the diagnosis of a pack.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/pack/causes.hpp"
#include "diagnosis/pack/channels.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis::pack {

struct Rival {
  Cause cause = Cause::imbalance;
  std::optional<std::size_t> cell;  ///< nothing: all cells
  double probability = 0;
};

/// A cell, a sensor or the pack, and what is wrong with it. Cells and sensors are counted from 0.
struct PackFinding {
  Cause cause = Cause::imbalance;
  std::optional<std::size_t> cell;  ///< nothing: the whole pack; of a thermistor: its number
  std::vector<std::size_t> cells;   ///< all channels that show it, if there are several
  double value = 0, sigma = 0;      ///< in CauseText::unit
  double probability = 0;
  double gain = 0;                ///< log likelihood ratio
  std::vector<Rival> rivals;      ///< what else it could be, the most probable first
  std::optional<double> after_s;  ///< time of recording from which on the verdict was the same
  std::string because;            ///< what confirms it
  std::string id;                 ///< of a shared cause; else that of text_of()
};

/// Which causes this pack's sensors can distinguish on this recording, for a typical cell.
struct Isolability {
  std::vector<Cause> causes;
  std::vector<std::vector<bool>> separable;  ///< the diagonal: detectable at all
  struct Sensor {
    std::string name;
    std::size_t pairs = 0;  ///< that can be separated in addition
  };
  std::vector<Sensor> added;  ///< the most useful first
};

/// Smallest size that would be named in a typical cell.
struct PackLimit {
  Cause cause = Cause::imbalance;
  double value = 0;
};

/// Largest relation of a cell's unexplained difference to that of its neighbours.
struct UnexplainedCell {
  std::size_t cell = 0;
  double rms_v = 0, usual_v = 0;
};

struct PackDiagnosis {
  Verdict verdict = Verdict::not_testable;
  std::string statement;
  std::vector<PackFinding> findings;  ///< faults of the data first
  std::vector<UnexplainedCell> unexplained;
  Channels channels;
  std::string current_sensor;  ///< what the mean of the cells shows of it, or why it was not tested
  Isolability isolability;
  std::vector<PackLimit> detection_limits;
  std::vector<Cause> not_visible;      ///< causes that no possible size would show in this recording
  std::vector<std::size_t> reference;  ///< cells that served as the neighbours
  bool is_finite = true;               ///< false: numbers of a cell's comparison are not, and there is no answer
  bool another_cell = false;           ///< the OCV of the file is not that of these cells
  double noise_v = 0;                  ///< RMS of the difference between healthy cells, what the model does not explain
  double duration_s = 0;
  std::size_t cells = 0;
};

}  // namespace bms::diagnosis::pack
