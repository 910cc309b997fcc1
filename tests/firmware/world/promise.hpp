// What the firmware promises, and a judge of whether it does it.
//
// The promise is the table of protections in firmware/protection/README.md, read as text. The judge knows the true
// voltages, currents and temperatures, and compares with them what is published on the bus:
//
//   missed   a quantity was beyond its threshold by more than the tolerance of its measurement, without a break, for
//            the delay of the row and the time of the measuring chain, and the fault is not published
//   false    a fault is published although its quantity was not beyond the threshold, less the tolerance, for its delay
//
// Rows that the truth does not determine (contactors, missing readings, internal faults) are faults that a case has to
// expect or to allow.
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/firmware/world/truck_world.hpp"

namespace bms::world {

enum class Reaction { warn, derate, forbid_charge, forbid_discharge, open, open_now };

struct Row {
  unsigned bit = 0;
  std::string name, quantity;
  bool above = true;  ///< raised above the threshold
  double threshold = 0, delay_s = 0;
  bool released_above = false;
  double release_threshold = 0, release_s = 0;
  std::string recovery;
  Reaction reaction = Reaction::warn;
};

/// Thresholds of currents are multiplied by `current_factor`; those of the pack, printed for 16 cells, follow `cells`.
/// Throws std::runtime_error if the file has no such table, or a row cannot be read.
std::vector<Row> promised_rows(const std::filesystem::path& readme, double current_factor = 1, std::size_t cells = 16);

/// Time of the measuring chain: a scan of the front end, a sample period, processing and the bus.
inline constexpr double chain_s = 0.45;
/// A contactor opens within this time (assumption A-02).
inline constexpr double contactor_s = 0.03;
/// Time that the reactions `open` and `forbid` give the truck.
inline constexpr double grace_s = 5;

class Judge {
 public:
  Judge(TruckWorld& world, std::vector<Row> rows, double limit_a);

  /// At the end of each step.
  void step();

  std::uint64_t expected = 0;                         ///< faults that a case causes, other than by quantities
  std::uint64_t allowed = 0;                          ///< faults that may also be published
  bool blind = false;                                 ///< the front end does not measure: nothing can be missed
  double more_tolerance_v = 0, more_tolerance_a = 0;  ///< of the noise
  double more_delay_share = 0;                        ///< noise delays a fault by so much of its delay

  const std::vector<std::string>& findings() const { return findings_; }
  unsigned missed() const { return missed_; }
  unsigned falsely() const { return falsely_; }
  const std::vector<Row>& rows() const { return rows_; }
  const Row& row(unsigned bit) const;
  bool judged(const Row& row) const;

 private:
  double most_excess_s(const Row& row) const;
  struct Watch {
    double beyond_s = 0;                           ///< surely beyond the threshold, without a break
    double perhaps_s = 0;                          ///< counts up and down
    std::deque<std::pair<double, double>> recent;  ///< time, perhaps_s
    bool reported = false;
  };
  double value(const Row& row) const;
  double tolerance(const Row& row) const;
  void watch(const Row& row, Watch& w, double now_s, double step_s);
  void check_raised(std::uint64_t raised, double now_s);
  void check_open(double now_s);
  void find(const std::string& what) { findings_.push_back(what); }

  TruckWorld& world_;
  std::vector<Row> rows_;
  std::vector<Watch> watches_;
  double limit_a_, last_s_, charge_overload_s_ = 0, discharge_overload_s_ = 0, charge_excess_s_ = 0,
                            discharge_excess_s_ = 0, opening_since_s_ = -1;
  std::uint64_t before_;
  unsigned missed_ = 0, falsely_ = 0;
  std::vector<std::string> findings_;
};

}  // namespace bms::world
