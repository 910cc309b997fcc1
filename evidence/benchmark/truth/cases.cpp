#include "benchmark/truth/cases.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "benchmark/truth/case_draft.hpp"
#include "benchmark/truth/data_faults.hpp"
#include "benchmark/truth/effects.hpp"
#include "benchmark/truth/random_functions.hpp"

namespace bms::benchmark::truth {

namespace {

/// The place of a case in the composition.
struct Slot {
  CaseKind kind;
  std::size_t number;  ///< among the cases of its kind
};

/// The composition is shuffled, so that an index contains nothing about the answer.
Slot slot_of(Split split, std::uint64_t stream, std::size_t index) {
  using enum CaseKind;
  constexpr std::array round = {null, single, single, pair,       null, single, outside, null, single, single,
                                pair, null,   single, data_fault, null, single, pair,    null, single, outside};
  std::vector<std::size_t> order(case_count(split));
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  plant::Random random(stream);
  for (std::size_t k = order.size() - 1; k > 0; --k) std::swap(order[k], order[below(random, k + 1)]);
  const std::size_t place = order[index % order.size()];
  const CaseKind kind = round[place % round.size()];
  const auto in_round = static_cast<std::size_t>(std::count(round.begin(), round.end(), kind));
  const auto before = static_cast<std::size_t>(
      std::count(round.begin(), round.begin() + static_cast<std::ptrdiff_t>(place % round.size()), kind));
  return {kind, place / round.size() * in_round + before};
}

/// turn: where this split begins in the list of effects.
std::vector<const EffectKind*> draw_kinds(const Slot& slot, std::size_t turn, plant::Random& random) {
  const auto in_turn = [&](const std::vector<std::string>& ids) {
    return std::vector<const EffectKind*>{&effect_kind(ids[(slot.number + turn) % ids.size()])};
  };
  switch (slot.kind) {
    case CaseKind::single:
      return in_turn(catalogue_ids());
    case CaseKind::outside:
      return in_turn(outside_ids());
    case CaseKind::pair:
      return draw_pair(random);
    case CaseKind::null:
    case CaseKind::data_fault:
      break;
  }
  return {};
}

/// The first good one of a few drafts. Without a good one: the first draft, or for a pair the one with the largest
/// strength.
Case draw_case(const Slot& slot, std::size_t turn, plant::Random& random, Strengths strengths = {}) {
  constexpr int most_drafts = 6;
  const bool demanding = slot.kind == CaseKind::null && slot.number % 3 == 0;
  Draft best;
  for (int k = 0; k < most_drafts; ++k) {
    Draft next = draw_draft(slot.kind, demanding, draw_kinds(slot, turn, random), random, strengths);
    const bool good = next.good;
    const bool stronger = next.made.answer.strength > best.made.answer.strength;
    if (k == 0 || good || (slot.kind == CaseKind::pair && stronger)) best = std::move(next);
    if (good) break;
  }
  return std::move(best.made);
}

std::uint64_t stream_of(Split split, std::uint64_t seed) {
  return derived_seed(split == Split::development ? 0x6465'7665'6C6F'7000U : 0x6669'6E61'6C00'0000U, seed);
}

std::string name_of_case(Split split, std::size_t index) {
  const std::string digits = std::to_string(index);
  return (split == Split::development ? "development-" : "final-") +
         std::string(digits.size() < 3 ? 3 - digits.size() : 0, '0') + digits;
}

}  // namespace

std::size_t case_count(Split split) { return split == Split::development ? 120 : 240; }

Case make_case(Split split, std::uint64_t seed, std::size_t index) {
  const std::uint64_t stream = stream_of(split, seed);
  const Slot slot = slot_of(split, stream, index);
  plant::Random random(derived_seed(stream, index + 1));
  const std::size_t turn = static_cast<std::size_t>(stream % 1'009);

  Case made = draw_case(slot, turn, random);
  if (slot.kind == CaseKind::data_fault) {
    const DataFault& fault = data_faults[(slot.number + turn) % data_faults.size()];
    made.run_test = nullptr;
    made.answer.ids = {fault.name};
    fault.apply(made.recording, made.holdout, made.answer, random);
  }
  made.name = name_of_case(split, index);
  return made;
}

Case make_outside_case(Split split, std::uint64_t seed, std::size_t index) {
  constexpr std::uint64_t other_stream = 0x6F75'7473'6964'6500U;
  constexpr Strengths visible = {.least = 2.2, .most = 8};
  const std::uint64_t stream = derived_seed(stream_of(split, seed), other_stream);
  plant::Random random(derived_seed(stream, index + 1));
  Case made = draw_case({CaseKind::outside, index}, 0, random, visible);
  made.name = name_of_case(split, index);
  return made;
}

}  // namespace bms::benchmark::truth
