#include "study/observations.hpp"

#include <algorithm>
#include <cmath>

#include "identification/rest_reading.hpp"
#include "model/ocv_voltage.hpp"

namespace bms::study {

namespace {

constexpr double pulse_start_soc = 0.41;
constexpr int paper_ocv_steps = 10, fine_ocv_steps = 40;

/// The current acts one sample earlier, which cancels a delay of one sample. The last sample has no current.
StudyData one_sample_early(const StudyData& part) {
  StudyData early = part;
  const id::Data& d = part.data;
  const std::size_t count = d.size() - 1;
  early.data = {d.time_s.part(0, count), d.current_a.part(1, count), d.voltage_v.part(0, count), d.capacity_ah};
  return early;
}

OcvObservation observe_ocv(const std::vector<id::RestedVoltage>& rests) {
  const id::OcvPoints all = points_of(rests, id::OcvDirection::discharge);
  // look-up and pieces have entries at every second and every fourth rest; the rests between them judge
  id::OcvPoints entries;
  for (std::size_t k = 0; k < all.soc.size(); k += 2) {
    entries.soc.push_back(all.soc[k]);
    entries.voltage_v.push_back(all.voltage_v[k]);
  }
  const model::OcvTable<double> pieces = id::even_pieces(entries);
  const std::vector<double> coefficients = id::polynomial(entries);
  OcvObservation out;
  double count = 0;
  for (std::size_t k = 1; k < all.soc.size(); k += 2) {
    const double soc = all.soc[k], v = all.voltage_v[k];
    out.look_up_v += std::pow(entries.at(soc) - v, 2);
    out.polynomial_v += std::pow(id::polynomial_at(coefficients, soc) - v, 2);
    out.pieces_v += std::pow(model::ocv_voltage(pieces, soc) - v, 2);
    ++count;
  }
  for (double* squares : {&out.look_up_v, &out.polynomial_v, &out.pieces_v}) *squares = std::sqrt(*squares / count);
  return out;
}

CrossObservation observe_cross(Fitter& fitter, const std::vector<StudyData>& parts) {
  std::vector<id::Identification> identified;
  for (const StudyData& part : parts)
    identified.push_back(fitter.grey_box(part, id::Method::trust_region_reflective, Start::paper));
  return observation_of(identified, parts);
}

}  // namespace

ModelObservation observation_of(const ModelFit& fit) {
  ModelObservation m;
  m.estimation_fit = fit.estimation.fit_percent;
  m.validation_fit = fit.validation.fit_percent;
  m.one_step_fit = fit.validation.one_step_fit_percent;
  m.estimation_rmse_v = fit.estimation.rmse_v;
  m.validation_rmse_v = fit.validation.rmse_v;
  m.bias_v = fit.estimation.residuals.mean_v;
  m.bias_band_v = fit.estimation.residuals.mean_band_v;
  m.r0_ohm = value_of(fit.parameters, "r0_ohm");
  m.r1_ohm = value_of(fit.parameters, "r1_ohm");
  m.c1_f = value_of(fit.parameters, "c1_f");
  for (const id::Parameter& p : fit.parameters) m.at_bound = m.at_bound || p.at_bound;
  return m;
}

id::CircuitParameters appendix_a(const StudyData& part) {
  const id::RestReadings readings = id::read_rests(part.data);
  for (const id::RestReading& r : readings.rests) {
    const id::PointReading& p = r.points;
    const bool usable = p.r0_ohm > 0 && p.r1_ohm > 0 && p.c1_f > 0 && std::isfinite(p.c1_f);
    if (usable) return {paper_start.b1_v, p.r0_ohm, p.r1_ohm, p.c1_f};
  }
  return paper_start;
}

CrossObservation observation_of(const std::vector<id::Identification>& identified,
                                const std::vector<StudyData>& parts) {
  CrossObservation out;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const id::Identification& found = identified[k];
    for (std::size_t other = 0; other < parts.size(); ++other) {
      const id::FitStatistics fit = other == k ? found.estimation : Fitter::validated(found, parts[other]);
      out.fit[k][other] = fit.fit_percent;
    }
    for (std::size_t p = 0; p < 3; ++p) {
      out.value[k][p] = found.parameters[p].value;
      out.deviation[k][p] = found.parameters[p].std;
    }
    out.output_sd_v[k] = std::sqrt(found.estimation.output_variance_v2);
    if (k == burst_experiment) {
      out.burst_bias_v = found.estimation.residuals.mean_v;
      out.burst_band_v = found.estimation.residuals.mean_band_v;
      out.burst_largest_v = found.estimation.largest_v;
    }
  }
  return out;
}

