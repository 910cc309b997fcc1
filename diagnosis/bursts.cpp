#include "diagnosis/bursts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "diagnosis/decision.hpp"
#include "diagnosis/hypothesis.hpp"

namespace bms::diagnosis {

namespace {

/// A stretch of rows and what the residual says of a resistance in it: gain of r is 2 r toward - r^2 size.
struct Stretch {
  std::size_t first = 0, end = 0;
  double toward = 0, size = 0;
  double gain(double ohm) const { return 2 * ohm * toward - ohm * ohm * size; }
};

constexpr std::array<std::size_t, 6> lengths = {2, 4, 8, 16, 32, 64};  // rows
constexpr std::size_t tail = 40;                                       // rows in which a stretch's end rings out
constexpr std::size_t fewest_rows = 3;                                 // one bad reading is no contact
constexpr double most_loaded_share = 0.35;                             // bursts are the exception
constexpr std::size_t beside = 64;  // rows around a step of the current in which the model itself may be off
constexpr double chance = 0.01;     // of loose moments that fall beside steps as often as these

/// Stretches that do not touch, best first, each worth its price at this resistance.
std::vector<Stretch> chosen(std::vector<Stretch> all, double ohm, std::size_t rows, double& total) {
  std::erase_if(all, [&](const Stretch& s) { return s.gain(ohm) <= decision::per_burst; });
  std::sort(all.begin(), all.end(), [&](const Stretch& a, const Stretch& b) { return a.gain(ohm) > b.gain(ohm); });
  std::vector<char> taken(rows + 1, 0);
  std::vector<Stretch> best;
  total = 0;
  for (const Stretch& s : all) {
    if (std::any_of(taken.begin() + static_cast<std::ptrdiff_t>(s.first),
                    taken.begin() + static_cast<std::ptrdiff_t>(s.end + 1), [](char t) { return t != 0; }))
      continue;
    std::fill(taken.begin() + static_cast<std::ptrdiff_t>(s.first),
              taken.begin() + static_cast<std::ptrdiff_t>(s.end + 1), 1);
    total += s.gain(ohm) - decision::per_burst;
    best.push_back(s);
  }
  return best;
}

/// Probability that at least `hits` of `of` fall where a share of all is.
double as_many(std::size_t of, std::size_t hits, double share) {
  double sum = 0;
  for (std::size_t k = hits; k <= of; ++k) {
    const double n = static_cast<double>(of), h = static_cast<double>(k);
    sum += std::exp(std::lgamma(n + 1) - std::lgamma(h + 1) - std::lgamma(n - h + 1)) * std::pow(share, h) *
           std::pow(1 - share, n - h);
  }
  return sum;
}

}  // namespace

std::vector<model::Span> find_bursts(const PreparedRecording& record, const std::vector<double>& residual_v,
                                     const Whitener& whitener, double& found_ohm) {
  const std::size_t n = record.size();
  std::vector<double> residual(residual_v);
  for (double& v : residual) v = std::abs(v) < runaway_v ? v : 0;
  whitener.whiten(0, residual);
  double largest_a = 0;
  std::size_t loaded = 0;
  const auto current_a = [&](std::size_t k) { return std::isfinite(record.current_a[k]) ? record.current_a[k] : 0.0; };
  for (std::size_t k = 0; k < n; ++k) largest_a = std::max(largest_a, std::abs(current_a(k)));
  for (std::size_t k = 0; k < n; ++k) loaded += std::abs(current_a(k)) > 0.02 * largest_a ? 1 : 0;

  // every stretch in which the residual asks for more (or for less) resistance than its price
  std::vector<double> column;
  const auto stretch = [&](std::size_t first, std::size_t end) {
    Stretch s{first, end, 0, 0};
    column.assign(std::min(end - first + tail, n - first), 0);
    bool any = false;
    for (std::size_t k = 0; k < end - first; ++k) {
      column[k] = current_a(first + k);
      any = any || std::abs(column[k]) > 0.02 * largest_a;
    }
    if (!any) return s;
    whitener.whiten(first, column);
    for (std::size_t k = 0; k < column.size(); ++k) {
      s.toward += column[k] * residual[first + k];
      s.size += column[k] * column[k];
    }
    return s;
  };
  const auto stretches = [&](bool more) {
    std::vector<Stretch> found;
    for (const std::size_t length : lengths) {
      for (std::size_t first = 0; first + length < n; first += std::max<std::size_t>(1, length / 4)) {
        Stretch s = stretch(first, first + length);
        if (!more) s.toward = -s.toward;
        if (s.toward > 0 && s.toward * s.toward > decision::per_burst * s.size) found.push_back(s);
      }
    }
    return found;
  };
  const std::vector<Stretch> more = stretches(true);
  if (more.empty()) return {};

  // one resistance for all
  std::vector<Stretch> best;
  double best_total = 0, ohm = 0, total = 0;
  std::vector<double> sizes_ohm;
  for (const Stretch& s : more) sizes_ohm.push_back(s.toward / s.size);
  std::sort(sizes_ohm.begin(), sizes_ohm.end());
  for (const double share : {0.05, 0.15, 0.25, 0.35, 0.5, 0.65, 0.75, 0.85, 0.95}) {
    double r = sizes_ohm[static_cast<std::size_t>(share * static_cast<double>(sizes_ohm.size() - 1))];
    for (int round = 0; round < 3; ++round) {
      std::vector<Stretch> here = chosen(more, r, n, total);
      if (total > best_total) best_total = total, ohm = r, best = here;
      double toward = 0, size = 0;
      for (const Stretch& s : here) toward += s.toward, size += s.size;
      if (!(size > 0)) break;
      r = toward / size;
    }
  }
  if (best.empty()) return {};
  // where each begins and ends, to the row
  for (int round = 0; round < 2; ++round) {
    double toward = 0, size = 0;
    for (Stretch& s : best) {
      for (bool moved = true; moved;) {
        moved = false;
        for (const auto& [by_first, by_end] :
             {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-2, 0}, {2, 0}, {0, -2}, {0, 2}}) {
          const auto first = static_cast<std::ptrdiff_t>(s.first) + by_first,
                     end = static_cast<std::ptrdiff_t>(s.end) + by_end;
          if (first < 0 || end <= first || end >= static_cast<std::ptrdiff_t>(n)) continue;
          const Stretch there = stretch(static_cast<std::size_t>(first), static_cast<std::size_t>(end));
          if (!(there.gain(ohm) > s.gain(ohm) + 1e-9))
            continue;  // nor where there is no number: it would go to and fro for ever
          s = there;
          moved = true;
        }
      }
      toward += s.toward, size += s.size;
    }
    ohm = toward / size;
  }
  std::size_t inside = 0;
  for (const Stretch& s : best) inside += s.end - s.first;
  if (inside < fewest_rows || static_cast<double>(inside) > most_loaded_share * static_cast<double>(loaded)) return {};

