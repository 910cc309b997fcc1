// From which starts the optimisers reach the best fit.
#include <cmath>

#include <fmt/format.h>

#include "numerics/in_parallel.hpp"
#include "study/statistics.hpp"
#include "study/table_cells.hpp"
#include "workflow/identification_data.hpp"

namespace bms::study {

namespace {

constexpr std::array r1_ohm = {0.002, 0.006, 0.0192, 0.06, 0.18};
constexpr std::array c1_f = {300.0, 1'000.0, 3'000.0, 8'333.0, 25'000.0};
constexpr std::size_t starts = r1_ohm.size() * c1_f.size();
constexpr double reached_points = 1;  ///< below the best fit of any optimiser from any start

/// Fits in percent: by model, start, optimiser; NaN: no result.
struct Maps {
  std::vector<double> fit = std::vector<double>(models * starts * methods.size(), NAN);
  double& at(std::size_t model, std::size_t start, std::size_t method) {
    return fit[(model * starts + start) * methods.size() + method];
  }
  double best(std::size_t model) {
    double best = -INFINITY;
    for (std::size_t s = 0; s < starts; ++s) {
      for (std::size_t m = 0; m < methods.size(); ++m) best = std::fmax(best, at(model, s, m));
    }
    return best;
  }
};

id::CircuitParameters start_of(std::size_t start) {
  return {paper_start.b1_v, paper_start.r0_ohm, r1_ohm[start / c1_f.size()], c1_f[start % c1_f.size()]};
}

double fit_from(const model::CellParameters<>& cell, const StudyData& part, std::size_t model, std::size_t start,
                std::size_t method) {
  constexpr std::array kinds = {id::LinearKind::transfer_function, id::LinearKind::output_error,
                                id::LinearKind::hammerstein_wiener};
  if (model == grey_box_model)
    return Fitter(cell, 0, {}).grey_box_from(part, methods[method], start_of(start)).estimation.fit_percent;
  id::LinearOptions options{start_of(start), {}};
  options.stopping.iterations = paper_iterations;
  try {
    return id::identify_linear(kinds[model], cell, part.data, part.middle_soc(), methods[method], options)
        .identification.estimation.fit_percent;
  } catch (const std::invalid_argument&) {
    return NAN;
  }
}

files::PageTable map_of(Maps& maps, std::size_t model) {
  files::PageTable table{
      fmt::format("starts_{}", model + 4),
      fmt::format("Optimisers of the {} that end within 1 point of its best fit ({:.2f} %), by start",
                  model_names[model], maps.best(model)),
      {"R1 of the start"},
      {},
      ""};
  for (const double c : c1_f) table.head.push_back(fmt::format("C1 {:.0f} F", c));
  for (std::size_t r = 0; r < r1_ohm.size(); ++r) {
    std::vector<files::PageCell> row = {label(fmt::format("{:.4g} ohm", r1_ohm[r]))};
    for (std::size_t c = 0; c < c1_f.size(); ++c) {
      std::string reached;
      for (std::size_t m = 0; m < methods.size(); ++m) {
        if (maps.at(model, r * c1_f.size() + c, m) >= maps.best(model) - reached_points)
          reached += fmt::format("{}{}", reached.empty() ? "" : " ", id::name_of(methods[m]));
      }
      const bool papers = r1_ohm[r] == paper_start.r1_ohm && std::abs(c1_f[c] - paper_start.c1_f) < 1;
      row.push_back(label((reached.empty() ? "-" : reached) + (papers ? " (start of the paper)" : "")));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace

void add_success_maps(const model::CellParameters<>& cell, std::uint64_t seed, StudyResult& result) {
  constexpr double ocv_step_s = 5;
  constexpr int steps = 10;
  Bench bench = drawn(plant_kinds.back(), seed);
  bench.ocv_step_s = ocv_step_s;
  const StudyData test = run_ocv_test(steps, bench, seed, false);
  model::CellParameters<> given = cell;
  given.ocv = id::even_pieces(points_of(id::rested_voltages(test.data, 1), id::OcvDirection::discharge));
  const StudyData part = window(test, "80 to 50 %", 0.8, 0.5);
  Maps maps;
  numerics::in_parallel(models * starts, [&](std::size_t k) {
    for (std::size_t m = 0; m < methods.size(); ++m)
      maps.at(k / starts, k % starts, m) = fit_from(given, part, k / starts, k % starts, m);
  });
  files::PageTable shares{
      "success",
      fmt::format("Share of {} starts from which an optimiser ends within 1 point of the best fit", starts),
      {"optimiser", model_names[0], model_names[1], model_names[2], model_names[3]},
      {},
      "Starts: a grid of R1 and C1 around the paper's; R0 and b1 are the paper's. 20 iterations, "
      "on one cell with hysteresis and slow polarisation."};
  for (std::size_t m = 0; m < methods.size(); ++m) {
    std::vector<files::PageCell> row = {label(method_names[m])};
    for (std::size_t k = 0; k < models; ++k) {
      std::size_t reached = 0;
      for (std::size_t s = 0; s < starts; ++s) reached += maps.at(k, s, m) >= maps.best(k) - reached_points ? 1U : 0U;
      row.push_back({fmt::format("{} of {}", reached, starts),
                     static_cast<double>(reached) / static_cast<double>(starts), std::nullopt});
    }
    shares.rows.push_back(std::move(row));
  }
  result.tables.push_back(std::move(shares));
  for (std::size_t k = 0; k < models; ++k) result.tables.push_back(map_of(maps, k));
  result.fits += models * starts * methods.size();
}

}  // namespace bms::study
