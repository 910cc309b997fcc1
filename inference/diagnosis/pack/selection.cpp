#include "diagnosis/pack/selection.hpp"

#include <algorithm>
#include <utility>

#include "diagnosis/pack/pack_thresholds.hpp"

namespace bms::diagnosis::pack {

namespace {

/// Without one of them.
std::vector<Accusation> without(std::vector<Accusation> list, const Accusation& one) {
  std::erase(list, one);
  return list;
}

std::vector<Accusation> with(std::vector<Accusation> list, const Accusation& one) {
  list.push_back(one);
  return list;
}

/// What a further cause in the same cell must gain in addition: the model of the first one is not exact.
double price(const PackLikelihood& likelihood, const std::vector<Accusation>& others, const Accusation& added) {
  double sum = 0;
  for (const Accusation& o : others) {
    if (!added.touches(o.cell) && !o.touches(added.cell)) continue;
    sum += limits.further_in_cell +
           limits.share_of_first * std::max(0.0, likelihood.gain(without(others, o), o, likelihood.last_checkpoint()));
  }
  return sum;
}

/// Offset, gain and sense wire: they explain the same constant errors of neighbouring channels.
bool is_of_channel(const Accusation& a) {
  return a.cause == Cause::offset || a.cause == Cause::gain || a.cause == Cause::sense_wire;
}

/// Returns true for two that would cancel at any size: two errors of one channel, or a wire and a channel at its end.
bool would_cancel(const Accusation& a, const Accusation& b) {
  if (a.cause == Cause::sense_wire && b.cause == Cause::sense_wire) return false;
  return a.touches(b.cell) || b.touches(a.cell);
}

/// Neighbouring cells that accusations of channels touch, first and last; ascending.
std::vector<std::pair<std::size_t, std::size_t>> groups_of(const PackLikelihood& likelihood,
                                                           const std::vector<Accusation>& chosen) {
  std::vector<std::pair<std::size_t, std::size_t>> groups;
  for (std::size_t c = 0; c < likelihood.cells(); ++c) {
    const bool touched =
        std::any_of(chosen.begin(), chosen.end(), [&](const auto& a) { return is_of_channel(a) && a.touches(c); });
    if (!touched) continue;
    if (groups.empty() || groups.back().second + 1 < c) groups.emplace_back(c, c);
    groups.back().second = c;
  }
  return groups;
}

/// Tries all small sets of accusations of the channels of a group. Changing one at a time can end where two wires or a
/// wire and an offset would be better.
class ChannelSets {
 public:
  ChannelSets(const PackLikelihood& likelihood, std::vector<Accusation> others, std::size_t first, std::size_t last)
      : likelihood_(likelihood), others_(std::move(others)) {
    const std::size_t from = first > 0 ? first - 1 : 0, end = std::min(likelihood.cells(), last + 2);
    for (std::size_t c = from; c < end; ++c) cells_.push_back(c);
    for (std::size_t c = first; c <= last; ++c) {
      candidates_.push_back({Cause::offset, c});
      candidates_.push_back({Cause::gain, c});
    }
    for (std::size_t c = from; c <= last && c + 1 < likelihood.cells(); ++c)
      candidates_.push_back({Cause::sense_wire, c});
  }

  /// The best set, at least as good as `now`.
  std::vector<Accusation> best(const std::vector<Accusation>& now) {
    best_ = now;
    best_value_ = value_of(now);
    std::vector<Accusation> set;
    extend(set, 0);
    return best_;
  }

