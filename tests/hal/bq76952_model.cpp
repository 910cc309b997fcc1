#include "tests/hal/bq76952_model.hpp"

#include <algorithm>
#include <bit>
#include <bitset>
#include <cmath>

namespace bms {

namespace {

using hal::I2cResult;

/// CRC by long division: the message followed by eight zeros, modulo x^8 + x^2 + x + 1, bit by bit.
std::uint8_t crc_of(const std::vector<std::uint8_t>& message) {
  std::vector<bool> bits;
  for (const std::uint8_t byte : message) {
    for (int k = 7; k >= 0; --k) bits.push_back((byte >> k & 1) != 0);
  }
  bits.insert(bits.end(), 8, false);
  const std::bitset<9> divisor(0b100000111);
  for (std::size_t k = 0; k + 8 < bits.size(); ++k) {
    if (!bits[k]) continue;
    for (std::size_t j = 0; j < 9; ++j) bits[k + j] = bits[k + j] != divisor[8 - j];
  }
  std::uint8_t rest = 0;
  for (std::size_t k = bits.size() - 8; k < bits.size(); ++k)
    rest = static_cast<std::uint8_t>(rest << 1 | (bits[k] ? 1 : 0));
  return rest;
}

constexpr std::array<std::uint8_t, 4> temperature_register{0x70, 0x74, 0x76, 0x6A};
constexpr std::array<std::uint16_t, 4> temperature_pin{0x92FD, 0x92FF, 0x9300, 0x92FA};
constexpr double as_per_step = 36;  // 10 mAh

void put(std::span<std::uint8_t> to, std::size_t at, std::uint32_t value, std::size_t bytes) {
  for (std::size_t k = 0; k < bytes; ++k) to[at + k] = static_cast<std::uint8_t>(value >> 8 * k);
}

}  // namespace

Bq76952Model::Bq76952Model() { reset(); }

/// Factory state: those defaults of the manual that the model uses.
void Bq76952Model::reset() {
  memory_.clear();
  direct_ = {};
  set_memory(0x91A8, 4, std::bit_cast<std::uint32_t>(7.5684F));
  set_memory(0x91AC, 4, std::bit_cast<std::uint32_t>(7.5684F * 298261.6178F));
  set_memory(0x9234, 2, 0x2982);
  set_memory(0x926D, 2, 0xF800);
  set_memory(0x9303, 1, 0x05);
  set_memory(0x9307, 1, 80);
  set_memory(0x9275, 1, 50);
  set_memory(0x9278, 1, 86);
  checked_ = crc_from_otp;
  config_ = false;
  was_reset_ = true;
  alarm_ = 0;
  alarm_enable_ = 0xF800;
  balancing_ = 0;
  safety_a_ = safety_c_ = 0;
  slot_ = loop_ = cc3_count_ = 0;
  slot_as_ = cc1_as_ = cc3_sum_a_ = 0;
  cc2_ = cc3_ = 0;
  counted_ = 0x7FFF'FFFF;
  quarter_seconds_ = 0;
  slot_left_us_ = 3'000;
  cc1_left_us_ = 250'000;
  low_ = high_ = 0;
  last_transfer_us_ = time_us;
}

std::uint32_t Bq76952Model::memory(std::uint16_t address, std::size_t bytes) const {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < bytes; ++k) {
    const auto found = memory_.find(static_cast<std::uint16_t>(address + k));
    value |= static_cast<std::uint32_t>(found == memory_.end() ? 0 : found->second) << 8 * k;
  }
  return value;
}

void Bq76952Model::set_memory(std::uint16_t address, std::size_t bytes, std::uint32_t value) {
  for (std::size_t k = 0; k < bytes; ++k)
    memory_[static_cast<std::uint16_t>(address + k)] = static_cast<std::uint8_t>(value >> 8 * k);
}

bool Bq76952Model::enables_contactors() const {
  const auto driven = [&](std::uint16_t pin) {
    return memory(pin, 1) == 0xAA;
  };  // low at a fault; high comes from REG1, which has to be on
  return driven(0x9301) && driven(0x9302) && memory(0x9236, 1) == 0x0D && (memory(0x9237, 1) & 1) != 0 && !config_ &&
         safety_a_ == 0 && safety_c_ == 0;
}

// ---- measuring ----

