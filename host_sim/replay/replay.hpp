// Replay: runs the estimator over a recording, on the host or on an emulated board, and evaluates the estimates.
#pragma once

#include <cstdint>
#include <functional>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "estimator/estimate.hpp"
#include "files/cell_file.hpp"
#include "files/text_file.hpp"
#include "measurement/recording.hpp"
#include "measurement/soc_column.hpp"

namespace bms::replay {

enum class ScalarKind { float32, fixed, float64 };  ///< float, fixed point, double

/// One estimate as numbers, for every scalar type.
struct EstimateRow {
  double soc = 0, soc_sigma = 0, v_rc_v = 0, voltage_predicted_v = 0;
  std::uint32_t flags = 0;
};

/// The estimates of one run, a row per sample. In float and in fixed point only the bits are stored, because a
/// recording may have millions of rows; a row is made when it is read.
class Estimates {
 public:
  Estimates() = default;
  /// scalar: of the words, not double
  Estimates(std::vector<estimator::EstimateWords> words, ScalarKind scalar)
      : words_(std::move(words)), scalar_(scalar) {}
  explicit Estimates(std::vector<EstimateRow> numbers) : numbers_(std::move(numbers)), scalar_(ScalarKind::float64) {}

  std::size_t size() const { return scalar_ == ScalarKind::float64 ? numbers_.size() : words_.size(); }
  bool empty() const { return size() == 0; }
  EstimateRow operator[](std::size_t row) const;
  EstimateRow front() const { return (*this)[0]; }
  EstimateRow back() const { return (*this)[size() - 1]; }
  std::uint32_t flags(std::size_t row) const {
    return scalar_ == ScalarKind::float64 ? numbers_[row].flags : words_[row].back();
  }
  /// The bits that host and board are compared by; empty for double.
  const std::vector<estimator::EstimateWords>& words() const { return words_; }

  class Iterator {
   public:
    using difference_type = std::ptrdiff_t;
    using value_type = EstimateRow;
    Iterator() = default;
    Iterator(const Estimates& all, std::size_t row) : all_(&all), row_(row) {}
    EstimateRow operator*() const { return (*all_)[row_]; }
    Iterator& operator++() {
      ++row_;
      return *this;
    }
    Iterator operator++(int) { return {*all_, row_++}; }
    bool operator==(const Iterator& other) const { return row_ == other.row_; }

   private:
    const Estimates* all_ = nullptr;
    std::size_t row_ = 0;
  };
  Iterator begin() const { return {*this, 0}; }
  Iterator end() const { return {*this, size()}; }

 private:
  std::vector<estimator::EstimateWords> words_;
  std::vector<EstimateRow> numbers_;  ///< of double
  ScalarKind scalar_ = ScalarKind::float32;
};

/// One run. The further states of an extended cell are sensor errors, then states of mechanisms.
struct Track {
  Estimates rows;
  ScalarKind scalar = ScalarKind::float32;
  std::vector<std::string>
      state_names;  ///< "current_offset_a", "ocv_hysteresis_v", "slow_polarisation_1_v", "self_heating_k"
  std::vector<double> state_scales;        ///< factor from the number in a word to the unit in the name
  std::vector<std::uint32_t> state_words;  ///< state_names.size() for each row; empty for double
  std::vector<double> state_numbers;       ///< the same, of double
  double steps_per_second = 0;             ///< of processor time; of an emulator: of wall time

  /// A further state, from 0, in V, K or A.
  double state(std::size_t row, std::size_t index) const;
};

/// State of charge before the first sample, as assumed by the user, and its standard deviation.
struct SocPrior {
  double soc = 0;
  double sigma = 0.02;
};
/// What is known before the first sample.
struct Start {
  Start() = default;
  Start(std::nullopt_t) {}
  Start(const measurement::StartingPoint& point) : soc(point) {}
  Start(const std::optional<measurement::StartingPoint>& point) : soc(point) {}
  /// Whether the capacity is not that of a battery which has learned nothing.
  bool learned() const {
    constexpr measurement::StartingCapacity none;
    return capacity && (capacity->ratio_ppm != none.ratio_ppm || capacity->sigma_ppm != none.sigma_ppm);
  }

