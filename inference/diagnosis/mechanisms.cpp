// The table of what is known of each mechanism, in the catalogue's order.
#include <algorithm>
#include <array>
#include <tuple>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/mechanisms/all.hpp"

namespace bms::diagnosis {

namespace {

using Table = std::array<MechanismKnowledge, model::mechanism_count>;

template <class M>
constexpr MechanismKnowledge knowledge() {
  using K = Knowledge<M>;
  return {.text = K::text,
          .signature = K::signature,
          .probes_places = K::probes_places,
          .follows_temperature = K::follows_temperature,
          .outside_cell = K::outside_cell,
          .report_limit = K::report_limit,
          .facts = K::facts,
          .same_recording_as = K::same_recording_as,
          .needs_first_strength = K::needs_first_strength,
          .only_a_term = K::only_a_term,
          .searched_unknowns = K::searched_unknowns,
          .claim = K::claim,
          .temperature_sigma = K::temperature_sigma,
          .probing_shapes = K::probing_shapes,
          .forms = K::forms,
          .choose_form = K::choose_form,
          .known = K::known,
          .adjust_probe = K::adjust_probe,
          .start = K::start,
          .not_testable = K::not_testable,
          .far_starts = K::far_starts,
          .joint_start = K::joint_start,
          .bounds = K::bounds,
          .expected = K::expected,
          .prior_gain = K::prior_gain,
          .is_implausible = K::is_implausible,
          .carry_over = K::carry_over,
          .after_full_charge = K::after_full_charge,
          .capacity_share = K::capacity_share};
}

template <class... M>
constexpr Table table_of(std::tuple<M...>*) {
  return {knowledge<M>()...};
}

constexpr Table table = table_of(static_cast<model::Catalogue*>(nullptr));

constexpr bool complete() {
  for (std::size_t m = 0; m < table.size(); ++m) {
    if (table[m].text.id != model::catalogue[m].id || table[m].text.name.empty()) return false;
  }
  return true;
}
static_assert(complete(), "each mechanism of the catalogue has an entry with its own id and a name");

}  // namespace

const MechanismKnowledge& knowledge_of(std::size_t mechanism) { return table[mechanism]; }

std::size_t first_with(Signature signature) {
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const MechanismKnowledge& k) { return k.signature == signature; });
  return static_cast<std::size_t>(found - table.begin());
}

}  // namespace bms::diagnosis
