// Times as testers and loggers write them, in seconds.
#pragma once

#include <optional>
#include <string_view>

namespace bms::files {

/// "12:34:56.789", "1-02:03:04", "1d 02:03:04.5", "02:03" (min:s), "11:59:59 PM": seconds. Nothing for another text.
std::optional<double> clock_s(std::string_view text);

/// Seconds since 1970-01-01 of a date with a time of day: "2026-03-05T06:00:00.5Z" (also with a zone, a space for the
/// T, slashes), "03/05/2026 06:00:00 PM", "05.03.2026 06:00:00". Of two numbers that may both be the month, the first
/// is the month unless day_first is set or the separator is a point. Nothing for another text.
std::optional<double> date_s(std::string_view text, bool day_first);

/// Seconds from 1970-01-01 to a date without a time of day, as date_s() reads it. Nothing for another text.
std::optional<double> day_of_text_s(std::string_view text, bool day_first);

}  // namespace bms::files
