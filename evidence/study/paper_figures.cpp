#include "study/paper_figures.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identification/rest_reading.hpp"
#include "study/paper_tables.hpp"

namespace bms::study {

namespace {

constexpr std::array<const char*, 3> circuit = {"r0_ohm", "r1_ohm", "c1_f"};
constexpr double read_soc = 0.8, ocv_soc = 0.4;
constexpr int scales = 3;

/// What a source of the figures has to give, published or simulated.
struct Source {
  std::array<std::array<double, paper_experiments>, paper_experiments> fit{};
  std::array<std::array<double, 4>, paper_experiments> deviation{};  ///< R0, R1, C1, output
  std::array<double, 3> ocv_circuit{}, appendix{};                   ///< R0, R1, C1
  double estimation_fit = 0, validation_fit = 0;
};

/// Designs with rests, bursts, OCV test.
int scale_of(std::size_t experiment) {
  constexpr std::size_t with_rests = 3;
  if (experiment == ocv_experiment) return scales;
  return experiment < with_rests ? 1 : 2;
}

std::vector<Figure> listed(const Source& s) {
  std::vector<Figure> all;
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    for (std::size_t column = 0; column < paper_experiments; ++column) {
      all.push_back({FigureGroup::table7, fmt::format("{} on {}", experiment_names[row], experiment_names[column]),
                     s.fit[row][column], true, 0});
    }
  }
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    for (std::size_t k = 0; k < 4; ++k) {
      const bool output = k == 3;
      all.push_back({FigureGroup::table8,
                     fmt::format("{} of {}", output ? "output" : circuit[k], experiment_names[row]),
                     s.deviation[row][k], false, output ? 0 : scale_of(row)});
    }
  }
  for (std::size_t k = 0; k < 3; ++k) all.push_back({FigureGroup::table6, circuit[k], s.ocv_circuit[k], false, 0});
  all.push_back({FigureGroup::table5, "estimation", s.estimation_fit, true, 0});
  all.push_back({FigureGroup::table5, "validation", s.validation_fit, true, 0});
  for (std::size_t k = 0; k < 3; ++k) all.push_back({FigureGroup::appendix_a, circuit[k], s.appendix[k], false, 0});
  return all;
}

