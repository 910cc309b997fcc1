#include "diagnosis/bursts.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "diagnosis/decision.hpp"

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
constexpr double most_loaded_share = 0.35;                             // bursts are the exception

/// Stretches that do not touch, best first, each worth its price at this resistance.
std::vector<Stretch> chosen(std::vector<Stretch> all, double ohm, std::size_t rows, double& total) {
  std::erase_if(all, [&](const Stretch& s) { return s.gain(ohm) <= decision::per_burst; });
  std::sort(all.begin(), all.end(), [&](const Stretch& a, const Stretch& b) { return a.gain(ohm) > b.gain(ohm); });
  std::vector<char> taken(rows + 1, 0);
  std::vector<Stretch> best;
  total = 0;
  for (const Stretch& s : all) {
    if (std::any_of(taken.begin() + static_cast<std::ptrdiff_t>(s.first), taken.begin() + static_cast<std::ptrdiff_t>(s.end + 1), [](char t) { return t != 0; })) continue;
    std::fill(taken.begin() + static_cast<std::ptrdiff_t>(s.first), taken.begin() + static_cast<std::ptrdiff_t>(s.end + 1), 1);
    total += s.gain(ohm) - decision::per_burst;
    best.push_back(s);
  }
  return best;
}

}  // namespace

std::vector<model::Span> find_bursts(const Record& record, const std::vector<double>& residual_v, const Whitener& whitener, double& found_ohm) {
  const std::size_t n = record.size();
  std::vector<double> residual(residual_v);
  for (double& v : residual) v = std::isfinite(v) ? v : 0;
  whitener.whiten(0, residual);
  double largest_a = 0;
  std::size_t loaded = 0;
  const auto current_a = [&](std::size_t k) { return std::isfinite(record.current_a[k]) ? record.current_a[k] : 0.0; };
  for (std::size_t k = 0; k < n; ++k) largest_a = std::max(largest_a, std::abs(current_a(k)));
  for (std::size_t k = 0; k < n; ++k) loaded += std::abs(current_a(k)) > 0.02 * largest_a ? 1 : 0;

  std::vector<Stretch> more, less;  // resistance
  std::vector<double> column;
  for (const std::size_t length : lengths) {
    for (std::size_t first = 0; first + length < n; first += std::max<std::size_t>(1, length / 4)) {
      column.assign(std::min(length + tail, n - first), 0);
      bool any = false;
      for (std::size_t k = 0; k < length; ++k) {
        column[k] = current_a(first + k);
        any = any || std::abs(column[k]) > 0.02 * largest_a;
      }
      if (!any) continue;
      whitener.whiten(first, column);
      Stretch s{first, first + length, 0, 0};
      for (std::size_t k = 0; k < column.size(); ++k) {
        s.toward += column[k] * residual[first + k];
        s.size += column[k] * column[k];
      }
      if (!(s.size > 0) || s.toward * s.toward <= decision::per_burst * s.size) continue;
      if (s.toward < 0) s.toward = -s.toward, less.push_back(s);
      else more.push_back(s);
    }
  }
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
  chosen(less, ohm, n, total);
  std::size_t inside = 0;
  for (const Stretch& s : best) inside += s.end - s.first;
  if (best.empty() || best_total < 2 * total + decision::detected || static_cast<double>(inside) > most_loaded_share * static_cast<double>(loaded)) return {};

  found_ohm = ohm;
  std::sort(best.begin(), best.end(), [](const Stretch& a, const Stretch& b) { return a.first < b.first; });
  std::vector<model::Span> spans;
  for (const Stretch& s : best) spans.push_back({record.time_s[s.first], record.time_s[s.end - 1]});
  return spans;
}

}  // namespace bms::diagnosis