double Bq76952Model::gain_seen() const {
  return static_cast<double>(std::bit_cast<float>(memory(0x91A8, 4))) * shunt_mohm / 7.5684;
}

std::int16_t Bq76952Model::to_user_current(double a) const {
  constexpr std::array<double, 4> unit_a{1e-4, 1e-3, 1e-2, 1e-1};
  return static_cast<std::int16_t>(
      std::clamp(std::round(a * gain_seen() / unit_a[memory(0x9303, 1) & 3]), -32768.0, 32767.0));
}

void Bq76952Model::advance(std::uint64_t us) {
  while (us > 0) {
    const std::uint64_t now = std::min({us, slot_left_us_, cc1_left_us_});
    step(now);
    us -= now;
  }
}

void Bq76952Model::step(std::uint64_t us) {
  const double s = 1e-6 * static_cast<double>(us);
  time_us += us;
  charge_as += current_a * s;
  slot_as_ += current_a * s;
  cc1_as_ += current_a * s;
  if (time_us >= balancing_until_us_) balancing_ = 0;
  for (std::size_t k = 0; k < 16; ++k) bled_s[k] += (balancing_ >> k & 1) != 0 ? s : 0;
  if ((memory(0x9263, 1) & 2) != 0 && time_us - last_transfer_us_ > 1'000'000ULL * memory(0x92B2, 2)) safety_c_ |= 2;
  slot_left_us_ -= us;
  cc1_left_us_ -= us;
  const bool measures = !frozen && !config_ && !deep_sleep && !gone;
  if (slot_left_us_ == 0) {
    if (measures) slot_ends();
    slot_left_us_ = (memory(0x9234, 2) & 0x40) != 0 ? 1'500 : 3'000;
    slot_as_ = 0;
  }
  if (cc1_left_us_ == 0) {
    if (measures) {
      const double capacity_gain =
          static_cast<double>(std::bit_cast<float>(memory(0x91AC, 4))) / 298261.6178 * shunt_mohm / 7.5684;
      counted_ += std::llround(cc1_as_ * capacity_gain / as_per_step * 4294967296.0);
      ++quarter_seconds_;
    }
    cc1_left_us_ = 250'000;
    cc1_as_ = 0;
  }
}

void Bq76952Model::slot_ends() {
  const double mean_a = slot_as_ / ((memory(0x9234, 2) & 0x40) != 0 ? 1.5e-3 : 3e-3);
  cc2_ = to_user_current(mean_a);
  cc3_sum_a_ += mean_a;
  if (++cc3_count_ >= static_cast<int>(memory(0x9307, 1))) {
    cc3_ = to_user_current((1 - cc3_loses) * cc3_sum_a_ / cc3_count_);
    cc3_sum_a_ = 0;
    cc3_count_ = 0;
  }
  if (slot_ < 16)
    put(direct_, static_cast<std::size_t>(0x14 + 2 * slot_),
        (memory(0x9304, 2) >> slot_ & 1) != 0
            ? static_cast<std::uint32_t>(std::lround(1e3 * cell_v[static_cast<std::size_t>(slot_)]))
            : 0,
        2);
  if (++slot_ == 21) scan_ends();
}

