#include "tool/recording_part.hpp"

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "measurement/cut.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

constexpr double longest_s = 1e12;
constexpr std::size_t fewest_rows = 10;  // of any recording

}  // namespace

void add_part(CLI::App& c, RecordingPart& part) {
  c.add_option("--from", part.from_s, "leave out what is earlier, in s since the first row")
      ->check(Within(0.0, longest_s))
      ->type_name("SECONDS");
  c.add_option("--until", part.until_s, "leave out what is later, in s since the first row")
      ->check(Within(0.0, longest_s))
      ->type_name("SECONDS");
}

void cut(const RecordingPart& part, measurement::Recording& recording) {
  if (!part.from_s && !part.until_s) return;
  const double duration_s = recording.duration_s();
  measurement::cut(recording, part.from_s.value_or(0), part.until_s.value_or(longest_s));
  if (recording.rows() >= fewest_rows) return;
  throw files::BadInput(
      part.until_s ? "--until" : "--from", 1,
      fmt::format("leaves {} rows of {:g} s, expected {} or more", recording.rows(), duration_s, fewest_rows));
}

}  // namespace bms::tool
