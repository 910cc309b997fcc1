#include "tests/firmware/storage/flash_model.hpp"

namespace bms {

FlashModel::FlashModel(hal::FlashSize size, std::uint64_t seed)
    : size_(size),
      random_(seed),
      words_(size.sectors * size.sector_bytes / 4),
      worn_(size.sectors),
      erases_(size.sectors) {}

void FlashModel::wear_out(std::uint32_t sector, Wear how) {
  Worn& w = worn_[sector];
  switch (how) {
    case Wear::erase_fails:
      w.erase_fails = true;
      break;
    case Wear::erase_leaves_zeros:
      w.leaves_zeros = true;
      break;
    case Wear::bits_stuck_at_one:
      w.stuck_at_one = 0x00010000;
      break;
    case Wear::bits_stuck_at_zero:
      w.stuck_at_zero = 0x00000040;
      break;
  }
}

void FlashModel::fill(std::uint32_t sector, const std::vector<std::uint8_t>& bytes) {
  for (std::size_t k = 0; k < bytes.size() && k < size_.sector_bytes; ++k) {
    Word& w = word(sector, static_cast<std::uint32_t>(k));
    const unsigned shift = 8 * (k % 4);
    w.bits = (w.bits & ~(0xFFU << shift)) | static_cast<std::uint32_t>(bytes[k]) << shift;
    w.weak = 0;
    w.asked = w.bits;
    w.erased = w.bits == 0xFFFFFFFF;
  }
}

std::vector<std::uint8_t> FlashModel::bytes(std::uint32_t sector) {
  std::vector<std::uint8_t> all(size_.sector_bytes);
  read(sector, 0, all);
  return all;
}

void FlashModel::flip(std::uint32_t sector, std::uint32_t at, std::uint8_t bits) {
  word(sector, at).bits ^= static_cast<std::uint32_t>(bits) << (8 * (at % 4));
}

void FlashModel::make_unsteady(std::uint32_t sector, std::uint32_t at, std::uint8_t bits, std::uint32_t every) {
  unsteady_ = {sector, at / 4 * 4, static_cast<std::uint32_t>(bits) << (8 * (at % 4)), every, 0};
}

bool FlashModel::power_fails() {
  if (steps_++ != cut_at_) return false;
  cut_at_ = never;
  return true;
}

bool FlashModel::erase(std::uint32_t sector) {
  const bool cut = power_fails();
  ++erases_[sector];
  const Worn& worn = worn_[sector];
  // An interrupted erase: every word unchanged, erased, or partly erased; sometimes completely erased.
  const std::uint32_t kind = random() % 4;
  for (std::uint32_t at = 0; at < size_.sector_bytes; at += 4) {
    Word& w = word(sector, at);
    if (cut || worn.erase_fails) {
      const std::uint32_t how = kind < 2 ? kind + 1 : random() % 3;
      if (how == 0) continue;
      const std::uint32_t moved = how == 1 ? 0xFFFFFFFF : random() | random();
      w.weak = (w.weak | ~w.bits) & (how == 1 ? random() & random() & random() : random());
      w.bits |= moved;
      w.erased = false;
      w.asked = 0;  // programming here is a violation
      continue;
    }
    w = {};
    if (worn.leaves_zeros && random() % 16 == 0) w.bits &= ~(1U << random() % 32);
  }
  if (cut) throw PowerCut{};
  return !worn.erase_fails;
}

bool FlashModel::program(std::uint32_t sector, std::uint32_t at, std::uint32_t value) {
  const bool cut = power_fails();
  Word& w = word(sector, at);
  const bool may = w.erased || value == w.asked || value == 0;
  if (!may) ++violations_;
  const std::uint32_t to_clear = w.bits & ~value;
  w.erased = false;
  w.asked = value;
  if (cut) {
    // Each bit to be cleared: cleared, unchanged, or in between.
    const std::uint32_t begun = random() % 4 == 0 ? to_clear : to_clear & random();
    w.weak |= begun & (random() % 4 == 0 ? 0xFFFFFFFF : random());
    w.bits &= ~(begun & ~w.weak);
    throw PowerCut{};
  }
  w.bits &= value;
  w.weak &= value;
  return may;
}

std::uint32_t FlashModel::seen(std::uint32_t sector, std::uint32_t at) {
  if (reads_left_-- == 0) throw TooManyReads{};
  const Word& w = word(sector, at);
  std::uint32_t bits = w.bits;
  if (unsteady_.every > 0 && unsteady_.sector == sector && unsteady_.at == at / 4 * 4 &&
      ++unsteady_.reads % unsteady_.every == 0)
    bits ^= unsteady_.bits;
  if (w.weak != 0) {
    // Equal readings for a while, then another one, so that a whole record may read correctly once.
    const std::uint32_t draw = random();
    if (draw % 4 == 0)
      bits &= ~w.weak;
    else if (draw % 4 == 1)
      bits |= w.weak;
    else
      bits ^= w.weak & random();
  }
  const Worn& worn = worn_[sector];
  return (bits | worn.stuck_at_one) & ~worn.stuck_at_zero;
}

void FlashModel::read(std::uint32_t sector, std::uint32_t at, std::span<std::uint8_t> into) {
  for (std::size_t k = 0; k < into.size();) {
    const auto place = static_cast<std::uint32_t>(at + k);
    const std::uint32_t bits = seen(sector, place);
    do {
      into[k] = static_cast<std::uint8_t>(bits >> (8 * ((at + k) % 4)));
      ++k;
    } while (k < into.size() && (at + k) % 4 != 0);
  }
}

namespace {

FlashModel* plugged_in = nullptr;

}  // namespace

void plug_in(FlashModel* model) { plugged_in = model; }

namespace hal {

FlashSize flash_start() { return plugged_in != nullptr ? plugged_in->size() : FlashSize{}; }
bool flash_erase(std::uint32_t sector) { return plugged_in->erase(sector); }
bool flash_program(std::uint32_t sector, std::uint32_t at, std::uint32_t word) {
  return plugged_in->program(sector, at, word);
}
void flash_read(std::uint32_t sector, std::uint32_t at, std::span<std::uint8_t> into) {
  plugged_in->read(sector, at, into);
}

}  // namespace hal

}  // namespace bms
