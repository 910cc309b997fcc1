#include "diagnosis/withheld_text.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "diagnosis/texts.hpp"

namespace bms::diagnosis {

namespace {

std::string hours_text(double hours) { return fmt::format("{:.{}f} h", hours, hours < 2 ? 1 : 0); }

std::string name_of(const Withheld& w) {
  return w.mechanism == no_mechanism ? "an unknown cause" : std::string(text_of_mechanism(w.mechanism).name);
}

/// "its temperature is 39 to 41 degrees C, that of the healthy ones 20 to 22"
std::string text_of(const BeyondHealthy& b) {
  if (b.axis == "soc")
    return fmt::format("its state of charge is {:.0f} to {:.0f} %, that of the healthy ones {:.0f} to {:.0f}",
                       100 * b.recorded.low, 100 * b.recorded.high, 100 * b.healthy.low, 100 * b.healthy.high);
  if (b.axis == "temperature_c")
    return fmt::format("its temperature is {:.0f} to {:.0f} degrees C, that of the healthy ones {:.0f} to {:.0f}",
                       b.recorded.low, b.recorded.high, b.healthy.low, b.healthy.high);
  return fmt::format("its current goes to {:.1f} A, that of the healthy ones to {:.1f}", b.recorded.high,
                     b.healthy.high);
}

/// "only 12 % of it lies at states of charge, ... of the healthy recordings: its temperature is ..."
std::string not_covered_reason(const HealthyBasis& healthy) {
  std::vector<std::string> beyond;
  for (const BeyondHealthy& b : healthy.covered.beyond) beyond.push_back(text_of(b));
  return fmt::format(
      "only {:.0f} % of the recording, of its rows or of their squared current, lies at states of charge, temperatures "
      "and currents of the healthy recordings{}{}",
      100 * healthy.covered.least, beyond.empty() ? "" : ": ", joined(beyond, "and"));
}

/// What would have been named, the largest gain first: the first ones in full, the others by name.
std::string withheld_causes(const Diagnosis& d) {
  std::vector<Withheld> causes = d.withheld;
  std::erase_if(causes, [](const Withheld& w) { return w.mechanism == no_mechanism; });
  if (causes.empty()) return "an unknown cause acts";
  std::stable_sort(causes.begin(), causes.end(), [](const Withheld& a, const Withheld& b) { return a.gain > b.gain; });
  std::vector<std::string> in_full, others;
  for (const Withheld& w : causes) {
    if (in_full.size() < text_style.causes_in_full)
      in_full.push_back(claim(w.setting));
    else
      others.push_back(name_of(w));
  }
  return joined(in_full, "and") + (others.empty() ? "" : ", next to " + joined(others, "and"));
}

}  // namespace

std::string reason_of(const Withheld& w, const Diagnosis& of) {
  const HealthyBasis healthy = of.healthy.value_or(HealthyBasis{});
  if (w.only_place)
    return fmt::format(
        "all that speaks for {} lies between {:.0f} and {:.0f} s, and no healthy recording of this cell says how wrong "
        "the model is there; about {} of them would decide",
        name_of(w), w.only_place->start_s, w.only_place->end_s, hours_text(w.healthy.hours_needed.value_or(0)));
  // more hours where they were would not decide
  if (w.not_covered || goes_beyond_healthy(of)) return not_covered_reason(healthy);
  if (w.healthy.hours_needed)
    return fmt::format("{} of healthy recordings are too little, about {} would do", hours_text(healthy.hours),
                       hours_text(*w.healthy.hours_needed));
  return "healthy recordings show as much";
}

std::string withheld_text(const Diagnosis& d, const std::string& error) {
  const std::string there = "Identify the cell again with healthy recordings there (bms identify --healthy).";
  // what more data would decide first
  const auto undecided = std::find_if(d.withheld.begin(), d.withheld.end(),
                                      [](const Withheld& w) { return w.not_covered || w.healthy.hours_needed; });
  if (undecided == d.withheld.end() && goes_beyond_healthy(d) && !d.withheld.empty())
    return fmt::format(
        "{} Without healthy recordings the answer would be that {}. Elsewhere they differ from the model as much, so "
        "this is not certain: {}. {}",
        error, withheld_causes(d), not_covered_reason(*d.healthy), there);
  if (undecided == d.withheld.end() && goes_beyond_healthy(d))
    return fmt::format(
        "Nothing stands out from the tolerance of the cell file, but more is not known of this recording: {}. {} "
        "Whether anything is wrong is not decided. {}",
        not_covered_reason(*d.healthy), error, there);
  if (undecided == d.withheld.end())
    return fmt::format(
        "{} Healthy recordings of this cell differ from the model as much, so no cause is named. Without "
        "them, {} would have been named. No action is needed.",
        error, name_of(d.withheld.front()));
  const std::string action = undecided->not_covered || goes_beyond_healthy(d)
                                 ? there
                                 : "Add healthy recordings of this cell (bms identify --healthy).";
  return fmt::format(
      "Not enough healthy data to blame anything: {}. {} Without a comparison {} would have been named. {}",
      reason_of(*undecided, d), error, name_of(*undecided), action);
}

std::string also_withheld_text(const Diagnosis& d) {
  if (d.withheld.empty()) return "";
  std::vector<std::string> names;
  for (const Withheld& w : d.withheld) names.push_back(name_of(w));
  return fmt::format(" Not named, because healthy recordings do not exclude as much: {}.", joined(names, "and"));
}

std::string not_compared_text(const Diagnosis& d) {
  if (!d.healthy || d.healthy->decided) return "";
  return " The healthy recordings of this cell were elsewhere and say nothing of it: it is named by the tolerance of "
         "the cell file alone, without a known false alarm rate.";
}

}  // namespace bms::diagnosis
