#include "workflow/finite_answer.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <stdexcept>

#include "measurement/statistics.hpp"
#include "model/catalogue.hpp"

namespace bms::workflow {

namespace {

[[noreturn]] void refuse(const char* which) {
  throw std::runtime_error(std::string(which) + " is not a finite number, so that there is no answer");
}

bool are_finite(std::initializer_list<double> values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

}  // namespace

void require_finite(const diagnosis::Diagnosis& d) {
  if (!are_finite({d.base_cost, d.best_cost})) refuse("the cost of the diagnosis");
  for (const diagnosis::Ranked& r : d.candidates) {
    if (!are_finite({r.probability, r.gain})) refuse("what a candidate explains");
  }
  for (const diagnosis::Finding& f : d.findings) {
    if (!are_finite({f.probability, f.gain})) refuse("the probability of a finding");
    for (std::size_t k = 0; k < model::catalogue[f.setting.index].parameters; ++k) {
      if (!are_finite({f.setting.value[k], f.setting.deviation[k]})) refuse("the size of a finding");
    }
  }
}

void require_finite(const diagnosis::pack::PackDiagnosis& d) {
  if (!d.is_finite) refuse("the comparison of a cell with its neighbours");
  for (const diagnosis::pack::PackFinding& f : d.findings) {
    if (!are_finite({f.value, f.sigma, f.probability, f.gain})) refuse("the size of a finding");
  }
}

void require_finite(const identification::Identification& i) {
  if (!std::isfinite(i.optimum.cost)) refuse("the error of the identified model at its start");
  if (!are_finite({i.estimation.rmse_v, i.estimation.output_variance_v2})) refuse("the error of the identified model");
  for (const identification::Parameter& p : i.parameters) {
    if (!are_finite({p.value, p.std})) refuse("a parameter");
  }
}

void require_finite(const IdentifyResult& r) {
  require_finite(r.identification);
  for (const auto& [path, of] : r.validations) {
    if (!are_finite({of.rmse_v, of.fit_percent})) refuse("the error of the model on other recordings");
  }
  if (!r.joint) return;
  const identification::StructureChoice& choice = r.joint->choice;
  const identification::ModelErrors& errors = choice.errors;
  if (!choice.fit.value.allFinite() || !choice.fit.std.allFinite())
    refuse("a parameter of the fit over all recordings");
  if (!are_finite({choice.fit.optimum.cost, measurement::rms(choice.fit.rmse_v)}))
    refuse("the error of the fit over all recordings");
  if (!are_finite({errors.resistance_fraction, errors.resistance_per_ev, errors.initial_soc, errors.model_v,
                   errors.correlation_s}))
    refuse("the error to expect of the fit over all recordings");
  for (const identification::LeftOutError& e : r.joint->held_out) {
    if (!are_finite({e.rmse_v, e.soc_error, e.resistance_error})) refuse("the prediction of a recording");
  }
}

}  // namespace bms::workflow
