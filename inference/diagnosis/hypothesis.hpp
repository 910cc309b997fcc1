// A hypothesis: the cell file plus a set of mechanisms with unknown parameters.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "diagnosis/mechanism.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

/// A parameter that a fit estimates.
struct ParameterRef {
  std::size_t setting = 0;    ///< in the hypothesis
  std::size_t parameter = 0;  ///< of its mechanism
  bool operator==(const ParameterRef&) const = default;
};

struct Hypothesis {
  std::vector<MechanismSetting> settings;        ///< the cell file's own, then those it adds
  std::size_t own = 0;                           ///< how many are the cell file's own: these are not estimated
  std::vector<std::vector<model::Span>> bursts;  ///< of a loose contact, by record

  std::vector<std::size_t> added() const;  ///< catalogue indices, ascending
  /// The setting of a mechanism, nullptr if it is missing.
  const MechanismSetting* find(std::size_t mechanism) const;
  /// The setting of the first mechanism with this kind of signature, nullptr if it is missing.
  const MechanismSetting* find(Signature signature) const;
  std::vector<ParameterRef> sought() const;  ///< estimated parameters
  bool operator==(const Hypothesis&) const = default;
  std::string name() const;  ///< ids joined by '+', "calibration" if it adds none
};

/// With this mechanism added, its strengths at their neutral values.
Hypothesis with(const Hypothesis& h, std::size_t mechanism, const model::CellParameters<>& cell);
/// With this setting added.
Hypothesis with(const Hypothesis& h, const MechanismSetting& setting);
/// Without a mechanism that it adds.
Hypothesis without(const Hypothesis& h, std::size_t mechanism);

}  // namespace bms::diagnosis