/// The circuit by the points of Appendix A at the rest nearest to 80 %.
std::array<double, 3> appendix_of(const StudyData& test) {
  double soc = test.soc_from, nearest = 1;
  std::array<double, 3> found{};
  const id::RestReadings readings = id::read_rests(test.data);
  std::size_t k = 0;
  for (const id::RestReading& rest : readings.rests) {
    for (; k + 1 < test.data.size() && test.data.time_s[k + 1] <= rest.time_s; ++k)
      soc += test.data.current_a[k + 1] * (test.data.time_s[k + 1] - test.data.time_s[k]) /
             (3'600 * test.data.capacity_ah);
    if (std::abs(soc - read_soc) > nearest) continue;
    nearest = std::abs(soc - read_soc);
    found = {rest.points.r0_ohm, rest.points.r1_ohm, rest.points.c1_f};
  }
  return found;
}

TwoLevels levels_of(std::size_t experiment, const PulseDesigns& p) {
  constexpr double one_c_a = 6;
  constexpr std::array<double, 3> rest_s = {30, 18, 5}, high_s = {60, 30, 30}, low_s = {30, 30, 60};
  if (experiment < rest_s.size()) return {-one_c_a * p.pulse_c_rate, p.pulse_s, 0, rest_s[experiment], p.duration_s};
  const std::size_t k = experiment - rest_s.size();
  const double high_a = -one_c_a * p.high_c_rate;
  return {high_a, high_s[k], high_a * (1 - p.swing), low_s[k], p.duration_s};
}

/// Everything of the cell and its instruments that data of any experiment depend on.
std::vector<double> numbers_of(const Bench& b, std::uint64_t seed) {
  return {static_cast<double>(seed), b.start_branch,     b.r0_factor,         b.r1_factor,       b.c1_factor,
          b.left_out.half_gap_v,     b.left_out.decay,   b.left_out.slow_ohm, b.left_out.slow_s, b.voltage_noise_v,
          b.current_noise_a,         b.current_offset_a, b.pulse_step_s,      b.ocv_step_s};
}

void add(std::vector<double>& numbers, std::initializer_list<double> more) { numbers.insert(numbers.end(), more); }

void add(std::vector<double>& numbers, const model::OcvTable<double>& ocv) {
  for (std::size_t k = 0; k < ocv.b0_v.size; ++k) add(numbers, {ocv.soc[k + 1], ocv.b0_v[k], ocv.b1_v[k]});
}

/// The OCV test with ten minutes of rest, and what the paper has from it.
PaperRuns::OcvTest ocv_test(const model::CellParameters<>& cell, const PaperCandidate& candidate, PlantRuns& plant) {
  constexpr int steps = 10;
  const StudyData test = run_ocv_test(steps, candidate.bench, candidate.seed, false, &plant);
  PaperRuns::OcvTest out;
  model::CellParameters<> given = cell;
  given.ocv = id::even_pieces(points_of(id::rested_voltages(test.data, 1), id::OcvDirection::discharge));
  for (std::size_t k = 0; candidate.other_ocv && k < given.ocv.b0_v.size; ++k) {
    given.ocv.b0_v[k] = paper_table(1).at(k, 0);
    given.ocv.b1_v[k] = paper_table(1).at(k, 1);
  }
  out.ocv = given.ocv;
  const StudyData estimation = window(test, "", 0.8, 0.5), validation = window(test, "", 0.5, 0.2);
  const FromData from(given, estimation);
  for (std::size_t k = 0; k < 3; ++k) out.circuit[k] = from.found().parameters[k].value;
  out.estimation_fit = from.found().estimation.fit_percent;
  out.validation_fit = from.fit_to(validation, {validation.soc_from, 0, 0, true});
  out.appendix = appendix_of(test);
  return out;
}

const PaperRuns::OcvTest& ocv_test_of(const model::CellParameters<>& cell, const PaperCandidate& c, PaperRuns& runs) {
  std::vector<double> numbers = numbers_of(c.bench, c.seed);
  add(numbers, {c.bench.ocv_c_rate, c.other_ocv ? 1.0 : 0.0});
  return runs.ocv_tests.of(numbers, [&] { return ocv_test(cell, c, runs.plant); });
}

/// The OCV as the line that it has at 40 %.
model::OcvTable<double> line_at_40(model::OcvTable<double> ocv) {
  const std::size_t at_40 = model::cell_detail::ocv_piece(ocv, ocv_soc - 0.05);
  const double b0_v = ocv.b0_v[at_40], b1_v = ocv.b1_v[at_40];
  for (std::size_t k = 0; k < ocv.b0_v.size; ++k) {
    ocv.b0_v[k] = b0_v;
    ocv.b1_v[k] = b1_v;
  }
  return ocv;
}

/// One of the six pulse designs.
const FromData& from_pulses(const model::CellParameters<>& given, std::size_t k, const PaperCandidate& c,
                            PaperRuns& runs) {
  constexpr double pulse_soc = 0.41;
  const std::uint64_t seed = c.seed + 1 + k;
  const TwoLevels levels = levels_of(k, c.pulses);
  std::vector<double> numbers = numbers_of(c.bench, seed);
  add(numbers,
      {static_cast<double>(k), levels.first_a, levels.first_s, levels.second_a, levels.second_s, levels.duration_s});
  add(numbers, given.ocv);
  return runs.identified.of(numbers, [&] {
    return FromData(given, run_two_levels(experiment_names[k], levels, pulse_soc, c.bench, seed, runs.plant));
  });
}

/// The part of the OCV test with rests of an hour around 40 %.
const FromData& from_hour_rests(const model::CellParameters<>& given, const PaperCandidate& c, PaperRuns& runs) {
  const std::uint64_t seed = c.seed + 1 + ocv_experiment;
  std::vector<double> numbers = numbers_of(c.bench, seed);
  add(numbers, {static_cast<double>(ocv_experiment), c.bench.ocv_c_rate, c.bench.low_share, c.ocv_half_window});
  add(numbers, given.ocv);
  return runs.identified.of(numbers, [&] {
    Bench bench = c.bench;
    bench.ocv_step_s *= 2;  // it lasts nine hours
    const StudyData hour = run_on_bench(experiment_names[ocv_experiment], 1, bench, seed, 0.01, &runs.plant);
    return FromData(given, window(hour, "", std::min(1.0, ocv_soc + c.ocv_half_window), ocv_soc - c.ocv_half_window));
  });
}

double fit_of(const FromData& from, const FromData& other, PaperRuns& runs) {
  const auto [at, is_new] = runs.fits.try_emplace({&from, &other}, 0);
  if (is_new) at->second = from.fit_to(other.part(), other.found().initial.front());
  return at->second;
}

/// Finite and of a size that a logarithm can have.
double sane(double value) { return std::isfinite(value) ? std::max(value, 1e-9) : 1e-9; }

}  // namespace

