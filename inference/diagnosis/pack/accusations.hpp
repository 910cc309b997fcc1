// Which cells are accused of what: fits of all cells against the neighbours that are not accused.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/pack/cell_fit.hpp"
#include "diagnosis/pack/channels.hpp"
#include "diagnosis/pack/diagnose_pack.hpp"
#include "diagnosis/pack/pack_likelihood.hpp"
#include "diagnosis/pack/track.hpp"

namespace bms::diagnosis::pack {

/// The fits of all cells, and what they say of the pack.
struct PackState {
  const PackOptions& options;
  PackRecording& pack;
  Track track;
  Channels channels;
  std::vector<PackFinding> bad_sensors;
  std::vector<CellFit> fits;
  NoiseModel noise;
  std::vector<std::optional<NoiseModel>>
      own_noise;  ///< by cell, of a channel whose errors are larger than the typical ones'
  Vector healthy = Vector::Zero();
  std::vector<Accusation> late;  ///< channels that lag by whole rows: certain
  std::vector<Accusation> accused;
  std::optional<PackFinding> staggered;

  void progress(double share, const std::string& what) const {
    if (options.progress) options.progress(share, what);
  }
};

/// Sets fits, noise, healthy, accused and staggered. The track and the channels are set; lags that the fits do not
/// confirm are removed from them, and from late.
void fit_and_accuse(PackState& s);

PackLikelihood likelihood_of(const PackState& s);

/// The cells without accusations that are usual, or all usual ones if every one is accused. Ascending.
std::vector<std::size_t> reference_of(const PackState& s);

/// Channels that are read at different times; those that are accused or held do not count.
std::optional<PackFinding> staggered(const PackState& s, const PackLikelihood& likelihood);

}  // namespace bms::diagnosis::pack
