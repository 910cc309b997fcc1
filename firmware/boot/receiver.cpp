#include "boot/receiver.hpp"

namespace bms::boot {

Refusal Receiver::prepare() {
  active_ = false;
  received_ = 0;
  if (to_.running < 2) {
    // The target holds the image that returns if a trial fails. A confirmation that was interrupted becomes stable.
    if (!read_marks(flash(), to_.running).confirmed) return Refusal::not_confirmed;
    if (!confirm(flash(), to_.running, 0)) return Refusal::flash_failed;
  }
  if (!flash().erases_now()) {
    if (read_marks(flash(), target()).erased) return Refusal::none;
    return ask_for_erase(flash(), target()) ? Refusal::erase_at_restart : Refusal::flash_failed;
  }
  return boot::prepare(flash(), target()) ? Refusal::none : Refusal::flash_failed;
}

Refusal Receiver::begin(std::uint32_t container_bytes) {
  active_ = false;
  received_ = 0;
  if (container_bytes <= header_bytes) return Refusal::incomplete;
  if (container_bytes > battery().slot_bytes) return Refusal::too_large;
  if (!read_marks(flash(), target()).erased) return Refusal::not_erased;
  expected_ = container_bytes;
  active_ = true;
  return Refusal::none;
}

Refusal Receiver::take(std::span<const std::uint8_t> bytes) {
  if (!active_) return Refusal::incomplete;
  if (bytes.size() > expected_ - received_) return refuse(Refusal::too_large);
  for (const std::uint8_t byte : bytes) {
    if (received_ < header_bytes)
      header_room_[received_] = byte;
    else
      block_room_[(received_ - header_bytes) % block_bytes] = byte;
    ++received_;
    Refusal refusal = Refusal::none;
    if (received_ == header_bytes)
      refusal = header_complete();
    else if (received_ > header_bytes && ((received_ - header_bytes) % block_bytes == 0 || received_ == expected_))
      refusal = block_complete();
    if (refusal != Refusal::none) return refuse(refusal);
  }
  return Refusal::none;
}

Refusal Receiver::header_complete() {
  if (const Refusal r = check_(header_room_, battery(), target(), header_); r != Refusal::none) return r;
  if (header_.payload_bytes + header_bytes != expected_) return Refusal::incomplete;
  header_digest_ = sha256(header_room_);
  if (to_.running < 2) {
    HeaderBytes running{};
    flash().read(to_.running, 0, running);
    Header of{};
    if (read_header(running, of) == Refusal::none && of.release == header_.release) return Refusal::already_running;
  }
  return Refusal::none;
}

Refusal Receiver::block_complete() {
  const std::uint32_t block = (received_ - header_bytes - 1) / block_bytes;
  const auto bytes = std::span(block_room_).first(header_.block_size(block));
  if (sha256(bytes) != stated_hash(header_room_, block)) return Refusal::block_damaged;
  if (battery().content != nullptr) {
    if (const Refusal r = battery().content(bytes); r != Refusal::none) return r;
  }
  if (block == 0 && (!begin_writing(flash(), target()) || !write(0, header_room_))) return Refusal::flash_failed;
  return write(header_bytes + block * block_bytes, bytes) ? Refusal::none : Refusal::flash_failed;
}

bool Receiver::write(std::uint32_t at, std::span<const std::uint8_t> bytes) {
  for (std::size_t k = 0; k < bytes.size(); k += 4) {
    std::array<std::uint8_t, 4> four{0xFF, 0xFF, 0xFF, 0xFF};
    for (std::size_t i = 0; i < four.size() && k + i < bytes.size(); ++i) four[i] = bytes[k + i];
    if (!flash().program(target(), at + static_cast<std::uint32_t>(k), hal::get_bytes<std::uint32_t>(four, 0)))
      return false;
  }
  return true;
}

Refusal Receiver::finish() {
  if (!active_ || received_ != expected_) return refuse(Refusal::incomplete);
  active_ = false;
  Header header;
  if (const Refusal r = check_slot(flash(), battery(), target(), header, check_); r != Refusal::none) return r;
  return complete(flash(), target()) ? Refusal::none : Refusal::flash_failed;
}

std::uint32_t Receiver::resume(const Digest& header_digest) const {
  return active_ && received_ >= header_bytes && header_digest == header_digest_ ? received_ : 0;
}

}  // namespace bms::boot