  std::optional<measurement::StartingPoint> soc;
  std::optional<measurement::StartingCapacity> capacity;
};
/// shift: correction of such an assumption by the cell file (mechanism initial_soc). Clamped to 0 .. 1.
std::optional<measurement::StartingPoint> starting_point(const std::optional<SocPrior>& prior, double shift = 0);

/// Number of further states with this cell file; name_states() sets their names and scales.
std::size_t state_count(const files::CellFile& cell);
void name_states(Track& track, const files::CellFile& cell);

/// Whether a run is repeated until its speed is known.
enum class Timing { measured, none };

/// Runs the estimator on this machine. Throws BadInput if the cell file cannot be computed with this scalar.
Track run_on_host(const files::CellFile& cell, const measurement::SampleList& samples, const Start& start,
                  ScalarKind scalar, Timing timing = Timing::measured);

/// The first difference between two runs.
struct Difference {
  std::size_t sample = 0;
  std::string field;
  double host = 0, board = 0;
};
/// Nothing if all bits are equal.
std::optional<Difference> first_difference(const Track& host, const Track& board, ScalarKind scalar);

struct SocFigures {
  double final = 0, final_sigma = 0;
  std::optional<double> rmse, max_error, rmse_after_30min, max_error_after_30min, within_2_sigma;
  std::optional<double> current_offset_a, current_offset_sigma_a;  ///< at the end, if sensor errors are states
};
struct VoltageFigures {
  std::optional<double> prediction_rmse_v, prediction_max_v, open_loop_rmse_v,
      open_loop_fit_percent;  ///< nothing: no measured voltage
};

/// The cell's true capacity, from the log (host_sim/replay/capacity_estimate.hpp).
struct CapacityEstimate {
  double value_ah = 0, std_ah = 0;
};

struct ReplayResult {
  measurement::Recording recording;
  files::CellFile cell;
  std::string target;
  ScalarKind scalar = ScalarKind::float32;
  std::optional<SocPrior> prior;        ///< given by the user
  double initial_soc = 0;               ///< of the prior, or of the estimator after the first sample
  std::optional<double> open_loop_soc;  ///< where the open loop starts, less the cell file's shift; nothing: at
                                        ///< soc_ref, or else at initial_soc
  Track track;
  std::vector<double> open_loop_v;
  SocFigures soc;
  VoltageFigures voltage;
  std::optional<std::string> verified_against;       ///< board with the same bits
  std::optional<std::string> difference;             ///< or the first difference, in words
  std::size_t run = 0, runs = 0;                     ///< of a CAN log: which run of the firmware, and their number
  std::optional<measurement::SocColumn> soc_column;  ///< nothing: the log has none, or a reference instrument's
  std::optional<CapacityEstimate> capacity;          ///< nothing: not determined by the log
  std::optional<double> counted_capacity_ah;         ///< by which the charge is counted; nothing: by the cell file's
  std::vector<std::string> reasons;                  ///< sentences for the flags of the estimator
  std::vector<std::string> doubts;  ///< why the estimates are not reliable (host_sim/replay/judgement.hpp)
};

/// Fills soc, voltage and open_loop_v from the track and the recording. The open loop starts by model/start.hpp.
void evaluate(ReplayResult& result);

/// CSV: time_s,soc,soc_sigma,v_rc_v,voltage_predicted_v,voltage_measured_v, further states, flags. write_trace() gives
/// it piece by piece: it may be larger than the memory.
void write_trace(const ReplayResult& result, const files::Sink& sink);
std::string trace_csv(const ReplayResult& result);

/// "float", "fixed", "double": as on the command line.
const char* name_of(ScalarKind scalar);

}  // namespace bms::replay
