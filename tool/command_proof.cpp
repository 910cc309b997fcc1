#include "tool/command_proof.hpp"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "proof/proof.hpp"
#include "reports/json_results.hpp"
#include "reports/proof_page.hpp"

namespace bms::tool {

namespace {

std::string proof_progress(double done, double left_s, const std::string& what) {
  const std::string left = done > 0.02 ? fmt::format("about {:.0f} s left", left_s) : "";
  return fmt::format("{:3.0f} %, {:20} {:80.80}", 100 * done, left, what);
}

std::string summary(const proof::ProofResult& r) {
  std::string text;
  for (const proof::ProofExperiment& e : r.experiments) {
    text += fmt::format("{} ({} of {} hold)\n", e.title, e.holding(), e.claims.size());
    for (const proof::ProofClaim& c : e.claims)
      text += fmt::format("  {:5} {}\n        said: {}\n        measured: {}\n        holds when {}{}\n",
                          c.holds ? "holds" : "FAILS", c.claim, c.claimed, c.measured, c.tolerance,
                          c.within_uncertainty ? *c.within_uncertainty ? "; within the stated uncertainty"
                                                                       : "; not within the stated uncertainty"
                                               : "");
  }
  return text + fmt::format("{} of {} claims hold, {} diagnoses in {:.0f} s.", r.holding(), r.claims(),
                            r.diagnoses.size(), r.wall_s);
}

}  // namespace

std::string proof_list_text() {
  std::string text;
  for (const std::string& name : proof::proof_names()) text += (text.empty() ? "" : ", ") + name;
  return text;
}

int run(const ProofOptions& options) {
  const auto names = proof::proof_names();
  if (!options.only.empty() && std::find(names.begin(), names.end(), options.only) == names.end()) {
    throw files::BadInput("--only", 1,
                          "no such experiment '" + options.only + "', expected one of: " + proof_list_text());
  }
  std::error_code error;
  for (const char* folder : {".", "a123_26650", "a123_esctoolbox"}) {
    const std::filesystem::path path = (std::filesystem::path(options.data) / folder).lexically_normal();
    if (!std::filesystem::is_directory(path, error))
      throw files::BadInput(path.string(), 1,
                            "no folder, expected one with the recordings a123_26650 and a123_esctoolbox "
                            "(proof/README.md names their source)");
  }
  const proof::ProofResult result = proof::prove(options.data, options.only, progress_on_terminal(0.2, proof_progress));
  if (!options.output.json.empty()) write_output(options.output.json, reports::json_of(result));
  if (!options.output.report.empty()) write_output(options.output.report, reports::proof_report(result));
  print_summary(options.output, summary(result));
  return 0;
}

}  // namespace bms::tool