 private:
  double value_of(const std::vector<Accusation>& set) const {
    return likelihood_.of(all(set), cells_, likelihood_.last_checkpoint()) -
           likelihood_.least_gain() * static_cast<double>(set.size());
  }
  std::vector<Accusation> all(const std::vector<Accusation>& set) const {
    std::vector<Accusation> list = others_;
    list.insert(list.end(), set.begin(), set.end());
    return list;
  }
  bool is_possible(const std::vector<Accusation>& set) const {
    return std::all_of(set.begin(), set.end(), [&](const Accusation& a) {
      return likelihood_.is_possible(a, likelihood_.size(all(set), a, likelihood_.last_checkpoint()));
    });
  }
  void extend(std::vector<Accusation>& set, std::size_t from) {
    if (set.size() == limits.channel_sets) return;
    for (std::size_t k = from; k < candidates_.size(); ++k) {
      const Accusation& a = candidates_[k];
      if (std::any_of(set.begin(), set.end(), [&](const Accusation& o) { return would_cancel(o, a); })) continue;
      set.push_back(a);
      const double value = value_of(set);
      if (value > best_value_ && is_possible(set)) {
        best_value_ = value;
        best_ = set;
      }
      extend(set, k + 1);
      set.pop_back();
    }
  }

  const PackLikelihood& likelihood_;
  std::vector<Accusation> others_, candidates_, best_;
  std::vector<std::size_t> cells_;
  double best_value_ = 0;
};

/// Each group of neighbouring cells with accusations of their channels: the best set of them.
void improve_groups(const PackLikelihood& likelihood, std::vector<Accusation>& chosen) {
  for (const auto& [first, last] : groups_of(likelihood, chosen)) {
    if (first == last || last - first >= limits.channel_group) continue;
    std::vector<Accusation> now, others;
    for (const Accusation& a : chosen)
      (is_of_channel(a) && a.cell >= first && a.cell <= last ? now : others).push_back(a);
    const std::vector<Accusation> better = ChannelSets(likelihood, others, first, last).best(now);
    chosen = others;
    chosen.insert(chosen.end(), better.begin(), better.end());
  }
}

}  // namespace

std::vector<Accusation> select(const PackLikelihood& likelihood, const std::vector<Accusation>& certain) {
  const std::size_t now = likelihood.last_checkpoint();
  std::vector<Accusation> chosen = certain;
  const auto is_certain = [&](const Accusation& a) {
    return std::find(certain.begin(), certain.end(), a) != certain.end();
  };
  const auto possible = [&](const std::vector<Accusation>& others, const Accusation& a) {
    const auto alike = [&](const Accusation& o) {
      const bool of_one_channel = is_of_channel(o) && is_of_channel(a) && would_cancel(o, a);
      return of_one_channel || (o.cell == a.cell && are_alike(o.cause, a.cause));
    };
    if (std::any_of(others.begin(), others.end(), alike)) return false;
    return likelihood.is_possible(a, likelihood.size(with(others, a), a, now));
  };
  const auto exchange = [&] {
    for (Accusation& a : chosen) {
      if (is_certain(a)) continue;
      const std::vector<Accusation> others = without(chosen, a);
      double best = likelihood.gain(others, a, now);
      for (const Accusation& rival : likelihood.rivals_of(a)) {
        if (std::find(chosen.begin(), chosen.end(), rival) != chosen.end()) continue;
        const double gain = likelihood.gain(others, rival, now);
        if (gain <= best || !possible(others, rival)) continue;
        best = gain;
        a = rival;
      }
    }
  };
  while (chosen.size() < limits.most_causes) {
    Accusation found;
    double best = likelihood.least_gain();
    bool any = false;
    for (std::size_t cell = 0; cell < likelihood.cells(); ++cell) {
      for (const Accusation& a : likelihood.candidates_at(cell)) {
        if (std::find(chosen.begin(), chosen.end(), a) != chosen.end()) continue;
        const double gain = likelihood.gain(chosen, a, now) - price(likelihood, chosen, a);
        if (gain <= best || !possible(chosen, a)) continue;
        best = gain;
        found = a;
        any = true;
      }
    }
    if (!any) break;
    chosen.push_back(found);
    exchange();
  }
  improve_groups(likelihood, chosen);
  std::erase_if(chosen, [&](const Accusation& a) {
    if (is_certain(a)) return false;
    const std::vector<Accusation> others = without(chosen, a);
    return likelihood.gain(others, a, now) < likelihood.least_gain() || !possible(others, a);
  });
  return chosen;
}

}  // namespace bms::diagnosis::pack
