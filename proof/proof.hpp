// bms proof: what the diagnosis claims of real recordings, each confirmed or refuted by a measurement that it did not
// see.
//
// Every experiment conceals physics from a cell file, or puts a fault into a recording, lets the diagnosis say what is
// missing, and measures the same elsewhere. How far both may differ stands beside each claim and was fixed before. What
// fails stands as failing.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "workflow/progress.hpp"

namespace bms::proof {

/// A number that the tool gave, and the same number measured by other means.
struct ProofNumber {
  std::optional<double> claimed;  ///< nothing: the tool gave none
  double claimed_sigma = 0;
  double measured = 0, measured_sigma = 0;
  double allowed = 0;  ///< largest difference for the claim to hold
  std::string unit;
};

/// Error of the cell file and of the extended one on a recording that was not used.
struct ProofErrors {
  double before_v = 0, after_v = 0;
  double allowed = 0.5;  ///< after over before, for the claim to hold
};

struct ProofClaim {
  std::string id;         ///< "hysteresis.udds_P25_A002.half_gap"
  std::string claim;      ///< what is to be shown
  std::string claimed;    ///< by the tool, with its uncertainty
  std::string measured;   ///< independently
  std::string tolerance;  ///< when it holds
  std::optional<ProofNumber> number;
  std::optional<ProofErrors> errors;
  std::optional<bool> within_uncertainty;  ///< two deviations of tool and measurement; nothing: no number with one
  bool holds = false;

  /// "holds", "holds, but too sure of itself", "fails".
  std::string verdict() const;
};

struct ProofLines {
  std::string title;
  std::vector<std::string> labels;  ///< of the columns after x
  std::vector<double> x;            ///< hours, or seconds since the start of a rest
  std::string x_unit;
  std::vector<std::vector<double>> columns;
};

struct ProofBars {
  struct Row {
    std::string name;
    double before = 0, after = 0;
  };
  std::string title, unit;
  std::vector<Row> rows;
};

/// Measured points, and what was predicted of them.
struct ProofPoints {
  struct Point {
    double x = 0, y = 0, sigma = 0;
  };
  struct Curve {
    std::string name;
    std::vector<Point> points;  ///< sigma: of the prediction
  };
  std::string title, x_title, y_title;
  std::vector<Point> measured;
  std::vector<Curve> predicted;
  std::vector<std::string> names = {};  ///< of x = 1, 2, ...; empty: x is a number
};

/// One line of the list: what is done, and what came of it.
struct ProofExperiment {
  std::string id, title, method;
  std::vector<ProofClaim> claims;
  std::vector<ProofLines> lines;
  std::vector<ProofBars> bars;
  std::vector<ProofPoints> points;
  std::vector<std::string> notes;

  std::size_t holding() const;
};

/// A diagnosis that claims rest on.
struct ProofDiagnosis {
  std::string name;  ///< "cell: recordings"
  std::string verdict, statement;
  std::vector<std::string> found;  ///< "ocv_hysteresis: half_gap_v 0.0184 +- 0.0004 V, ..."
  double before_v = 0, after_v = 0, wall_s = 0;
};

struct ProofResult {
  std::vector<ProofExperiment> experiments;
  std::vector<ProofDiagnosis> diagnoses;  ///< by name
  double wall_s = 0;

  std::size_t claims() const;
  std::size_t holding() const;
};

/// Names of the experiments, in order.
std::vector<std::string> proof_names();

/// only: one experiment's name, or empty for all. Throws BadInput when a recording that is needed is not in the folder.
ProofResult prove(const std::string& folder, const std::string& only, const workflow::Progress& progress);

}  // namespace bms::proof
