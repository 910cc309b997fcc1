// What was not named because of the healthy recordings, in words.
#pragma once

#include <string>

#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

/// Why one cause was not named: "healthy recordings show as much".
std::string reason_of(const Withheld& withheld, const Diagnosis& of);

/// What would have been named, why it is not, and what to do. error: "The model is off by 18.6 mV."
std::string withheld_text(const Diagnosis& diagnosis, const std::string& error);

/// A sentence for a verdict that names other causes; empty if nothing was withheld.
std::string also_withheld_text(const Diagnosis& diagnosis);

/// A sentence for a verdict that names causes which were not compared with the healthy recordings; empty otherwise.
std::string not_compared_text(const Diagnosis& diagnosis);

}  // namespace bms::diagnosis
