#include "study/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <fmt/format.h>

#include "files/cell_file.hpp"
#include "numerics/in_parallel.hpp"
#include "study/table_cells.hpp"

namespace bms::study {

namespace {

constexpr double sampled_ocv_s = 5;  // the OCV test lasts hours

/// Draws that are the same on every machine.
class Draws {
 public:
  explicit Draws(std::uint64_t seed) : random_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1p-53;
  }
  double logarithmic(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }
  /// Normal with this sigma, by the sum of twelve uniform values.
  double normal(double sigma) {
    double sum = -6;
    for (int k = 0; k < 12; ++k) sum += uniform(0, 1);
    return sigma * sum;
  }
  std::size_t below(std::size_t count) { return static_cast<std::size_t>(random_() % count); }

 private:
  std::mt19937_64 random_;
};

/// A contiguous third of a recording, of at most most_samples.
StudyData third_of(const StudyData& whole, Draws& draws) {
  constexpr std::size_t most_samples = 3'000;
  const std::size_t count = std::min(most_samples, whole.data.size() / 3),
                    from = draws.below(whole.data.size() - count);
  StudyData part{whole.name, {}, whole.soc_from, 1, 0};
  const id::Data& d = whole.data;
  double soc = whole.soc_from;
  for (std::size_t k = 0; k < from + count; ++k) {
    if (k > 0) soc += d.current_a[k] * (d.time_s[k] - d.time_s[k - 1]) / (3'600 * d.capacity_ah);
    if (k == from) part.soc_from = soc;
    if (k < from) continue;
    part.soc_min = std::min(part.soc_min, soc);
    part.soc_max = std::max(part.soc_max, soc);
  }
  part.data = {d.time_s.part(from, count), d.current_a.part(from, count), d.voltage_v.part(from, count), d.capacity_ah};
  return part;
}

Observations observe_recordings(const model::CellParameters<>& cell, const std::vector<StudyData>& recordings,
                                std::uint64_t seed) {
  Draws draws(seed);
  const std::size_t first = draws.below(recordings.size());
  const std::size_t second = (first + 1 + draws.below(recordings.size() - 1)) % recordings.size();
  Observations out;
  out.not_run = "the recordings are not the experiments of the paper";
  Fitter fitter(cell, 0, {});
  try {
    observe_models(fitter, third_of(recordings[first], draws), third_of(recordings[second], draws), out);
  } catch (const std::invalid_argument& error) {  // a third without excitation
    for (std::size_t k = 0; k < models; ++k) {
      if (!out.model[k] && out.no_model[k].empty()) out.no_model[k] = error.what();
    }
  }
  return out;
}

/// What the runs of one plant say about one statement.
StatementShare share_over(const std::string& plant, const std::string& id, const std::vector<Observations>& runs) {
  StatementShare s{plant, 0, 0, 0, 1, ""};
  for (const Observations& run : runs) {
    const Verdict verdict = judge(id, run);
    if (s.example.empty() || (!s.judged && verdict.holds)) s.example = verdict.why;
    if (!verdict.holds) continue;
    ++s.judged;
    s.holds += *verdict.holds ? 1 : 0;
  }
  const Share share = share_of(s.holds, s.judged);
  s.low = share.low;
  s.high = share.high;
  return s;
}

files::PageCell share_cell(const StatementShare& s) {
  if (s.judged == 0) return label("not judged: " + s.example);
  return {fmt::format("{} of {} ({:.0f} to {:.0f} %)", s.holds, s.judged, 100 * s.low, 100 * s.high),
          static_cast<double>(s.holds) / static_cast<double>(s.judged), std::nullopt};
}

}  // namespace

Bench drawn(const PlantKind& kind, std::uint64_t seed) {
  constexpr double spread = 0.05;
  Draws draws(seed);
  Bench b;
  b.r0_factor = std::exp(draws.normal(spread));
  b.r1_factor = std::exp(draws.normal(spread));
  b.c1_factor = std::exp(draws.normal(spread));
  b.short_c_rate = draws.uniform(0.4, 1);
  b.long_c_rate = draws.uniform(0.4, 1);
  b.ocv_c_rate = draws.uniform(0.4, 1);
  b.low_share = draws.uniform(0.1, 0.4);
  b.current_offset_a = draws.normal(0.020);
  b.start_branch = -1;  // 40 % is reached by discharge
  b.ocv_step_s = sampled_ocv_s;
  // drawn for every kind, so that the kinds differ in nothing else
  const double half_gap_v = draws.uniform(0.006, 0.020), decay = draws.logarithmic(20, 80);
  const double slow_ohm = draws.uniform(0.004, 0.016), slow_s = draws.logarithmic(300, 2'400);
  b.left_out.decay = decay;
  b.left_out.slow_s = slow_s;
  if (kind.hysteresis) b.left_out.half_gap_v = half_gap_v;
  if (kind.slow_polarisation) b.left_out.slow_ohm = slow_ohm;
  return b;
}

void add_statistics(const model::CellParameters<>& cell, std::size_t seeds, std::uint64_t first_seed,
                    const std::vector<StudyData>& recordings, StudyResult& result) {
  std::vector<std::string> names;
  for (const PlantKind& kind : plant_kinds) names.emplace_back(kind.name);
  if (recordings.size() >= 2) names.emplace_back("real recordings");
  // the simulated cells are the paper's, whatever cell the recordings are of
  const model::CellParameters<> paper_cell = files::read_cell("table9").parameters;
  std::vector<std::vector<Observations>> runs(names.size(), std::vector<Observations>(seeds));
  numerics::in_parallel(seeds, [&](std::size_t k) {
    constexpr std::uint64_t noise_seed = 1'000;
    const std::uint64_t seed = first_seed + k;
    PlantRuns of_seed;
    for (std::size_t plant = 0; plant < plant_kinds.size(); ++plant)
      runs[plant][k] = observe_bench(paper_cell, drawn(plant_kinds[plant], seed), noise_seed * seed, of_seed);
    if (recordings.size() >= 2) runs.back()[k] = observe_recordings(cell, recordings, seed);
  });
  files::PageTable table{
      "statements",
      fmt::format("Statements of the paper: share of {} cells of each kind in which they hold", seeds),
      {"statement", "in the paper", "holds if"},
      {},
      ""};
  table.head.insert(table.head.end(), names.begin(), names.end());
  for (const Statement& s : statements()) {
    std::vector<files::PageCell> row = {label(s.text), label(s.where), label(s.rule)};
    StatementResult of_statement{s.id, s.where, s.text, s.rule, {}};
    for (std::size_t plant = 0; plant < names.size(); ++plant) {
      of_statement.shares.push_back(share_over(names[plant], s.id, runs[plant]));
      row.push_back(share_cell(of_statement.shares.back()));
    }
    table.rows.push_back(std::move(row));
    result.statements.push_back(std::move(of_statement));
  }
  table.note =
      "Intervals: 95 %, Wilson. Each seed draws R0, R1, C1, the currents of the experiments, and noise; the kinds "
      "differ "
      "only in hysteresis and slow polarisation. Models and optimisers start from the paper's values with 20 "
      "iterations. "
      "The models receive the OCV that the test with ten minutes of rest gives. OCV tests are sampled every 5 s. A "
      "statement is not judged where one of its sides did not run.";
  result.tables.push_back(std::move(table));
  const std::size_t per_run = models * methods.size() + paper_experiments;
  result.fits += plant_kinds.size() * seeds * per_run + (recordings.size() >= 2 ? seeds * models * methods.size() : 0);
}

}  // namespace bms::study