  // a contact opens when it likes; what comes with the steps of the current is how the cell answers them
  std::vector<char> near_step(n, 0);
  for (std::size_t k = 1; k < n; ++k) {
    if (std::abs(current_a(k) - current_a(k - 1)) < 0.2 * largest_a) continue;
    for (std::size_t j = k > beside ? k - beside : 0; j < std::min(n, k + beside); ++j) near_step[j] = 1;
  }
  double loaded_near = 0;
  for (std::size_t k = 0; k < n; ++k)
    loaded_near += near_step[k] != 0 && std::abs(current_a(k)) > 0.02 * largest_a ? 1 : 0;
  std::size_t bursts_near = 0;
  for (const Stretch& s : best) bursts_near += near_step[(s.first + s.end) / 2] != 0 ? 1 : 0;
  if (as_many(best.size(), bursts_near, loaded_near / static_cast<double>(std::max<std::size_t>(loaded, 1))) < chance)
    return {};

  // what then still asks for less than there is: as much as that chance does for more
  column.assign(n, 0);
  for (const Stretch& s : best) {
    for (std::size_t k = s.first; k < s.end; ++k) column[k] = ohm * current_a(k);
  }
  whitener.whiten(0, column);
  for (std::size_t k = 0; k < n; ++k) residual[k] -= column[k];
  chosen(stretches(false), ohm, n, total);
  if (best_total < 2 * total + decision::detected) return {};

  found_ohm = ohm;
  std::sort(best.begin(), best.end(), [](const Stretch& a, const Stretch& b) { return a.first < b.first; });
  std::vector<model::Span> spans;
  for (const Stretch& s : best) {
    if (!spans.empty() && record.time_s[s.first] <= spans.back().end_s)
      spans.back().end_s = std::max(spans.back().end_s, record.time_s[s.end - 1]);
    else
      spans.push_back({record.time_s[s.first], record.time_s[s.end - 1]});
  }
  return spans;
}

}  // namespace bms::diagnosis
