#include "measurement/soc_column_text.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace bms::measurement {

namespace {

std::string event_text(const SocEvent& e, double first_s, double capacity_ah) {
  const std::string time = fmt::format("{:.0f} s", e.time_s - first_s);
  switch (e.fault) {
    case SocFault::jump:
      return fmt::format("jumps by {:+.1f} % at {}", 100 * e.size, time);
    case SocFault::reset:
      return fmt::format("is set to 100 % at {}, {:.1f} % more than the charge explains", time, 100 * e.size);
    case SocFault::stuck:
      return fmt::format("does not move from {} on while {:.1f} % of the capacity flow", time, 100 * e.size);
    case SocFault::drift:
      return fmt::format("drifts from {} on, by {:+.1f} % until the end", time, 100 * e.size);
    case SocFault::capacity:
      return fmt::format("counts with {:.3g} Ah, not with {:.3g} Ah", e.size, capacity_ah);
    case SocFault::table:
      return fmt::format("follows the voltage, with changes of up to {:.1f} % that no charge explains", 100 * e.size);
  }
  return "";
}

}  // namespace

const char* name_of(SocFault fault) {
  constexpr std::array names = {"jump", "reset", "stuck", "drift", "capacity", "table"};
  return names[static_cast<std::size_t>(fault)];
}

std::string sentence_of(const SocColumn& column, double first_s, double capacity_ah) {
  if (column.is_count) return {};
  constexpr std::size_t most_named = 4;
  std::string text = column.contradicts() ? "The SOC column of the log is not a count of its current: it "
                                          : "The SOC column of the log and its current disagree: it ";
  for (std::size_t k = 0; k < std::min(most_named, column.events.size()); ++k)
    text += (k == 0 ? "" : ", ") + event_text(column.events[k], first_s, capacity_ah);
  if (column.events.size() > most_named) text += fmt::format(" and {} more", column.events.size() - most_named);
  if (column.contradicts()) return text + ".";
  const bool capacity = std::any_of(column.events.begin(), column.events.end(),
                                    [](const SocEvent& e) { return e.fault == SocFault::capacity; });
  return text +
         (capacity ? fmt::format("; its count, the current sensor or the capacity of {:.3g} Ah is wrong.", capacity_ah)
                   : "; its count or the current sensor is wrong.");
}

std::optional<SocColumn> own_soc_column(const Recording& recording, double capacity_ah) {
  if (recording.soc_ref.empty() || !recording.current_ref_a.empty()) return std::nullopt;
  return judge_soc_column(recording, capacity_ah);
}

void warn_of_soc_column(const std::optional<SocColumn>& column, const Recording& recording, double capacity_ah,
                        const std::string& before, std::vector<Warning>& warnings) {
  if (!column || column->is_count) return;
  warnings.push_back({"soc_column", before + sentence_of(*column, recording.time_s.front(), capacity_ah)});
}

}  // namespace bms::measurement
