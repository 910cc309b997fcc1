#include <algorithm>
#include <cmath>

#include "diagnosis/pack/diagnose_pack.hpp"
#include "diagnosis/pack/pack_texts.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"

namespace bms::diagnosis::pack {

namespace {

Verdict verdict_of(const PackDiagnosis& d) {
  std::size_t data = 0, ambiguous = 0;
  for (const PackFinding& f : d.findings) {
    if (is_of_data(f.cause)) ++data;
    if (!f.rivals.empty() && f.rivals.front().probability > limits.ambiguous_from) ++ambiguous;
  }
  if (d.findings.size() > data) {
    if (ambiguous > 0) return Verdict::ambiguous;
    return d.findings.size() - data > 1 ? Verdict::causes : Verdict::cause;
  }
  if (data > 0) return Verdict::data_fault;
  return d.unexplained.empty() ? Verdict::no_mismatch : Verdict::unknown;
}

/// A resistance and a joint are accused by how well they explain the cell, with the other one healthy. The sigma of the
/// size has what the other one may be as well: where that contains 0, a size of either sign explains the cell, and
/// neither is a fault.
bool may_be_none(const PackFinding& f) {
  if (f.cause != Cause::resistance && f.cause != Cause::joint) return false;
  return std::abs(f.value) < limits.healthy_sigmas * f.sigma;
}

}  // namespace

void conclude(PackDiagnosis& d) {
  std::erase_if(d.findings, may_be_none);
  std::stable_partition(d.findings.begin(), d.findings.end(), [](const PackFinding& f) { return is_of_data(f.cause); });
  for (PackFinding& f : d.findings) {
    if (f.cause == Cause::repeated) f.because = confirmation_of(d.channels, f.cells);
  }
  d.verdict = verdict_of(d);
  d.statement = statement_of(d);
}

}  // namespace bms::diagnosis::pack
