// What the experiments of bms proof share: recordings, identified cells and diagnoses. Each is made once, however many
// experiments need it.
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

/// Values by name. The first caller makes the value; callers that come meanwhile wait for it. A failure is thrown to
/// all of them.
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
  /// To be called when no thread uses get() any more.
  const std::map<std::string, std::shared_future<Value>>& all() const { return values_; }

 private:
  std::mutex mutex_;
  std::map<std::string, std::shared_future<Value>> values_;
};

/// A cell file that an experiment identifies: OCV from slow runs, R0, R1, C1 from a drive recording.
struct IdentifiedCell {
  std::string name;
  std::vector<std::string> ocv;  ///< slow charge and discharge
  std::string drive;
};

/// Recordings are named by folder and file, "a123_26650/udds_P25_A002". All functions but diagnoses() may be called
/// from several threads. Throws BadInput if a recording cannot be used.
class ProofLab {
 public:
  /// work: all rows that will be diagnosed, for the progress.
  ProofLab(std::string folder, double work, workflow::Progress progress)
      : folder_(std::move(folder)), work_(work), progress_(std::move(progress)) {}

  /// NAME.csv, or NAME.csv.gz if only that exists.
  std::string path(const std::string& name) const;
  const measurement::Recording& recording(const std::string& name);

  const files::CellFile& built_in(const std::string& name);
  /// As `bms identify --ocv ... --recording ... --start a123_26650 --window 0.95:0.15` makes it.
  const files::CellFile& identified(const IdentifiedCell& cell);

  /// Diagnoses recordings. They start from the first value of soc_ref, with the tolerance of the cell file.
  const workflow::DiagnoseResult& diagnosed(const files::CellFile& cell, const std::vector<std::string>& recordings);
  /// The same for recordings that were changed; `name` identifies them.
  const workflow::DiagnoseResult& diagnosed(const files::CellFile& cell, const std::string& name,
                                            const std::vector<measurement::Recording>& recordings);

  /// Voltages of the cell file and of the extended cell for a recording that the diagnosis did not use. instead: an
  /// extended cell other than the diagnosed one.
  workflow::RecordingComparison scored(const workflow::DiagnoseResult& diagnosis, const std::string& recording,
                                       const diagnosis::Hypothesis* instead = nullptr);

  /// All diagnoses, by name. To be called when all experiments have ended.
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

}  // namespace bms::proof
