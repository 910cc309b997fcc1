#include "tests/firmware/flash_controller_model.hpp"

#include <algorithm>

namespace bms::firmware {

namespace {

constexpr std::uint32_t pg = 1U << 0, ser = 1U << 1, mer = 1U << 2, strt = 1U << 16,
                        lock = 1U << 31;                                       // FLASH_CR, 3.9.6
constexpr std::uint32_t pgperr = 1U << 6, pgserr = 1U << 7, wrperr = 1U << 4;  // FLASH_SR, 3.9.5

}  // namespace

std::uint32_t FlashControllerModel::read(std::uint32_t at) const {
  switch (at) {
    case 0x00:
      return acr_;
    case 0x0C:
      return sr_;
    case 0x10:
      return cr_;
    case 0x14:
      return option_bytes;
    default:
      return 0;
  }
}

void FlashControllerModel::write(std::uint32_t at, std::uint32_t value) {
  switch (at) {
    case 0x00:
      acr_ = value;
      return;
    case 0x04:
      return unlock(value);
    case 0x0C:
      sr_ &= ~value;
      return;
    case 0x10:
      return control(value);
    default:
      return;
  }
}

/// 3.6.1: two keys in sequence unlock; anything else locks until a reset.
void FlashControllerModel::unlock(std::uint32_t key) {
  if (keys_ == Keys::none && (cr_ & lock) != 0 && key == 0x45670123) {
    keys_ = Keys::first;
  } else if (keys_ == Keys::first && key == 0xCDEF89AB) {
    keys_ = Keys::none;
    cr_ &= ~lock;
  } else {
    keys_ = Keys::refused_until_reset;
    cr_ |= lock;
    violations.push_back("a wrong key locks the flash");
  }
}

void FlashControllerModel::control(std::uint32_t value) {
  if ((cr_ & lock) != 0) {
    violations.push_back("FLASH_CR is written while locked");
    return;
  }
  cr_ = value & ~strt;
  if ((value & strt) == 0) return;
  if ((value & (ser | mer | pg)) != ser)
    violations.push_back("an erase that is not a sector erase");
  else
    erase(value >> 3 & 15);
}

bool FlashControllerModel::fails_now(std::uint32_t address, std::uint32_t size, std::uint32_t before) {
  if (operations_to_power_loss < 0 || operations_to_power_loss-- > 0) return false;
  power_failed = true;
  torn = {address, size, before};
  return true;
}

void FlashControllerModel::program_elsewhere(std::uint32_t address, unsigned size, std::uint32_t value,
                                             std::uint32_t before) {
  if ((cr_ & lock) != 0 || (cr_ & pg) == 0) violations.push_back("flash is written without PG");
  if (size != 4 || (cr_ >> 8 & 3) != 2) violations.push_back("flash is written with a width other than PSIZE");
  const bool one_time = address >= 0x1FFF'0000;
  if (before != 0xFFFF'FFFF && value != before && value != 0 && !(one_time && (value & ~before) == 0))
    violations.push_back("flash is programmed without being erased");
  ++slot_words;
  stall_us_ += word_us;
  if (on_operation) on_operation({address, size, value});
  fails_now(address, size, before);
}

void FlashControllerModel::erase(std::uint32_t number) {
  if (number >= 5 && number <= 10 && erase_slot_sector) {
    constexpr std::uint32_t slot_sector_bytes = 128 * 1024;
    const std::uint32_t begin = 0x0802'0000 + (number - 5) * slot_sector_bytes;
    ++slot_sectors;
    if (on_operation) on_operation({begin, slot_sector_bytes, 0});
    stall_us_ += slot_erase_us;
    if (!fails_now(begin, slot_sector_bytes, ~0U)) erase_slot_sector(begin, slot_sector_bytes);
    return;
  }
  if (number < 1 || number > sectors) {
    violations.push_back("sector " + std::to_string(number) + " holds code and is erased");
    sr_ |= wrperr;
    return;
  }
  const auto begin = bytes.begin() + (number - 1) * sector_bytes;
  std::fill(begin, begin + sector_bytes, std::uint8_t{0xFF});
  ++sectors_erased;
  if (on_operation) on_operation({memory + (number - 1) * sector_bytes, sector_bytes, 0});
  stall_us_ += erase_us;
}

std::uint32_t FlashControllerModel::read_memory(std::uint32_t at, unsigned size) const {
  std::uint32_t value = 0;
  for (unsigned k = 0; k < size; ++k) value |= static_cast<std::uint32_t>(bytes[at + k]) << (8 * k);
  return value;
}

void FlashControllerModel::write_memory(std::uint32_t at, unsigned size, std::uint32_t value) {
  if ((cr_ & lock) != 0 || (cr_ & pg) == 0) {
    violations.push_back("flash is written without PG");
    sr_ |= pgserr;
    return;
  }
  if (size != 1U << (cr_ >> 8 & 3)) {
    violations.push_back("flash is written with a width other than PSIZE");
    sr_ |= pgperr;
    return;
  }
  const std::uint32_t before = read_memory(at, size), erased = size == 4 ? 0xFFFFFFFF : (1U << (8 * size)) - 1;
  if (before != erased && value != before && value != 0)
    violations.push_back("flash is programmed without being erased");
  for (unsigned k = 0; k < size && !worn_out; ++k) bytes[at + k] &= static_cast<std::uint8_t>(value >> (8 * k));
  ++words_programmed;
  if (on_operation) on_operation({memory + at, size, value});
  stall_us_ += word_us;
}

void FlashControllerModel::reset() {
  acr_ = sr_ = 0;
  cr_ = lock;
  keys_ = Keys::none;
}

double FlashControllerModel::take_stall_us() {
  const double us = stall_us_;
  stall_us_ = 0;
  return us;
}

}  // namespace bms::firmware
