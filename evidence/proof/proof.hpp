// bms proof: compares the diagnosis of real recordings with measurements that it did not use.
//
// Each experiment (evidence/proof/experiments/*.toml) conceals physics from a cell file or adds a fault to a recording,
// diagnoses it, and measures the same quantity independently. The tolerance of each claim was fixed beforehand and is
// printed next to it. Claims that fail are reported as failing.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "workflow/progress.hpp"

namespace bms::proof {

/// A number of the diagnosis, and the same number measured independently.
struct ProofNumber {
  std::optional<double> claimed;  ///< nothing: the diagnosis gave none
  double claimed_sigma = 0;
  double measured = 0, measured_sigma = 0;
  double allowed = 0;  ///< largest difference for the claim to hold
  std::string unit;
};

/// RMS error [V] of the cell file and of the extended one on a recording that the diagnosis did not use.
struct ProofErrors {
  double before_v = 0, after_v = 0;
  double allowed = 0.5;  ///< largest after / before for the claim to hold
};

struct ProofClaim {
  std::string id;         ///< "hysteresis.udds_P25_A002.half_gap"
  std::string claim;      ///< what is to be shown
  std::string claimed;    ///< by the diagnosis, with its uncertainty
  std::string measured;   ///< independently, and how
  std::string tolerance;  ///< the condition for the claim to hold
  std::optional<ProofNumber> number;
  std::optional<ProofErrors> errors;
  std::optional<bool> within_uncertainty;  ///< within two standard deviations of diagnosis and measurement together;
                                           ///< nothing: no number with a standard deviation
  bool holds = false;

  /// "holds", "holds, but its uncertainty is too small", "fails".
  std::string verdict() const;
};

struct ProofLines {
  std::string title;
  std::vector<std::string> labels;  ///< one for each column
  std::vector<double> x;            ///< time in x_unit
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

/// Measured points, and predictions of them.
struct ProofPoints {
  struct Point {
    double x = 0, y = 0, sigma = 0;
  };
  struct Curve {
    std::string name;
    std::vector<Point> points;  ///< sigma: standard deviation of the prediction
  };
  std::string title, x_title, y_title;
  std::vector<Point> measured;
  std::vector<Curve> predicted;
  std::vector<std::string> names = {};  ///< names of x = 1, 2, ...; empty: x is a number
};

/// An experiment with its results.
struct ProofExperiment {
  std::string id, title, method;
  std::vector<ProofClaim> claims;
  std::vector<ProofLines> lines;
  std::vector<ProofBars> bars;
  std::vector<ProofPoints> points;
  std::vector<std::string> notes;

  std::size_t holding() const;  ///< number of claims that hold
};

/// A diagnosis that claims are based on.
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

/// Ids of the experiments, in order.
std::vector<std::string> proof_names();

/// Runs the experiments, as many at once as there are processors. folder: the recordings; only: the id of one
/// experiment, or empty for all. Throws BadInput if a recording is missing in the folder.
ProofResult prove(const std::string& folder, const std::string& only, const workflow::Progress& progress);

}  // namespace bms::proof
