#include "hal/bq76952/wire.hpp"

#include <algorithm>

#include "hal/bq76952/crc8.hpp"
#include "hal/bq76952/registers.hpp"
#include "hal/bytes.hpp"
#include "hal/clock.hpp"

namespace bms::hal::bq76952 {

namespace {

constexpr std::uint8_t address_to_write = i2c_address << 1, address_to_read = i2c_address << 1 | 1;
constexpr int max_attempts = 3;                  // to read an answer that is not ready yet: 3.5 ms of I2C
constexpr std::uint8_t max_wrong_checksums = 2;  // then it is another one

/// Inverted sum of the bytes of address and data (13.1).
std::uint8_t checksum(std::uint16_t address, std::span<const std::uint8_t> data) {
  auto sum = static_cast<std::uint8_t>((address & 0xFF) + (address >> 8));
  for (const std::uint8_t byte : data) sum = static_cast<std::uint8_t>(sum + byte);
  return static_cast<std::uint8_t>(~sum);
}

}  // namespace

bool Wire::fail(std::uint32_t& counter) {
  ++counter;
  return false;
}

bool Wire::transfer(std::span<const std::uint8_t> out, std::span<std::uint8_t> in) {
  ++counters_.transfers;
  const I2cResult result = bus.transfer(i2c_address, out, in);
  retry_useful_ = result == I2cResult::no_acknowledge;
  switch (result) {
    case I2cResult::done:
      return true;
    case I2cResult::no_acknowledge:
      return fail(counters_.not_acknowledged);
    case I2cResult::bus_stuck:
      ++counters_.stuck;
      break;
    case I2cResult::timed_out:
      ++counters_.timed_out;
      break;
  }
  const bool free = bus.recover();
  retry_useful_ = free && result == I2cResult::bus_stuck;
  return false;
}

bool Wire::read_once(std::uint8_t command, std::span<std::uint8_t> into) {
  const std::array<std::uint8_t, 1> out{command};
  if (check == Check::plain) return transfer(out, into);
  std::array<std::uint8_t, 2 * most_bytes> raw;
  if (into.size() > most_bytes || !transfer(out, std::span(raw).first(2 * into.size()))) return false;
  std::uint8_t crc = crc8(crc8(crc8(0, address_to_write), command), address_to_read);
  for (std::size_t k = 0; k < into.size(); ++k) {
    retry_useful_ = true;
    if (crc8(crc, raw[2 * k]) != raw[2 * k + 1]) return fail(counters_.bad_crc);
    into[k] = raw[2 * k];
    crc = 0;
  }
  return true;
}

bool Wire::read(std::uint8_t command, std::span<std::uint8_t> into) {
  const bool buffer = command >= subcommand_low && command < alarm_status;
  if (!by_words || buffer) return read_or_repeat(command, into);
  for (std::size_t k = 0; k < into.size(); k += 2) {
    const auto part = into.subspan(k, std::min<std::size_t>(2, into.size() - k));
    if (!read_or_repeat(static_cast<std::uint8_t>(command + k), part)) return false;
  }
  return true;
}

bool Wire::read_or_repeat(std::uint8_t command, std::span<std::uint8_t> into) {
  if (read_once(command, into)) return true;
  if (!retry_useful_) return false;
  ++counters_.repeated;
  return read_once(command, into);
}

bool Wire::read_word(std::uint8_t command, std::uint16_t& word) {
  std::array<std::uint8_t, 2> bytes{};
  if (!read(command, bytes)) return false;
  word = get_bytes<std::uint16_t>(bytes, 0);
  return true;
}

bool Wire::write(std::uint8_t command, std::span<const std::uint8_t> data) {
  constexpr std::size_t most = 8;
  std::array<std::uint8_t, 1 + 2 * most> out{command};
  if (data.size() > most) return false;
  std::size_t n = 1;
  std::uint8_t crc = crc8(crc8(0, address_to_write), command);
  for (const std::uint8_t byte : data) {
    out[n++] = byte;
    if (check == Check::checked) out[n++] = crc8(crc, byte);
    crc = 0;
  }
  if (transfer(std::span(out).first(n), {})) return true;
  if (!retry_useful_) return false;
  ++counters_.repeated;
  return transfer(std::span(out).first(n), {});
}

bool Wire::select(std::uint16_t address) {
  std::array<std::uint8_t, 2> bytes{};
  put_bytes(bytes, 0, address);
  return write(subcommand_low, bytes);
}

/// Counts a wrong checksum of a DASTATUS block. Returns true if the chip seems to compute it in another way.
bool Wire::has_another_checksum() {
  if (status_checksum_right_ || check == Check::plain) return false;
  if (status_checksum_wrong_ < max_wrong_checksums) ++status_checksum_wrong_;
  return status_checksum_wrong_ >= max_wrong_checksums;
}

/// Returns true if the transfer buffer has the bytes of `block`, so that the chip did not update it in between.
bool Wire::same_again(std::span<const std::uint8_t> block) {
  std::array<std::uint8_t, 2 + buffer_bytes + 2> again;
  return read(subcommand_low, again) && std::equal(block.begin(), block.end(), again.begin());
}

bool Wire::fetch(std::uint16_t address, std::span<std::uint8_t> into) {
  std::array<std::uint8_t, 2 + buffer_bytes + 2> all;  // address, data, checksum, length
  for (int k = 0; k < max_attempts; ++k) {
    if (!read(subcommand_low, all)) return false;
    if (get_bytes<std::uint16_t>(all, 0) != address) {  // 0xFF while the chip is busy
      ++counters_.not_ready;
      continue;
    }
    const std::size_t length = all[2 + buffer_bytes + 1];
    if (length < buffer_overhead + into.size() || length > buffer_overhead + buffer_bytes)
      return fail(counters_.bad_checksum);
    const auto data = std::span<const std::uint8_t>(all).subspan(2, length - buffer_overhead);
    const bool right = checksum(address, data) == all[2 + buffer_bytes];
    const bool status = address == get_currents || address == get_charge;
    status_checksum_right_ = status_checksum_right_ || (status && right);
    if (!right && !(status && has_another_checksum() && same_again(all))) return fail(counters_.bad_checksum);
    std::copy_n(data.begin(), into.size(), into.begin());
    return true;
  }
  return false;
}

bool Wire::send(std::uint16_t address, std::span<const std::uint8_t> data) {
  std::array<std::uint8_t, 8> bytes{};
  put_bytes(bytes, 0, address);
  if (data.size() + 2 > bytes.size()) return false;
  std::copy(data.begin(), data.end(), bytes.begin() + 2);
  const std::array<std::uint8_t, 2> end{checksum(address, data),
                                        static_cast<std::uint8_t>(data.size() + buffer_overhead)};
  return write(subcommand_low, std::span(bytes).first(data.size() + 2)) && write(buffer_checksum, end);
}

bool Wire::detect(std::uint16_t& status) {
  std::array<std::uint8_t, 4> raw{};  // a chip without CRCs sends the following registers
  const std::array<std::uint8_t, 1> out{battery_status};
  if (!transfer(out, raw) && !(retry_useful_ && transfer(out, raw))) return false;
  const std::uint8_t first = crc8(crc8(crc8(crc8(0, address_to_write), battery_status), address_to_read), raw[0]);
  const bool crcs_match = raw[1] == first && raw[3] == crc8(0, raw[2]);
  check = crcs_match ? Check::checked : Check::plain;
  status = static_cast<std::uint16_t>(check == Check::checked ? raw[0] | raw[2] << 8 : raw[0] | raw[1] << 8);
  return true;
}

}  // namespace bms::hal::bq76952