std::vector<Figure> published_figures() {
  Source s;
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    for (std::size_t k = 0; k < paper_experiments; ++k) s.fit[row][k] = paper_table(7).at(row, k);
    for (std::size_t k = 0; k < 4; ++k) s.deviation[row][k] = paper_table(8).at(row, k);
  }
  for (std::size_t k = 0; k < 3; ++k) s.ocv_circuit[k] = paper_table(6).at(grey_box_model, k);
  s.estimation_fit = paper_table(5).at(grey_box_model, 0);
  s.validation_fit = paper_table(5).at(grey_box_model, 1);
  s.appendix = {paper_start.r0_ohm, paper_start.r1_ohm, paper_start.c1_f};
  return listed(s);
}

std::vector<Figure> figures_of(const model::CellParameters<>& cell, const PaperCandidate& candidate, PaperRuns& runs) {
  Source s;
  const PaperRuns::OcvTest& test = ocv_test_of(cell, candidate, runs);
  s.ocv_circuit = test.circuit;
  s.appendix = test.appendix;
  s.estimation_fit = test.estimation_fit;
  s.validation_fit = test.validation_fit;

  model::CellParameters<> given = cell;
  given.ocv = candidate.whole_ocv ? test.ocv : line_at_40(test.ocv);
  std::array<const FromData*, paper_experiments> identified{};
  for (std::size_t k = 0; k < ocv_experiment; ++k) identified[k] = &from_pulses(given, k, candidate, runs);
  identified[ocv_experiment] = &from_hour_rests(given, candidate, runs);
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    const FromData& from = *identified[row];
    const id::FitStatistics& own = from.found().estimation;
    for (std::size_t k = 0; k < paper_experiments; ++k)
      s.fit[row][k] = k == row ? own.fit_percent : fit_of(from, *identified[k], runs);
    std::copy(from.unit_deviation().begin(), from.unit_deviation().end(), s.deviation[row].begin());
    s.deviation[row][3] = std::sqrt(own.output_variance_v2);
  }
  return listed(s);
}

std::vector<double> differences(const std::vector<Figure>& simulated, const std::vector<Figure>& published) {
  constexpr double most = 2;
  std::vector<double> d(published.size());
  std::array<double, scales + 1> shift{}, shifted{};
  const auto scale = [&](std::size_t k) { return static_cast<std::size_t>(published[k].scale); };
  for (std::size_t k = 0; k < d.size(); ++k) {
    const auto size = [&](const Figure& f) { return std::log(sane(f.is_fit ? 100 - f.value : f.value)); };
    d[k] = size(simulated[k]) - size(published[k]);
    shift[scale(k)] += d[k];
    ++shifted[scale(k)];
  }
  for (std::size_t k = 0; k < d.size(); ++k) {
    if (published[k].scale != 0) d[k] -= shift[scale(k)] / shifted[scale(k)];
    d[k] = std::clamp(d[k], -most, most);
  }
  return d;
}

}  // namespace bms::study
