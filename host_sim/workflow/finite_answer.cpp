#include "workflow/finite_answer.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <stdexcept>

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
    if (!std::isfinite(p.value)) refuse("a parameter");
  }
}

}  // namespace bms::workflow
