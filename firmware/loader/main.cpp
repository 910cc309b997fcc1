// The boot loader: started by every reset. It decides which of the two images runs and with which cell constants,
// checks both completely, leaves a message of what was decided, and starts the image under the watchdog. If no image
// may run, it waits for one on the bus.
#include <optional>

#include "authentication/codes.hpp"
#include "boot/chip_slots.hpp"
#include "boot/handover.hpp"
#include "boot/update_server.hpp"
#include "challenge_source.hpp"
#include "hal/accepted_frames.hpp"
#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/device_key.hpp"
#include "hal/start_image.hpp"
#include "hal/supply.hpp"
#include "hal/watchdog.hpp"

namespace {

/// Longer than the erase of a sector; the image that starts sets its own. 5.4 to 15 s.
constexpr std::uint32_t watchdog_ms = 8'000;
constexpr std::array<std::uint16_t, 1> received_ids{bms::boot::update_request_id};

/// Erased; bms image loader writes the keys (firmware/boot/key_table.hpp).
[[gnu::section(".loader_keys"), gnu::used]] constexpr auto image_loader_keys = [] {
  std::array<std::uint8_t, bms::boot::most_keys * bms::boot::key_entry_bytes> none{};
  none.fill(0xFF);
  return none;
}();

/// No image runs: nothing is protected, and nothing can close a contactor.
class Waiting final : public bms::boot::UpdateSurroundings {
 public:
  explicit Waiting(const std::optional<bms::authentication::Key>& device)
      : challenges_(device.value_or(bms::authentication::Key{}), 0, 0) {}
  bool at_rest() override { return true; }
  std::uint64_t challenge() override { return challenges_.next(bms::hal::now_us()); }
  void restart() override {
    if (wanted_us_ == 0) wanted_us_ = bms::hal::now_us();
  }
  /// The answer leaves the controller before the restart.
  bool restart_due() const { return wanted_us_ != 0 && bms::hal::now_us() - wanted_us_ > 20'000; }

 private:
  bms::firmware::ChallengeSource challenges_;
  std::uint64_t wanted_us_ = 0;
};

[[noreturn]] void wait_for_an_image(bms::boot::ChipSlots& slots, const bms::boot::Battery& battery,
                                    const bms::boot::Start& start) {
  using namespace bms;
  const auto device = hal::device_key();
  static Waiting surroundings(device);
  std::optional<authentication::Key> service;
  if (device) service = authentication::role_key(*device, authentication::Role::service);
  static boot::UpdateServer server(slots, battery, start, service, surroundings);
  static boot::UpdateNode node(server, surroundings);
  hal::can_start();
  while (!surroundings.restart_due()) {
    hal::watchdog_feed();
    can::Frame frame;
    while (hal::can_receive(frame)) node.receive(frame, hal::now_us());
    hal::can_listening();
    while (node.next_frame(frame, hal::now_us())) hal::can_send(frame);
    hal::wait_for_interrupt();
  }
  hal::restart();
}

/// For the image, which finds nothing of an interrupted start.
template <class Message>
void leave(std::uint32_t address, const Message& message) {
  *reinterpret_cast<volatile std::uint32_t*>(address) = 0;
  std::ranges::copy(std::span(reinterpret_cast<const std::uint8_t*>(&message), sizeof message),
                    reinterpret_cast<volatile std::uint8_t*>(address));
}

}  // namespace

void bms::hal::supply_failing() {}
std::span<const std::uint16_t> bms::hal::accepted_ids() { return received_ids; }

int main() {
  using namespace bms;
  hal::clock_start();
  hal::watchdog_start(watchdog_ms);
  static boot::ChipSlots slots(true);
  const boot::KeyTable keys(boot::key_table_bytes(), slots);
  const boot::Battery battery = boot::chip_battery(BMS_BOARD, keys, slots, BMS_LOADER_VERSION);
  const boot::Start start = boot::choose(slots, battery, hal::started_by_power());
  hal::watchdog_feed();
  if (!start.found) wait_for_an_image(slots, battery, start);
  boot::erase_if_asked(slots, static_cast<std::uint8_t>(1 - start.slot));
  static boot::ChipSlots cells(true, boot::Kind::cell);
  const boot::Battery cell_battery = boot::for_cells(battery, cells, start.header.cell_hash);
  const boot::Start cell = boot::choose_cell(cells, cell_battery, start, hal::started_by_power());
  leave(boot::handover_address, boot::handover_of(start, battery));
  leave(boot::cell_handover_address, boot::cell_handover_of(cell, cell_battery));
  hal::start_image(boot::payload_address(boot::Kind::application, start.slot));
}
