#include "study/fitter.hpp"

#include <cmath>
#include <stdexcept>

#include "workflow/identification_data.hpp"

namespace bms::study {

namespace {

constexpr std::array<id::LinearKind, linear_models> linear_kinds = {
    id::LinearKind::transfer_function, id::LinearKind::output_error, id::LinearKind::hammerstein_wiener};

id::DataSet data_set(const StudyData& part) {
  id::DataSet set;
  set.data = part.data;
  set.initial_soc = part.soc_from;
  return set;
}

}  // namespace

ModelFit Fitter::fit(std::size_t model, const StudyData& estimation, id::Method method, const StudyData& validation) {
  if (model < linear_models) return linear(linear_kinds[model], estimation, method, validation);
  const id::Identification found = grey_box(estimation, method);
  ModelFit out;
  out.estimation = found.estimation;
  out.validation = validated(found, validation);
  out.parameters = found.parameters;
  out.optimum = found.optimum;
  out.warnings = found.warnings;
  out.usable = true;
  return out;
}

id::Identification Fitter::grey_box(const StudyData& part, id::Method method) {
  id::GreyBoxOptions options;
  options.soc_nodes = {std::round(100 * part.middle_soc()) / 100};
  options.bounds = workflow::circuit_bounds(cell_.capacity_ah);
  id::Identification found = id::identify_grey_box(id::started_from_rests(cell_, part.data, options.bounds),
                                                   {data_set(part)}, options, method);
  step();
  return found;
}

ModelFit Fitter::linear(id::LinearKind kind, const StudyData& estimation, id::Method method,
                        const StudyData& validation) {
  ModelFit out;
  try {
    const id::LinearIdentification found =
        id::identify_linear(kind, cell_, estimation.data, estimation.middle_soc(), method);
    out.estimation = found.identification.estimation;
    out.parameters = found.identification.parameters;
    out.optimum = found.identification.optimum;
    out.warnings = found.identification.warnings;
    out.validation = id::validate(found.model, validation.data, found.identification.fading);
    out.usable = std::isfinite(out.estimation.fit_percent);
  } catch (const std::invalid_argument& error) {
    out.warnings.push_back(error.what());
  }
  step();
  return out;
}

id::FitStatistics Fitter::validated(const id::Identification& found, const StudyData& part) {
  return id::validate(found.cell, data_set(part), found.fading);
}

void Fitter::step() {
  ++done_;
  if (progress_) progress_(done_, all_);
}

}  // namespace bms::study
