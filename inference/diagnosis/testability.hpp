// Which mechanisms recordings can test at all.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "diagnosis/hypothesis.hpp"
#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

/// Returns true if it is an error of an instrument in whose place a trusted one is read.
bool reads_trusted(bool trusted_current, bool trusted_voltage, std::size_t mechanism);

/// Why these recordings cannot test a mechanism in addition to those given; nothing if they can.
std::optional<std::string> not_testable(const LikelihoodModel& likelihood, const Hypothesis& given,
                                        std::size_t mechanism);

/// Why these recordings cannot test anything; nothing if they can.
std::optional<std::string> no_information(const LikelihoodModel& likelihood);

}  // namespace bms::diagnosis
