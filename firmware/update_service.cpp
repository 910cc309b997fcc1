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

boot::Handover read_handover() {
  boot::Handover h;
  const auto* from = reinterpret_cast<const volatile std::uint8_t*>(boot::handover_address);
  auto* to = reinterpret_cast<std::uint8_t*>(&h);
  for (std::size_t k = 0; k < sizeof h; ++k) to[k] = from[k];
  return h;
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
  const boot::Handover handover = read_handover();
  const auto started = boot::start_of(handover);
  if (!started) return;  // no loader has started this image: it runs alone
  started_ = *started;
  trial_ = started_.trial;
  keys_.emplace(boot::key_table_bytes(), slots_);
  battery_ = boot::chip_battery(BMS_BOARD, *keys_, slots_, handover.loader_version);
  const auto device = hal::device_key();
  challenges_.emplace(device.value_or(authentication::Key{}), starts, operating_s);
  server_.emplace(slots_, battery_, started_, service_key(device), *this, boot::check_fields_and_key);
  node_.emplace(*server_, *this);
  hal::listen_for_updates(+[](const can::Frame& frame) { UpdateOfBoard<true>::update().receive(frame); });
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
  if (trial_) judge_trial(health);
  if (trial_ && health.now_us - first_us_ > longest_trial_us) return true;
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
  if (!boot::confirm(slots_, started_.slot, started_.header.security_version)) return;
  trial_ = false;
  battery_.security_counter = boot::security_counter(slots_);
  server_->confirmed();
}

}  // namespace bms::firmware
