// Asks a battery for its stored data until all parts have arrived: the command first, and again for what is missing
// after a silence. Time is this computer's, in seconds from any origin.
#pragma once

#include <cstdint>
#include <optional>

#include "monitor/stored_data.hpp"

namespace bms::monitor {

class StoredDataRequest {
 public:
  /// Returns the command if it is time to send it.
  std::optional<can::Frame> due(double now_s);
  /// message: what bus.receive() has returned.
  void receive(const BusState& bus, std::size_t message, double now_s);

  enum class State {
    waiting,
    complete,
    unsupported,  ///< the firmware does not know the command
    refused,      ///< the firmware does not accept the command
    given_up,     ///< no part has arrived after several commands
  };
  State state() const { return state_; }
  bool answered() const { return answered_; }
  const StoredData& data() const { return data_; }

 private:
  static constexpr double silence_s = 2.5;  ///< more than the longest time between two samples
  static constexpr int most_tries = 5;      ///< commands without any part in between

  void receive_answer(const BusState& bus);

  StoredData data_;
  State state_ = State::waiting;
  bool answered_ = false;
  double next_s_ = 0;
  bool begun_ = false;
  int tries_ = 0;
  std::uint8_t counter_ = 0;
};

}  // namespace bms::monitor
