#include "proof/proof.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <filesystem>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "numerics/in_parallel.hpp"
#include "proof/experiment_file.hpp"
#include "proof/proof_lab.hpp"

namespace bms::proof {

std::string ProofClaim::verdict() const {
  if (!holds) return "fails";
  return within_uncertainty.value_or(true) ? "holds" : "holds, but its uncertainty is too small";
}

std::size_t ProofExperiment::holding() const {
  return static_cast<std::size_t>(
      std::count_if(claims.begin(), claims.end(), [](const ProofClaim& c) { return c.holds; }));
}

std::size_t ProofResult::claims() const {
  std::size_t sum = 0;
  for (const ProofExperiment& e : experiments) sum += e.claims.size();
  return sum;
}

std::size_t ProofResult::holding() const {
  std::size_t sum = 0;
  for (const ProofExperiment& e : experiments) sum += e.holding();
  return sum;
}

std::vector<std::string> proof_names() {
  std::vector<std::string> names;
  for (const Experiment& e : experiments()) names.push_back(e.id);
  return names;
}

namespace {

void require_recordings(const ProofLab& lab, const std::vector<const Experiment*>& chosen) {
  for (const Experiment* e : chosen) {
    for (const std::string& name : e->recordings) {
      if (std::filesystem::is_regular_file(lab.path(name))) continue;
      throw files::BadInput(lab.path(name), 1,
                            "no such recording, expected a folder with a123_26650 and a123_esctoolbox in --data "
                            "(evidence/proof/README.md names their source)");
    }
  }
}

/// An experiment that ends early is a claim that fails.
ProofClaim failure(const Experiment& e, const std::string& what) {
  ProofClaim claim;
  claim.id = e.id + ".run";
  claim.claim = "the experiment runs to its end";
  claim.claimed = what;
  return claim;
}

/// Runs the experiments on all processors. results: one for each.
void run_all(const std::vector<const Experiment*>& chosen, ProofLab& lab, std::vector<ProofExperiment>& results) {
  numerics::in_parallel(chosen.size(), [&](std::size_t k) {
    const Experiment& e = *chosen[k];
    try {
      e.procedure->run(lab, results[k]);
      results[k].notes.insert(results[k].notes.end(), e.notes.begin(), e.notes.end());
    } catch (const files::BadInput&) {
      throw;
    } catch (const std::exception& error) {
      results[k].claims.push_back(failure(e, error.what()));
    }
  });
}

}  // namespace

ProofResult prove(const std::string& folder, const std::string& only, const workflow::Progress& progress) {
  const auto begin = std::chrono::steady_clock::now();
  std::vector<const Experiment*> chosen;
  double work = 1;
  for (const Experiment& e : experiments()) {
    if (!only.empty() && only != e.id) continue;
    chosen.push_back(&e);
    work += e.rows;
  }
  ProofLab lab(folder, work, progress);
  require_recordings(lab, chosen);
  ProofResult result;
  for (const Experiment* e : chosen) result.experiments.push_back({e->id, e->title, e->method, {}, {}, {}, {}, {}});
  run_all(chosen, lab, result.experiments);
  result.diagnoses = lab.diagnoses();
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (progress) progress(1, "done");
  return result;
}

}  // namespace bms::proof
