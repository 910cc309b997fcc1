// One update of one battery: asks what runs, sends the container for the other slot of its kind, starts it, and
// waits for what the battery says afterwards. Services: firmware/boot/update_server.hpp.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "authentication/codes.hpp"
#include "boot/iso_tp.hpp"
#include "boot/update_server.hpp"
#include "monitor/frame_source.hpp"
#include "update/container_file.hpp"

namespace bms::update {

/// Messages to the battery and back. Times are those of the steady clock.
class Link {
 public:
  explicit Link(monitor::FrameSource& source) : source_(source) {}

  using Bytes = std::vector<std::uint8_t>;
  /// The answer; "response pending" is waited for. Nothing if the battery is silent for wait_ms.
  std::optional<Bytes> request(const Bytes& message, int wait_ms = 1'500);

 private:
  void pump(int wait_ms);

  monitor::FrameSource& source_;
  std::deque<can::Frame> arrived_;
  boot::IsoTp transport_{boot::update_request_id, boot::update_response_id};
};

/// What a battery says about itself.
struct BatteryState {
  std::string board;
  std::optional<std::uint8_t> running;  ///< slot; nothing: the loader waits
  bool trial = false, returned = false;
  bool development_image = false, accepts_development = false;
  std::uint32_t version = 0, cell_hash = 0, security_counter = 0, loader = 0, received = 0;
  std::optional<std::uint32_t> up_ms;  ///< time since its start; an earlier update server does not state it
};

/// Its cell constants.
struct CellState {
  std::optional<std::uint8_t> slot;  ///< whose constants act; nothing: those of the application's build
  bool trial = false, returned = false;
  std::uint32_t version = 0, acting_hash = 0, built_hash = 0, security_counter = 0;
  boot::Refusal refusal = boot::Refusal::none;  ///< why the newest do not act
};

struct UpdateWish {
  std::vector<Container> containers;  ///< of one kind
  /// Of cell constants: called with the hash of the cell file that acts, before anything is sent. Returns why not,
  /// empty to go on.
  std::function<std::string(std::uint32_t acting_hash)> gate = [](std::uint32_t) { return std::string(); };
  std::optional<authentication::Key> device_key;
  std::uint16_t operator_number = 0;
  double start_wait_s = 90;   ///< for the new image to confirm itself
  double restart_wait_s = 3;  ///< a sample, and the state that is stored before
  double sample_wait_s = 10;  ///< from a start to the first sample, before which it does not know that it rests
  /// Between two questions whether the trial is over.
  std::function<void()> pause = [] { std::this_thread::sleep_for(std::chrono::milliseconds(200)); };
  std::function<void(std::uint32_t done, std::uint32_t of)> progress = [](std::uint32_t, std::uint32_t) {};
};

struct UpdateResult {
  enum class Outcome { done, refused, returned } outcome = Outcome::refused;
  boot::Kind kind = boot::Kind::application;
  std::string from, to, reason;  ///< versions; of cell constants "cell " and the hash of the cell file
  double seconds = 0;
  std::uint32_t sent = 0, resumed_at = 0;  ///< bytes
};

/// As tables and JSON have it: done, refused, returned.
const char* name_of(UpdateResult::Outcome outcome);

/// Nothing if there is no battery with an update server.
std::optional<BatteryState> read_state(Link& link);

/// Nothing if firmware or boot loader know no cell constants of an update.
std::optional<CellState> read_cell_state(Link& link);

UpdateResult run_update(monitor::FrameSource& source, const UpdateWish& wish);

}  // namespace bms::update
