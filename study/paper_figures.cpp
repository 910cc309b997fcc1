#include "study/paper_figures.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identification/rest_reading.hpp"
#include "study/paper_tables.hpp"

namespace bms::study {

namespace {

constexpr std::array<const char*, 3> circuit = {"r0_ohm", "r1_ohm", "c1_f"};
constexpr double read_soc = 0.8;

/// What a source of the figures has to give, published or simulated.
struct Source {
  std::array<std::array<double, paper_experiments>, paper_experiments> fit{};
  std::array<std::array<double, 4>, paper_experiments> deviation{};  ///< R0, R1, C1, output
  std::array<double, 3> ocv_circuit{}, appendix{};                   ///< R0, R1, C1
  double estimation_fit = 0, validation_fit = 0;
};

std::vector<Figure> listed(const Source& s) {
  std::vector<Figure> all;
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    for (std::size_t column = 0; column < paper_experiments; ++column) {
      all.push_back({FigureGroup::table7, fmt::format("{} on {}", experiment_names[row], experiment_names[column]),
                     s.fit[row][column], true, false});
    }
  }
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    for (std::size_t k = 0; k < 4; ++k) {
      const bool output = k == 3;
      all.push_back({FigureGroup::table8,
                     fmt::format("{} of {}", output ? "output" : circuit[k], experiment_names[row]),
                     s.deviation[row][k], false, !output});
    }
  }
  for (std::size_t k = 0; k < 3; ++k) all.push_back({FigureGroup::table6, circuit[k], s.ocv_circuit[k], false, false});
  all.push_back({FigureGroup::table5, "estimation", s.estimation_fit, true, false});
  all.push_back({FigureGroup::table5, "validation", s.validation_fit, true, false});
  for (std::size_t k = 0; k < 3; ++k) all.push_back({FigureGroup::appendix_a, circuit[k], s.appendix[k], false, false});
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

std::vector<Figure> figures_of(const model::CellParameters<>& cell, const PaperCandidate& candidate) {
  constexpr double pulse_soc = 0.41;
  constexpr int ocv_steps = 10;
  Bench bench = candidate.bench;
  Source s;
  const StudyData test = run_ocv_test(ocv_steps, bench, 1, false);
  Fitter fitter(cell, 0, {});
  model::OcvTable<double> ocv =
      id::even_pieces(points_of(id::rested_voltages(test.data, 1), id::OcvDirection::discharge));
  if (candidate.other_ocv) {
    for (std::size_t k = 0; k < ocv.b0_v.size; ++k) {
      ocv.b0_v[k] = paper_table(1).at(k, 0);
      ocv.b1_v[k] = paper_table(1).at(k, 1);
    }
  }
  fitter.set_ocv(ocv);
  const StudyData estimation = window(test, "", 0.8, 0.5), validation = window(test, "", 0.5, 0.2);
  const id::Identification from_test = fitter.grey_box(estimation, id::Method::trust_region_reflective, Start::paper);
  for (std::size_t k = 0; k < 3; ++k) s.ocv_circuit[k] = from_test.parameters[k].value;
  s.estimation_fit = from_test.estimation.fit_percent;
  s.validation_fit = Fitter::validated(from_test, validation).fit_percent;
  s.appendix = appendix_of(test);

  std::vector<StudyData> parts;
  for (std::size_t k = 0; k < ocv_experiment; ++k)
    parts.push_back(run_on_bench(experiment_names[k], pulse_soc, bench, 2 + k));
  parts.push_back(
      window(run_on_bench(experiment_names[ocv_experiment], 1, bench, 2 + ocv_experiment, 0.29), "", 0.5, 0.3));
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    const id::Identification found = fitter.grey_box(parts[row], id::Method::trust_region_reflective, Start::paper);
    for (std::size_t k = 0; k < paper_experiments; ++k)
      s.fit[row][k] = k == row ? found.estimation.fit_percent : Fitter::validated(found, parts[k]).fit_percent;
    for (std::size_t k = 0; k < 3; ++k) s.deviation[row][k] = found.parameters[k].std_white;
    s.deviation[row][3] = std::sqrt(found.estimation.output_variance_v2);
  }
  return listed(s);
}

std::vector<double> differences(const std::vector<Figure>& simulated, const std::vector<Figure>& published) {
  constexpr double most = 2;
  std::vector<double> d(published.size());
  double shift = 0, shifted = 0;
  for (std::size_t k = 0; k < d.size(); ++k) {
    const auto size = [&](const Figure& f) { return std::log(sane(f.is_fit ? 100 - f.value : f.value)); };
    d[k] = size(simulated[k]) - size(published[k]);
    if (!published[k].scaled || simulated[k].value <= 0) continue;
    shift += d[k];
    ++shifted;
  }
  for (std::size_t k = 0; k < d.size(); ++k) {
    if (published[k].scaled) d[k] = simulated[k].value > 0 ? d[k] - shift / std::max(1.0, shifted) : 0;
    d[k] = std::clamp(d[k], -most, most);
  }
  return d;
}

}  // namespace bms::study
