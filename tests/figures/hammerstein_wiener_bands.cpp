#include "tests/figures/hammerstein_wiener_bands.hpp"

#include <fmt/format.h>

#include "files/cell_file.hpp"
#include "identification/linear_models.hpp"
#include "identification/residuals.hpp"
#include "tests/inference/identification/exact_systems.hpp"

namespace bms {

namespace {

namespace id = identification;

constexpr std::size_t samples = 500, models = 30;
constexpr std::uint64_t systems = 12, data_sets = 6;
constexpr double noise_v = 0.001;

/// Of one or more data sets.
struct Coverage {
  double inside = 0, data_sets = 0;

  void add(double share) {
    inside += share;
    ++data_sets;
  }
  std::string text() const { return data_sets > 0 ? fmt::format("{:.1f} %", 100 * inside / data_sets) : "-"; }
};

double share_inside(const id::Band& band, const id::Data& truth) {
  double inside = 0;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    inside += truth.voltage_v[k] >= band.low_v[row] && truth.voltage_v[k] <= band.high_v[row] ? 1 : 0;
  }
  return inside / static_cast<double>(truth.size());
}

struct Row {
  Coverage every, white;
  double rmse_v = 0;
};

void add_data_set(Row& row, const id::ExactSystem& system, std::uint64_t seed) {
  const model::CellParameters<> cell = files::read_cell("table9").parameters;
  const id::Data data = id::with_noise(system.data, seed, noise_v);
  const id::LinearIdentification found =
      id::identify_linear(id::LinearKind::hammerstein_wiener, cell, data, 0.5, id::Method::trust_region_reflective);
  const id::HammersteinWiener& model = found.model.blocks;
  const double inside =
      share_inside(id::band_of(model, id::resampled(model, data, models, seed), data.current_a), system.data);
  row.every.add(inside);
  if (id::whiteness(id::residuals_of(model, data)).white()) row.white.add(inside);
  row.rmse_v = std::max(row.rmse_v, found.identification.estimation.rmse_v);
}

}  // namespace

std::string hammerstein_wiener_bands(std::uint64_t first_seed) {
  std::string table =
      "| system | largest RMSE, noise of 1 mV | bands given | truth inside | truth inside, all data sets "
      "|\n|---|---|---|---|---|\n";
  Row all;
  const auto line = [&](const std::string& name, const Row& row) {
    table += fmt::format("| {} | {:.2f} mV | {:.0f} of {:.0f} | {} | {} |\n", name, 1e3 * row.rmse_v,
                         row.white.data_sets, row.every.data_sets, row.white.text(), row.every.text());
  };
  const model::OcvTable<double> ocv = files::read_cell("table9").parameters.ocv;
  for (std::uint64_t seed = first_seed; seed < first_seed + systems; ++seed) {
    const id::ExactSystem system = id::exact_system(seed, samples, ocv);
    Row row;
    for (std::uint64_t k = 0; k < data_sets; ++k) add_data_set(row, system, 10 + k + 1'000 * seed);
    line(fmt::format("{}", seed), row);
    all.every.inside += row.every.inside;
    all.every.data_sets += row.every.data_sets;
    all.white.inside += row.white.inside;
    all.white.data_sets += row.white.data_sets;
    all.rmse_v = std::max(all.rmse_v, row.rmse_v);
  }
  line("all", all);
  return table;
}

}  // namespace bms