void Bq76952Model::scan_ends() {
  slot_ = 0;
  const double unit_v = (memory(0x9303, 1) & 4) != 0 ? 0.01 : 0.001;
  if (loop_ == 0) put(direct_, 0x34, static_cast<std::uint32_t>(std::lround(stack_v / unit_v)), 2);
  if (loop_ == 1) put(direct_, 0x38, static_cast<std::uint32_t>(std::lround(ld_v / unit_v)), 2);
  if (loop_ == 2) {
    for (std::size_t k = 0; k < 4; ++k)
      put(direct_, temperature_register[k],
          memory(temperature_pin[k], 1) == 0x07
              ? static_cast<std::uint32_t>(std::lround(10 * (temperature_c[k] + 273.15)))
              : 0,
          2);
  }
  alarm_ |= 1U << 1 & alarm_enable_;
  if (only_cells) loop_ = 3;  // skips the slots of stack, LD and thermistors
  if (!only_cells && ++loop_ >= 3) {
    loop_ = 0;
    alarm_ |= 1U << 7 & alarm_enable_;
  }
  const double over_v = 0.0506 * memory(0x9278, 1);
  if (*std::max_element(cell_v.begin(), cell_v.end()) <= over_v) over_since_us_ = time_us;
  if ((memory(0x9261, 1) & 8) != 0 && time_us - over_since_us_ > 3'300ULL * (memory(0x9279, 2) + 2)) safety_a_ |= 8;
}

// ---- commands ----

void Bq76952Model::fill(std::span<const std::uint8_t> data, std::size_t length) {
  buffer_ = {};
  std::copy(data.begin(), data.end(), buffer_.begin());
  std::uint8_t sum = static_cast<std::uint8_t>(low_ + high_);
  for (std::size_t k = 0; k < length; ++k) sum = static_cast<std::uint8_t>(sum + buffer_[k]);
  checksum_ = static_cast<std::uint8_t>(~sum);
  length_ = static_cast<std::uint8_t>(length + 4);
}

void Bq76952Model::command(std::uint16_t address) {
  commands.push_back(address);
  std::array<std::uint8_t, 32> data{};
  std::size_t length = 32;
  switch (address) {
    case 0x0001:
      put(data, 0, device_number, 2), length = 2;
      break;
    case 0x000E:
      deep_sleep = false;
      break;
    case 0x0075:
      put(data, 20, static_cast<std::uint16_t>(cc3_), 2);
      break;
    case 0x0076:
      put(data, 0, static_cast<std::uint32_t>(counted_ >> 32), 4);
      put(data, 4, static_cast<std::uint32_t>(counted_), 4);
      put(data, 8, quarter_seconds_ / 4, 4);
      break;
    case 0x0083:
      put(data, 0, balancing_, 2), length = 2;
      break;
    case 0x0090:
      config_ = !sealed;
      break;
    case 0x0092:
      if (config_) {
        config_ = was_reset_ = false;
        alarm_enable_ = static_cast<std::uint16_t>(memory(0x926D, 2));
        slot_ = loop_ = cc3_count_ = 0;
        cc3_sum_a_ = 0;
        if (!needs_swap) checked_ = memory(0x9239, 1) == 0x11;
      }
      break;
    case 0x009A:
      break;
    case 0x29BC:
      checked_ = memory(0x9239, 1) == 0x11;
      break;
    default:
      if (address < 0x9180 || address > 0x9380)
        violations.push_back("an unknown subcommand " + std::to_string(address));
      for (std::size_t k = 0; k < 32; ++k)
        data[k] = static_cast<std::uint8_t>(memory(static_cast<std::uint16_t>(address + k), 1));
  }
  fill(data, length);
  busy_until_us_ = time_us + 600;
}

void Bq76952Model::commit(std::uint8_t length) {
  const auto address = static_cast<std::uint16_t>(high_ << 8 | low_);
  if (length < 5 || length > 36) return violations.push_back("a length that cannot be");
  std::uint8_t sum = static_cast<std::uint8_t>(low_ + high_);
  for (std::size_t k = 0; k + 4 < length; ++k) sum = static_cast<std::uint8_t>(sum + buffer_[k]);
  if (static_cast<std::uint8_t>(~sum) != checksum_) return violations.push_back("a wrong checksum");
  if (address == 0x0083) {
    balancing_ = static_cast<std::uint16_t>(buffer_[0] | buffer_[1] << 8);
    balancing_until_us_ = time_us + 20'000'000;
  } else if (address >= 0x9180) {
    if (!config_) return violations.push_back("data memory is written outside of CONFIG_UPDATE mode");
    if (ignores_writes) return;
    for (std::size_t k = 0; k + 4 < length; ++k) memory_[static_cast<std::uint16_t>(address + k)] = buffer_[k];
  }
}

std::uint8_t Bq76952Model::register_byte(std::uint8_t at) const {
  const std::uint16_t status =
      static_cast<std::uint16_t>((config_ ? 1 : 0) | (was_reset_ ? 8 : 0) | (sealed ? 0x300 : 0x100));
  switch (at) {
    case 0x00:
      return deep_sleep ? 4 : 0;
    case 0x03:
      return safety_a_;
    case 0x07:
      return safety_c_;
    case 0x12:
      return static_cast<std::uint8_t>(status);
    case 0x13:
      return static_cast<std::uint8_t>(status >> 8);
    case 0x3A:
      return static_cast<std::uint8_t>(cc2_);
    case 0x3B:
      return static_cast<std::uint8_t>(cc2_ >> 8);
    case 0x3E:
      return time_us < busy_until_us_ ? 0xFF : low_;
    case 0x3F:
      return time_us < busy_until_us_ ? 0xFF : high_;
    case 0x60:
      return static_cast<std::uint8_t>(checksum_ + (torn_buffer ? 1 : 0));
    case 0x61:
      return length_;
    case 0x62:
      return static_cast<std::uint8_t>(alarm_);
    case 0x63:
      return static_cast<std::uint8_t>(alarm_ >> 8);
    default:
      return at >= 0x40 && at < 0x60 ? buffer_[static_cast<std::size_t>(at - 0x40)] : direct_[at & 0x7F];
  }
}

bool Bq76952Model::write_register(std::uint8_t at, std::uint8_t value) {
  if (at == 0x3E)
    low_ = value;
  else if (at == 0x3F) {
    high_ = value;
    command(static_cast<std::uint16_t>(high_ << 8 | low_));
  } else if (at >= 0x40 && at < 0x60)
    buffer_[static_cast<std::size_t>(at - 0x40)] = value;
  else if (at == 0x60)
    checksum_ = value;
  else if (at == 0x61)
    commit(value);
  else if (at == 0x62)
    alarm_ &= static_cast<std::uint16_t>(~value);
  else if (at == 0x63)
    alarm_ &= static_cast<std::uint16_t>(~(value << 8));
  else
    violations.push_back("a write to " + std::to_string(at));
  return true;
}

// ---- the wire ----

I2cResult Bq76952Model::take(std::span<const std::uint8_t> out) {
  std::vector<std::uint8_t> message{0x10, out[0]};
  std::uint8_t at = out[0];
  for (std::size_t k = 1; k < out.size(); ++k, ++at) {
    const std::uint8_t byte = out[k];
    if (checked_) {
      message.push_back(byte);
      if (++k >= out.size() || crc_of(message) != out[k]) return I2cResult::no_acknowledge;
      message.clear();
    }
    write_register(at, byte);
  }
  return I2cResult::done;
}

void Bq76952Model::give(std::uint8_t command, bool written, std::span<std::uint8_t> in) {
  std::vector<std::uint8_t> message =
      written ? std::vector<std::uint8_t>{0x10, command, 0x11} : std::vector<std::uint8_t>{0x11};
  const bool checks = checked_;
  for (std::size_t k = 0; k < in.size(); ++k, ++command) {
    in[k] = register_byte(command);
    message.push_back(in[k]);
    if (checks && ++k < in.size()) in[k] = crc_of(message);
    message.clear();
  }
}

I2cResult Bq76952Model::transfer(std::uint8_t address, std::span<const std::uint8_t> out, std::span<std::uint8_t> in) {
  ++transfers;
  const std::size_t on_wire = 1 + out.size() + (in.empty() ? 0 : 1 + in.size());
  const bool hit = fault.kind != Fault::none && fault.count > 0 && fault.at-- <= 0;
  if (hit) --fault.count;
  if (stuck_) return I2cResult::bus_stuck;  // until the host sends clocks
  if (hung || (hit && fault.kind == Fault::timed_out)) {
    advance(hal::i2c_time_us(out.size() + in.size()));
    stuck_ = true;
    return I2cResult::timed_out;
  }
  if (hit && fault.kind == Fault::reset) reset();
  if (gone || address != 0x08 || (hit && fault.kind == Fault::no_acknowledge)) {
    advance(25);
    return I2cResult::no_acknowledge;
  }
  last_transfer_us_ = time_us;
  safety_c_ = 0;
  bytes_sent += static_cast<unsigned>(on_wire);
  const auto us = static_cast<unsigned>(on_wire * 45 / 2 + (in.empty() ? 5 : 8));
  clocked_us += us;
  I2cResult result = out.size() > 1 ? take(out) : I2cResult::done;
  if (!in.empty()) give(out[0], true, in);
  if (hit && fault.kind == Fault::flipped_bit) {
    if (in.empty())
      result = I2cResult::no_acknowledge;  // the chip received a wrong CRC
    else
      in[(transfers * 7) % in.size()] ^= static_cast<std::uint8_t>(1U << transfers % 8);
  }
  advance(us);
  return result;
}

bool Bq76952Model::recover() {
  advance(150);
  stuck_ = hung;
  return !hung;
}

}  // namespace bms
