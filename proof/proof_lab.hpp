// What the experiments of bms proof share: recordings, identified cells and diagnoses, each made once however many ask
// for it.
#pragma once

#include <atomic>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "measurement/recording.hpp"
#include "proof/proof.hpp"
#include "workflow/diagnosis_result.hpp"

namespace bms::proof {

/// Values by name, made by who asks first; who asks meanwhile waits. A failure is thrown to everybody.
template <class Value>
class LazyMap {
 public:
  const Value& get(const std::string& name, const std::function<Value()>& make) {
    std::promise<Value> promise;
    std::shared_future<Value> value;
    bool mine = false;
    {
      const std::lock_guard lock(mutex_);
      const auto [at, is_new] = values_.try_emplace(name, promise.get_future().share());
      value = at->second;
      mine = is_new;
    }
    if (mine) {
      try {
        promise.set_value(make());
      } catch (...) {
        promise.set_exception(std::current_exception());
      }
    }
    return value.get();
  }
  /// Once nobody asks any more.
  const std::map<std::string, std::shared_future<Value>>& all() const { return values_; }

 private:
  std::mutex mutex_;
  std::map<std::string, std::shared_future<Value>> values_;
};

class ProofLab {
 public:
  /// work: of all that will be asked, in rows to diagnose.
  ProofLab(std::string folder, double work, workflow::Progress progress)
      : folder_(std::move(folder)), work_(work), progress_(std::move(progress)) {}

  /// name: "a123_26650/udds_P25_A002".
  std::string path(const std::string& name) const { return folder_ + "/" + name + ".csv"; }
  const measurement::Recording& recording(const std::string& name);

  const files::CellFile& built_in(const std::string& name);
  /// As `bms identify --ocv ... --recording ... --start a123_26650 --window 0.95:0.15` makes it.
  const files::CellFile& identified(const std::string& name, const std::vector<std::string>& ocv,
                                    const std::string& recording);

  /// Start: soc_ref's first value, believed to the cell file's tolerance. Hold-outs: scored().
  const workflow::DiagnoseResult& diagnosed(const files::CellFile& cell, const std::vector<std::string>& recordings);
  /// The same of recordings that were changed; `name` tells them apart.
  const workflow::DiagnoseResult& diagnosed(const files::CellFile& cell, const std::string& name,
                                            const std::vector<measurement::Recording>& recordings);

  /// What cell file and extended cell say of a recording that the diagnosis did not use.
  /// instead: of what was found.
  workflow::RecordingComparison scored(const workflow::DiagnoseResult& diagnosis, const std::string& recording,
                                       const diagnosis::Hypothesis* instead = nullptr);

  /// All diagnoses, by name; once nobody works any more.
  std::vector<ProofDiagnosis> diagnoses() const;

 private:
  void report_progress(double rows, const std::string& what);

  std::string folder_;
  double work_;
  workflow::Progress progress_;
  std::mutex progress_mutex_;
  double done_ = 0;
  LazyMap<measurement::Recording> recordings_;
  LazyMap<files::CellFile> cells_;
  LazyMap<std::shared_ptr<workflow::DiagnoseResult>> diagnoses_;
};

/// The list of bms proof: one line, one experiment.
struct ProofEntry {
  const char *id, *title, *method;
  void (*run)(ProofLab& lab, ProofExperiment& into);
  std::vector<std::string> recordings;  ///< that it needs
  double rows;  ///< to be diagnosed for it, beyond those of the entries before; for the time left
};
const std::vector<ProofEntry>& proof_list();

}  // namespace bms::proof
