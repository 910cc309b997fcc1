// What all cells of a pack share, by row: the state of the median cell, and the voltage of the neighbours.
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/pack/pack_recording.hpp"
#include "model/cell.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis::pack {

using PreparedCell = model::Cell<double, model::max_intervals>;

struct Track {
  PreparedCell cell;
  double r0_ohm = 0;           ///< at half charge
  double ocv_tolerance_v = 0;  ///< of the cell file
  double capacity_ah = 0;
  double step_s = 1;  ///< usual time between rows
  /// Of a step of the current within a row: what shows in the polarisation over what shows at once, as the end of the
  /// row does not distinguish them.
  double unseen_share = 0;
  std::vector<double> soc, v_rc_v, model_v;  ///< of the median cell
  std::vector<double> soc_sigma;             ///< by row, of what a count of single readings adds; empty: nothing
  bool is_calibrated = false;                ///< the resistances follow from this pack
  std::vector<double> r0_by_row_ohm;         ///< with the factor on the resistances of the cell file
  std::vector<double> r1_by_row_ohm, tau_s;  ///< the same of the polarisation
  std::vector<double> days;                  ///< since the start
  std::vector<double> warm_k;                ///< that the cells are warmer than at the start
  double mean_v = 0;                         ///< of the neighbours
  std::vector<double> neighbours_v;          ///< mean voltage of the cells that serve as the reference; NaN: unknown
  /// The same without noise where the current is constant. What a cell differs from contains the noise of the
  /// neighbours; a column that contained it as well would be correlated with the data.
  std::vector<double> smooth_v;
  /// Current at the moment of sampling: the measured one is a mean over the row. Steps within a row are taken from the
  /// neighbours' voltage.
  std::vector<double> instant_a;
  std::vector<double> slow_a;  ///< its mean over some rows before and after: the same for channels that are read later
  std::vector<char> moving;    ///< rows before or after which the current changes
  bool uses_moving = true;     ///< false: what happened within such a row is unknown, and it is left out
};

/// Voltage of the polarisation by row, and its derivative by ln(R1 C1).
struct RcVoltage {
  std::vector<double> v, by_tau_v;
};
/// For a time constant that is exp(ln_factor) times that of the track.
RcVoltage rc_voltage_of(const Track& track, const PackRecording& pack, double ln_factor);

/// Median time between rows.
double usual_step_s(const PackRecording& pack);

/// Without neighbours_v, smooth_v, instant_a, slow_a and moving. factor: by row, on the resistances of the cell file;
/// empty: 1.
/// polarisation: what is added to the factor for R1.
Track track_of(const model::CellParameters<>& cell, const PackRecording& pack, const std::vector<double>& factor = {},
               double polarisation = 0);

/// Sets neighbours_v, smooth_v, instant_a, slow_a and moving: the mean of these cells. Rows in which less than half of
/// them have a reading have no value. by_voltmeter: there, the pack's voltmeter less its usual difference to the cells;
/// for held channels.
void set_neighbours(Track& track, const PackRecording& pack, const std::vector<std::size_t>& reference,
                    bool by_voltmeter);

/// The half of the cells that is closest to the median of all.
std::vector<std::size_t> usual_cells(const PackRecording& pack);

}  // namespace bms::diagnosis::pack
