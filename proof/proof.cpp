#include "proof/proof.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <filesystem>
#include <thread>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "proof/proof_lab.hpp"

namespace bms::proof {

std::string ProofClaim::verdict() const {
  if (!holds) return "fails";
  return within_uncertainty.value_or(true) ? "holds" : "holds, but too sure of itself";
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
  for (const ProofEntry& entry : proof_list()) names.push_back(entry.id);
  return names;
}

ProofResult prove(const std::string& folder, const std::string& only, const workflow::Progress& progress) {
  const auto begin = std::chrono::steady_clock::now();
  std::vector<const ProofEntry*> chosen;
  double work = 1;
  for (const ProofEntry& entry : proof_list()) {
    if (!only.empty() && only != entry.id) continue;
    chosen.push_back(&entry);
    work += entry.rows;
  }
  ProofLab lab(folder, work, progress);
  for (const ProofEntry* entry : chosen) {
    for (const std::string& name : entry->recordings) {
      if (!std::filesystem::is_regular_file(lab.path(name))) {
        throw files::BadInput(lab.path(name), 1,
                              "no such recording, expected a folder with a123_26650 and a123_esctoolbox in --data "
                              "(host_sim/README.md names their source)");
      }
    }
  }
  ProofResult result;
  for (const ProofEntry* entry : chosen)
    result.experiments.push_back({entry->id, entry->title, entry->method, {}, {}, {}, {}, {}});

  std::atomic<std::size_t> next = 0;
  std::exception_ptr bad_input;
  std::mutex refusing;
  const auto work_on = [&] {
    for (std::size_t k = next++; k < chosen.size(); k = next++) {
      try {
        chosen[k]->run(lab, result.experiments[k]);
      } catch (const files::BadInput&) {
        const std::lock_guard lock(refusing);
        if (!bad_input) bad_input = std::current_exception();
      } catch (const std::exception& error) {
        result.experiments[k].claims.push_back({fmt::format("{}.run", chosen[k]->id),
                                                "the experiment runs to its end",
                                                error.what(),
                                                "",
                                                "",
                                                {},
                                                {},
                                                {},
                                                false});
      }
    }
  };
  std::vector<std::thread> others;
  for (std::size_t n = 1; n < std::min<std::size_t>(std::max(1U, std::thread::hardware_concurrency()), chosen.size());
       ++n)
    others.emplace_back(work_on);
  work_on();
  for (std::thread& other : others) other.join();
  if (bad_input) std::rethrow_exception(bad_input);
  result.diagnoses = lab.diagnoses();
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (progress) progress(1, "done");
  return result;
}

}  // namespace bms::proof
