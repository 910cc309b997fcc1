#include "firmware/update_service.hpp"

#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/device_key.hpp"
#include "hal/random.hpp"
#include "hal/start_image.hpp"
#include "hal/update_frames.hpp"

namespace bms::firmware {

namespace {

static_assert(hal::update_frame_id == boot::update_request_id);

template <class Message>
Message message_at(std::uint32_t address) {
  Message m;
  const auto* from = reinterpret_cast<const volatile std::uint8_t*>(address);
  auto* to = reinterpret_cast<std::uint8_t*>(&m);
  for (std::size_t k = 0; k < sizeof m; ++k) to[k] = from[k];
  return m;
}

/// The key of the sessions. A product without a key of its own opens none: a key that nobody knows.
std::optional<authentication::Key> service_key(const std::optional<authentication::Key>& device) {
  if (device && (*device != authentication::development_key || hal::development_image()))
    return authentication::role_key(*device, authentication::Role::service);
  if (hal::development_image()) return std::nullopt;
  authentication::Key unknown{};
  for (std::size_t k = 0; k < unknown.size(); k += 4) hal::put_bytes(unknown, k, hal::random_word());
  return unknown;
}

}  // namespace

UpdateService& UpdateOfBoard<true>::update() {
  static UpdateService service;
  return service;
}

void UpdateOfBoard<true>::restart() { hal::restart(); }

void UpdateService::start(std::uint32_t starts, std::uint32_t operating_s) {
  const auto handover = message_at<boot::Handover>(boot::handover_address);
  const auto started = boot::start_of(handover);
  if (!started) return;  // no loader has started this image: it runs alone
  started_ = *started;
  trial_ = started_.trial;
  keys_.emplace(boot::key_table_bytes(), slots_);
  battery_ = boot::chip_battery(BMS_BOARD, *keys_, slots_, handover.loader_version);
  const auto device = hal::device_key();
  challenges_.emplace(device.value_or(authentication::Key{}), starts, operating_s);
  const auto cell = boot::start_of(message_at<boot::CellHandover>(boot::cell_handover_address));
  std::optional<boot::CellSlots> cells;
  if (cell) {  // a loader that starts cell constants
    cell_ = *cell;
    cell_battery_ = boot::for_cells(battery_, cells_, firmware::cell_hash_of_build());
    cell_battery_.content = check_cell_constants;
    cells.emplace(boot::CellSlots{cells_, cell_battery_, cell_});
  }
  server_.emplace(slots_, battery_, started_, service_key(device), *this, boot::check_fields_and_key, cells);
  if (cell_.found) use_cell();
  node_.emplace(*server_, *this);
  hal::listen_for_updates(+[](const can::Frame& frame) { UpdateOfBoard<true>::update().receive(frame); });
}

/// What the loader has checked still has to be constants that this application can use.
void UpdateService::use_cell() {
  boot::HeaderBytes header{};
  cells_.read(cell_.slot, 0, header);
  boot::Header h;
  boot::Refusal refusal = boot::check_fields_and_key(header, cell_battery_, cell_.slot, h);
  if (refusal == boot::Refusal::none) {
    const auto bytes = server_->room().first(h.payload_bytes);
    cells_.read(cell_.slot, boot::header_bytes, bytes);
    refusal = use_cell_constants(bytes, h.cell_hash);
  }
  if (refusal == boot::Refusal::none) return;
  cell_.found = false;
  server_->cell_refused(refusal);
}

std::uint64_t UpdateService::challenge() { return challenges_->next(hal::now_us()); }

void UpdateService::receive(const can::Frame& frame) {
  const std::uint64_t now_us = hal::now_us();
  node_->receive(frame, now_us);
  send_waiting(now_us);
}

void UpdateService::send_waiting(std::uint64_t now_us) {
  can::Frame out;
  while (!restart_wanted_ && node_->next_frame(out, now_us)) hal::can_send(out);
}

bool UpdateService::restart_due(const Health& health) {
  if (!node_) return false;
  at_rest_ = health.at_rest;
  // The answer left with an earlier sample. A drive that began meanwhile goes on: the restart has to be asked for
  // again.
  if (restart_wanted_) {
    restart_wanted_ = false;
    return at_rest_;
  }
  // Constants on trial that cannot be used have failed: after the restart those act that were confirmed before.
  if (cell_.trial && !cell_.found) return true;
  if (on_trial()) judge_trial(health);
  if (on_trial() && health.now_us - first_us_ > longest_trial_us) return true;
  send_waiting(hal::now_us());
  return false;
}

void UpdateService::judge_trial(const Health& health) {
  if (!timed_) first_us_ = health.now_us;
  timed_ = true;
  const bool healthy = health.measured && health.fit && hal::can_listening();
  if (healthy && !was_healthy_) healthy_since_us_ = health.now_us;
  was_healthy_ = healthy;
  if (!healthy || health.now_us - healthy_since_us_ < healthy_us) return;
  // never both: the loader starts cell constants on trial only with a confirmed image
  boot::SlotFlash& slots = trial_ ? static_cast<boot::SlotFlash&>(slots_) : cells_;
  const boot::Start& tried = trial_ ? started_ : cell_;
  if (!boot::confirm(slots, tried.slot, tried.header.security_version)) return;
  (trial_ ? battery_ : cell_battery_).security_counter = boot::security_counter(slots);
  trial_ = cell_.trial = false;
  server_->confirmed();
}

}  // namespace bms::firmware