bool within_bounds(const ModelObservation& m) {
  const id::CircuitBounds b;
  return m.r0_ohm >= b.r0_min_ohm && m.r0_ohm <= b.r0_max_ohm && m.r1_ohm >= b.r1_min_ohm && m.r1_ohm <= b.r1_max_ohm &&
         m.c1_f >= b.c1_min_f && m.c1_f <= b.c1_max_f;
}

InitialStates initial_states(const model::CellParameters<>& cell, const StudyData& part,
                             const id::CircuitParameters& circuit) {
  constexpr double middle_soc = 0.5;  // nothing is known
  id::DataSet set = data_set(part);
  set.estimate_initial_soc = true;
  set.initial_soc = middle_soc;
  id::GreyBoxOptions options;
  options.soc_nodes = {middle_soc};
  const id::GreyBox grey_box(cell, {set}, options);
  Eigen::VectorXd start = grey_box.start();
  start.head(3) = Eigen::Vector3d{circuit.r0_ohm, circuit.r1_ohm, circuit.c1_f};
  const id::LeastSquares problem = id::with_first_fixed(grey_box.problem(), start, 3);
  const id::Optimum found = minimise(problem, start.tail(2), id::Method::trust_region_reflective);
  Eigen::VectorXd all = start, simulated(static_cast<Eigen::Index>(part.data.size()));
  all.tail(2) = found.x;
  grey_box.simulate(all, 0, simulated, nullptr);
  return {found.x[1], found.x[0], id::fit_of(part.data.voltage_v, simulated, part.data.current_a, 0).fit_percent};
}

WithoutDelay observe_without_delay(Fitter& fitter, const StudyData& estimation, const StudyData& validation) {
  constexpr std::size_t output_error_model = 1;
  WithoutDelay out;
  const StudyData early = one_sample_early(estimation), early_validation = one_sample_early(validation);
  const auto fitted = [&](std::size_t model) -> std::optional<ModelObservation> {
    const ModelFit fit = fitter.fit(model, early, id::Method::trust_region_reflective, early_validation);
    if (!fit.usable) out.why_not = fit.why_not;
    return fit.usable ? std::optional(observation_of(fit)) : std::nullopt;
  };
  out.output_error = fitted(output_error_model);
  out.hammerstein_wiener = fitted(hammerstein_wiener_model);
  return out;
}

void observe_models(Fitter& fitter, const StudyData& estimation, const StudyData& validation, Observations& out) {
  for (std::size_t k = 0; k < models; ++k) {
    for (std::size_t m = 0; m < methods.size(); ++m) {
      const ModelFit fit = fitter.fit(k, estimation, methods[m], validation);
      if (!fit.usable) {
        out.no_model[k] = fit.why_not;
        continue;
      }
      out.table4[m][k] = fit.estimation.fit_percent;
      if (!out.model[k] || fit.estimation.fit_percent > out.model[k]->estimation_fit)
        out.model[k] = observation_of(fit);
    }
  }
  out.without_delay = observe_without_delay(fitter, estimation, validation);
}

Observations observe_bench(const model::CellParameters<>& cell, const Bench& bench, std::uint64_t seed,
                           PlantRuns& runs) {
  Observations out;
  const StudyData test = run_ocv_test(paper_ocv_steps, bench, seed, false, &runs);
  const StudyData fine = run_ocv_test(fine_ocv_steps, bench, seed + 1, false, &runs);
  const std::vector<id::RestedVoltage> rests = id::rested_voltages(test.data, 1);
  out.ocv = observe_ocv(id::rested_voltages(fine.data, 1));
  Fitter fitter(cell, 0, {});
  fitter.set_ocv(id::even_pieces(points_of(rests, id::OcvDirection::discharge)));

  const StudyData estimation = window(test, "80 to 50 %", 0.8, 0.5), validation = window(test, "50 to 20 %", 0.5, 0.2);
  observe_models(fitter, estimation, validation, out);

  std::vector<StudyData> parts;
  for (std::size_t k = 0; k < ocv_experiment; ++k)
    parts.push_back(run_on_bench(experiment_names[k], pulse_start_soc, bench, seed + 2 + k, -1, &runs));
  const StudyData hour =
      run_on_bench(experiment_names[ocv_experiment], 1, bench, seed + 2 + ocv_experiment, 0.29, &runs);
  parts.push_back(window(hour, "ocv_1h_rest, 50 to 30 %", 0.5, 0.3));
  out.cross = observe_cross(fitter, parts);

  const InitialStates from_test = initial_states(fitter.cell(), estimation, appendix_a(estimation)),
                      from_bursts = initial_states(fitter.cell(), parts[burst_experiment], appendix_a(parts.back()));
  out.initial_soc = {from_test.soc, estimation.soc_from, from_bursts.soc, parts[burst_experiment].soc_from};
  return out;
}

}  // namespace bms::study
