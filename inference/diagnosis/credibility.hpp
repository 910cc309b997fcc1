// Whether a fitted mechanism may be named at all: its strength is known, and no cell contradicts it.
#pragma once

#include <cstddef>
#include <set>
#include <vector>

#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

/// Returns true if a mechanism's own strength does not carry it: each of its strengths, or the first one if the others
/// mean nothing without it, is at a bound or within two of its standard deviations of none. One without a standard
/// deviation was searched, and counts. certain: mechanisms that are there in any case, at whatever size.
bool is_weak(const HypothesisFit& f, std::size_t mechanism, const std::set<std::size_t>& certain);

/// Returns true if all strengths of a mechanism together are within two standard deviations of none, with those of
/// `certain` mechanisms fixed: of two that share an effect neither is known alone. One at a bound does not count.
bool is_uncertain(const HypothesisFit& f, std::size_t mechanism, const std::set<std::size_t>& certain);

/// Returns true if no cell or instrument is so, by what is known of the mechanism.
bool is_implausible(const HypothesisFit& f, std::size_t mechanism, const RecordingFacts& facts);

/// Returns true for a contact that is open only at the end of records, in the last twelfth of each
/// (thresholds.decision.end_share): bursts that begin there, or a change of a single record. At one current a lost
/// capacity or an offset of the current moves the knee there, and such a contact took its place.
bool is_at_the_end(const HypothesisFit& f, std::size_t mechanism, const std::vector<PreparedRecording>& records);

}  // namespace bms::diagnosis
