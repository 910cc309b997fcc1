#include "study/fitter.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "workflow/identification_data.hpp"

namespace bms::study {

namespace {

constexpr std::array<id::LinearKind, linear_models> linear_kinds = {
    id::LinearKind::transfer_function, id::LinearKind::output_error, id::LinearKind::hammerstein_wiener};
constexpr double paper_capacity_ah = 6;

id::Stopping stopping_for(Start start) {
  id::Stopping stopping;
  if (start == Start::paper) stopping.iterations = paper_iterations;
  return stopping;
}

/// The cell with one circuit at every SOC.
model::CellParameters<> with_circuit(model::CellParameters<> cell, const id::CircuitParameters& circuit) {
  for (std::size_t k = 0; k < cell.rc.soc.size; ++k) {
    cell.rc.r0_ohm[k] = circuit.r0_ohm;
    cell.rc.r1_ohm[k] = circuit.r1_ohm;
    cell.rc.c1_f[k] = circuit.c1_f;
  }
  return cell;
}

}  // namespace

id::DataSet data_set(const StudyData& part) {
  id::DataSet set;
  set.data = part.data;
  set.initial_soc = part.soc_from;
  return set;
}

double value_of(const std::vector<id::Parameter>& parameters, const std::string& name) {
  for (const id::Parameter& p : parameters) {
    if (p.name == name) return p.value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

ModelFit Fitter::fit(std::size_t model, const StudyData& estimation, id::Method method, const StudyData& validation,
                     Start start) {
  if (model < linear_models) return linear(linear_kinds[model], estimation, method, validation, start);
  const id::Identification found = grey_box(estimation, method, start);
  ModelFit out;
  out.estimation = found.estimation;
  out.validation = validated(found, validation);
  out.parameters = found.parameters;
  out.optimum = found.optimum;
  out.warnings = found.warnings;
  out.usable = true;
  return out;
}

id::CircuitParameters Fitter::start_circuit() const {
  const double smaller = cell_.capacity_ah / paper_capacity_ah;
  return {paper_start.b1_v, paper_start.r0_ohm / smaller, paper_start.r1_ohm / smaller, paper_start.c1_f * smaller};
}

id::GreyBoxOptions Fitter::options_for(const StudyData& part) const {
  id::GreyBoxOptions options;
  options.soc_nodes = {std::round(100 * part.middle_soc()) / 100};
  options.bounds = workflow::circuit_bounds(cell_.capacity_ah);
  return options;
}

id::Identification Fitter::grey_box(const StudyData& part, id::Method method, Start start) {
  if (start == Start::paper) return grey_box_from(part, method, start_circuit());
  const id::GreyBoxOptions options = options_for(part);
  id::Identification found = id::identify_grey_box(id::started_from_rests(cell_, part.data, options.bounds),
                                                   {data_set(part)}, options, method);
  step();
  return found;
}

id::Identification Fitter::grey_box_from(const StudyData& part, id::Method method,
                                         const id::CircuitParameters& circuit) {
  id::GreyBoxOptions options = options_for(part);
  options.one_start = true;
  id::Identification found = id::identify_grey_box(with_circuit(cell_, circuit), {data_set(part)}, options, method,
                                                   stopping_for(Start::paper));
  step();
  return found;
}

ModelFit Fitter::linear(id::LinearKind kind, const StudyData& estimation, id::Method method,
                        const StudyData& validation, Start start) {
  ModelFit out;
  try {
    id::LinearOptions options{std::nullopt, stopping_for(start)};
    if (start == Start::paper) options.start = start_circuit();
    const id::LinearIdentification found =
        id::identify_linear(kind, cell_, estimation.data, estimation.middle_soc(), method, options);
    out.estimation = found.identification.estimation;
    out.parameters = found.identification.parameters;
    out.polynomials = found.identification.polynomials;
    out.optimum = found.identification.optimum;
    out.warnings = found.identification.warnings;
    out.blocks = found.model.blocks;
    out.validation = id::validate(found.model, validation.data, found.identification.fading);
    out.usable = std::isfinite(out.estimation.fit_percent) && std::isfinite(out.validation.fit_percent);
    if (!out.usable) out.why_not = "its simulation is not finite";
  } catch (const std::invalid_argument& error) {
    out.why_not = error.what();
  }
  step();
  return out;
}

id::FitStatistics Fitter::validated(const id::Identification& found, const StudyData& part) {
  return id::validate(found.cell, data_set(part), found.fading);
}

void Fitter::step() {
  const std::lock_guard lock(counting_);
  ++done_;
  if (progress_) progress_(done_, all_);
}

}  // namespace bms::study
