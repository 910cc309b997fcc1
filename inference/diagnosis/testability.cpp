#include "diagnosis/testability.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

bool reads_trusted(bool trusted_current, bool trusted_voltage, std::size_t mechanism) {
  if (!trusted_current && !trusted_voltage) return false;
  const std::string_view id = model::catalogue[mechanism].id;
  const bool of_current = id.starts_with("current_") || id == model::ChannelSkew::id,
             of_voltage = id.starts_with("voltage_") || id.starts_with("contact_");
  return (trusted_current && of_current) || (trusted_voltage && of_voltage);
}

std::optional<std::string> not_testable(const LikelihoodModel& likelihood, const Hypothesis& given,
                                        std::size_t mechanism) {
  const MechanismKnowledge& knowledge = knowledge_of(mechanism);
  if (knowledge.only_a_term) return "it is a term of an unknown cause";
  const RecordingFacts& facts = likelihood.facts();
  if (reads_trusted(facts.trusted_current, facts.trusted_voltage, mechanism))
    return "a trusted instrument's readings are used";
  // two with the same recording would grow without bounds in opposite directions
  const std::size_t same = knowledge.same_recording_as;
  if (same != no_mechanism && given.find(same) != nullptr && !facts.trusted_instruments)
    return fmt::format("without a trusted ammeter it cannot be distinguished from {}, which is there already",
                       model::catalogue[same].id);
  const bool follows_temperature =
      std::any_of(given.settings.begin(), given.settings.end(),
                  [](const MechanismSetting& s) { return knowledge_of(s.index).follows_temperature; });
  double temperature_sigma = 0;
  for (std::size_t k = 0; k < given.own; ++k) {
    const MechanismSetting& own = given.settings[k];
    temperature_sigma = std::max(temperature_sigma, knowledge_of(own.index).temperature_sigma(own));
  }
  return knowledge.not_testable(
      {.facts = facts, .follows_temperature = follows_temperature, .temperature_sigma = temperature_sigma});
}

std::optional<std::string> no_information(const LikelihoodModel& likelihood) {
  constexpr const Thresholds::Information& needed = thresholds.information;
  const RecordingFacts& facts = likelihood.facts();
  if (likelihood.used() < needed.readings) return fmt::format("only {} voltage readings are usable", likelihood.used());
  if (facts.duration_s < needed.duration_s) return fmt::format("the recording lasts only {:.0f} s", facts.duration_s);
  if (facts.loaded_rows < needed.loaded_rows) return "the cell rests all the time";
  if (facts.read_span_a < needed.current_span_c * facts.capacity_ah) return "the current does not change";
  return std::nullopt;
}

}  // namespace bms::diagnosis
