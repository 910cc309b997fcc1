// The paper's procedure on one data set, and what simulated figures share.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "study/observations.hpp"

namespace bms::study {

/// The grey box of one data set, from the paper's start with its limit of iterations.
class FromData {
 public:
  FromData(const model::CellParameters<>& given, const StudyData& part);

  const StudyData& part() const { return part_; }
  const id::Identification& found() const { return found_; }
  /// Standard deviations of R0, R1, C1 for a white noise of 1 V in samples every second.
  const std::array<double, 3>& unit_deviation() const { return unit_deviation_; }

  /// Fit to other data in percent. Their initial states are fitted from those that their own model has.
  double fit_to(const StudyData& part, const id::InitialState& own) const;

 private:
  void set_deviation();

  StudyData part_;
  id::Identification found_;
  std::array<double, 3> unit_deviation_{};
};

/// Results by the numbers that they follow from. Each is computed once.
template <class Result>
class Computed {
 public:
  template <class Compute>
  const Result& of(const std::vector<double>& numbers, const Compute& compute) {
    std::unique_ptr<const Result>& result = results_[numbers];
    if (!result) result = std::make_unique<const Result>(compute());
    return *result;
  }

 private:
  std::map<std::vector<double>, std::unique_ptr<const Result>> results_;
};

/// What simulated figures of the same cell share where their candidates do not differ. Not for several threads at once.
struct PaperRuns {
  /// Tables 5 and 6, Appendix A, and the OCV that the models are given.
  struct OcvTest {
    model::OcvTable<double> ocv;
    std::array<double, 3> circuit{}, appendix{};  ///< R0, R1, C1
    double estimation_fit = 0, validation_fit = 0;
  };
  PlantRuns plant;
  Computed<OcvTest> ocv_tests;
  Computed<FromData> identified;
  std::map<std::pair<const FromData*, const FromData*>, double> fits;  ///< of the first model to the second's data
};

}  // namespace bms::study
