// An identification from files to a cell file: it reads the recordings, identifies, and composes the cell file.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "files/cell_file.hpp"
#include "identification/identify.hpp"
#include "identification/linear_models.hpp"
#include "workflow/cell_size.hpp"
#include "workflow/identification_data.hpp"
#include "workflow/joint_identification.hpp"
#include "workflow/progress.hpp"

namespace bms::workflow {

/// The data were good, but no parameters follow from them: exit code 1, and nothing is written.
struct FailedFit : std::runtime_error {
  FailedFit(const std::string& what, std::vector<measurement::Warning> found)
      : std::runtime_error(what), warnings(std::move(found)) {}
  std::vector<measurement::Warning> warnings;  ///< of recordings and fit: they may name the cause
};

struct IdentifyOptions {
  files::ReadOptions reading;                        ///< of all recordings
  std::vector<std::string> recordings;               ///< files to identify from; at least one
  std::vector<std::string> ocv;                      ///< files with slow charge and discharge; empty: OCV of `start`
  std::optional<identification::LinearKind> linear;  ///< not given: the nonlinear grey box
  identification::Method method = identification::Method::trust_region_reflective;
  std::string start = "table9";               ///< cell file with the initial values, and with what is not identified
  std::optional<files::CellFile> start_cell;  ///< its content; not given: it is read
  InitialSoc initial_soc;
  SocWindow window;                               ///< samples that count
  std::vector<std::string> validate;              ///< files that are only compared with
  std::vector<std::string> healthy;               ///< files from which [healthy] is learned
  LeftOutTime left_out;                           ///< of `recordings`
  std::optional<JointResult> circuit;             ///< with `extend`: the circuit is known, only its values are fitted
  std::vector<std::string> hold_out;              ///< with `extend`: files whose prediction is reported
  std::optional<SocWindow> validate_window;       ///< not given: `window`
  std::vector<double> nodes;                      ///< SOC nodes of R0, R1, C1; empty: by the range of the recordings
  double filter_hz = 0;                           ///< cut-off frequency of the low-pass on the current; 0: no filter
  bool remove_offset = false;                     ///< subtract the mean current of the rests
  double ocv_error_v = 0.002;                     ///< largest error of the straight pieces of the OCV
  std::optional<double> ocv_branch;               ///< branch position of the OCV, -1 discharge .. 1 charge; not given:
                                                  ///< identified if the data determine it
  bool extend = false;                            ///< add the mechanisms and error states that an estimator needs
  std::optional<int> rc_pairs;                    ///< with `extend`: 1 or 2; not given: what predicts better
  std::optional<double> reference_temperature_c;  ///< of the cell file; not given: that of `start`
  double capacity_ah = 0;                         ///< 0: of the OCV recordings, else of `start`
  bool ocv_from_rests = false;                    ///< OCV from the rests of `recordings`
  bool ocv_from_load = false;                     ///< OCV from discharges under load
  std::string chemistry;                          ///< "LFP", "NMC", "NCA", "LTO"; empty: by the voltages
  StatedLimits limits;                            ///< what is not given is derived, if `start` is another cell
  std::string name;                               ///< of the cell
  std::string out;                                ///< file that the caller will write; used in messages only
  Progress progress;                              ///< may be empty
};

struct IdentifyResult {
  std::string model, optimizer, out;
  std::string cell;                  ///< name of the cell; empty: no cell file, because a parameter is out of range
  std::vector<std::string> read_as;  ///< "FILE: how it was read", of files that are not in the project's own format
  std::optional<files::CellFile> cell_file;
  identification::Identification identification;
  std::optional<identification::FitStatistics> validation;  ///< of the first validation recording
  std::vector<std::pair<std::string, identification::FitStatistics>> validations;  ///< of all, by path
  std::vector<identification::Data> data;  ///< the first that was identified from, then the validation data
  std::optional<JointResult> joint;        ///< with `extend`
  std::optional<double> coulombic_efficiency;
  double wall_s = 0;
  std::vector<measurement::Warning> warnings;
};

/// Reads the recordings and identifies a cell. Writes and prints nothing. Throws files::BadInput for files that cannot
/// be read, for data that do not determine the parameters, and for a grey box whose cell is out of range. Throws
/// FailedFit if a figure of the fit is not a number, or if the model follows the voltage no better than its mean.
IdentifyResult identify_cell(const IdentifyOptions& options);

/// "nlgr", "tf", "oe" or "hw".
const char* name_of(const std::optional<identification::LinearKind>& model);

}  // namespace bms::workflow
