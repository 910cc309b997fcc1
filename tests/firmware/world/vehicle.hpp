// The truck's controller on the bus: it repeats its request each second and reads what the board publishes. Frames are
// read by the layout of firmware/can/greybox_bms.dbc. The generated packing is used for the commands only.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/firmware/unicorn_board.hpp"

namespace bms::world {

enum class Request : std::uint32_t { none = 0, drive = 1, charge = 2 };

class Vehicle {
 public:
  explicit Vehicle(firmware::UnicornBoard& board) : board_(board) {}

  /// Reads new frames and sends what is due.
  void update();

  Request request = Request::none;
  bool talks = true;
  std::uint16_t base = 0x180;                       ///< where the identifiers of the board's messages begin on this bus
  std::function<void(const can::Frame&)> on_frame;  ///< each frame of the board, for other nodes
  void clear_faults(bool service = false);
  /// frame: with the identifier of the DBC file.
  void send(can::Frame frame);

  // what the board has published last
  std::uint64_t faults() const { return faults_; }  ///< one bit for each fault, also those of the second message
  bool fault(unsigned bit) const { return (faults_ >> bit & 1) != 0; }
  unsigned first_cause() const { return first_cause_; }  ///< number of a bit plus 1; 0: none
  unsigned state() const { return state_; }              ///< ContactorState.State
  bool charge_enabled() const { return charge_enabled_; }
  double allowed_charge_a() const { return allowed_charge_a_; }
  double allowed_discharge_a() const { return allowed_discharge_a_; }
  double insulation_kohm() const { return insulation_kohm_; }      ///< negative: not known
  double longest_sample_ms() const { return longest_sample_ms_; }  ///< Board.LongestSample; negative: not published
  double soc_percent() const { return soc_percent_; }
  double soc_sigma_percent() const { return soc_sigma_percent_; }
  /// Shortest and longest time between two PackState messages, one of each sample [ms].
  double shortest_cycle_ms = 1e9, longest_cycle_ms = 0;
  double silent_ms() const;  ///< since the last Faults message
  /// All faults that were published since the start or since forget().
  std::uint64_t faults_seen() const { return seen_; }
  /// TruckInputs has said that the coils have no supply, since the start or since forget().
  bool coils_dead_seen() const { return coils_dead_seen_; }
  void forget() {
    seen_ = faults_;
    coils_dead_seen_ = false;
  }

  struct Change {
    double at_ms;
    std::uint64_t raised, ended;
  };
  const std::vector<Change>& changes() const { return changes_; }
  /// Time at which a fault was published first after `from_ms`, or a negative value.
  double raised_ms(unsigned bit, double from_ms) const;
  std::array<unsigned, 2048> frames{};  ///< received frames by identifier

 private:
  void read(can::Frame frame, double at_ms);
  void send(std::uint32_t code, std::uint32_t argument);
  void publish(std::uint64_t faults, double at_ms);

  firmware::UnicornBoard& board_;
  std::size_t read_ = 0;
  double next_request_ms_ = 0, received_ms_ = 0, pack_state_ms_ = -1;
  std::uint8_t counter_ = 0;
  Request sent_ = Request::none;
  std::uint64_t faults_ = 0, seen_ = 0;
  unsigned first_cause_ = 0, state_ = 15;
  bool charge_enabled_ = false, coils_dead_seen_ = false;
  double allowed_charge_a_ = 0, allowed_discharge_a_ = 0, soc_percent_ = -1, soc_sigma_percent_ = 0,
         longest_sample_ms_ = -1, insulation_kohm_ = -1;
  std::vector<Change> changes_;
};

/// Names of the faults in a set, separated by commas.
std::string fault_names(std::uint64_t faults);

}  // namespace bms::world
