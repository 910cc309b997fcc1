// The sentences of a diagnosis of a pack. Cells and sensors are counted from 1 in texts.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/pack/pack_verdict.hpp"

namespace bms::diagnosis::pack {

/// Id as in the JSON.
std::string id_of(const PackFinding& finding);
/// "cell 7", "the connection between cells 7 and 8", "temperature sensor 2", "the pack".
std::string place_of(const PackFinding& finding);
std::string place_of(Cause cause, std::size_t cell);
/// "12.0 ± 0.8 % less capacity than its neighbours".
std::string size_text(const PackFinding& finding);
/// One sentence with place, cause, size and probability.
std::string sentence_of(const PackFinding& finding);
/// What else it could be; empty if nothing is probable enough.
std::string rivals_text(const PackFinding& finding);
/// "Named after 42 min of recording."
std::string time_text(const PackFinding& finding);
/// One of the sizes that would be found: "capacity 5 %".
std::string limit_text(const PackLimit& limit);
/// "Smallest sizes that would be named: ... Not visible in this recording: ..."
std::string limits_text(const PackDiagnosis& d);
/// "Not visible in this recording: leakage, capacity_change."; empty if all causes have a limit.
std::string not_visible_text(const PackDiagnosis& d);
/// The statement of the whole diagnosis.
std::string statement_of(const PackDiagnosis& diagnosis);
/// What confirms that channels are held: the pack's voltmeter.
std::string confirmation_of(const Channels& channels, const std::vector<std::size_t>& cells);
/// Cells as a text: "1 to 96", "3, 7 and 9".
std::string cells_text(const std::vector<std::size_t>& cells);

}  // namespace bms::diagnosis::pack
