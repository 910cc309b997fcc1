// The side of the BQ76952 model towards the host: registers, subcommands and the wire.
#include <algorithm>
#include <bitset>

#include "tests/hal/bq76952_model.hpp"

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

void put(std::span<std::uint8_t> to, std::size_t at, std::uint32_t value, std::size_t bytes) {
  for (std::size_t k = 0; k < bytes; ++k) to[at + k] = static_cast<std::uint8_t>(value >> 8 * k);
}

std::uint64_t wire_us(std::size_t bytes) { return bytes * 45 / 2; }

/// A direct command with a measured value of 16 bits.
bool is_measured(std::uint8_t at) { return (at >= 0x14 && at < 0x3C) || (at >= 0x68 && at < 0x7C); }

}  // namespace

// ---- subcommands ----

void Bq76952Model::fill(std::span<const std::uint8_t> data, std::size_t length, bool checksum_right) {
  buffer_ = {};
  std::copy(data.begin(), data.end(), buffer_.begin());
  std::uint8_t sum = static_cast<std::uint8_t>(low_ + high_);
  for (std::size_t k = 0; k < length; ++k) sum = static_cast<std::uint8_t>(sum + buffer_[k]);
  checksum_ = static_cast<std::uint8_t>(checksum_right ? ~sum : ~sum + 1);
  length_ = static_cast<std::uint8_t>(length + 4);
}

void Bq76952Model::command(std::uint16_t address) {
  commands.push_back(address);
  std::array<std::uint8_t, 32> data{};
  std::size_t length = 32;
  if (address >= bq::Memory::first && address <= 0x9380) {
    for (std::size_t k = 0; k < 32; ++k)
      data[k] = static_cast<std::uint8_t>(memory_.read(static_cast<std::uint16_t>(address + k), 1));
  } else if (!control_command(address) && !fet_command(address)) {
    length = block(address, data);
    if (length == 0) {
      violations.push_back("an unknown subcommand " + std::to_string(address));
      length = 32;
    }
  }
  const bool dastatus = address >= 0x0071 && address <= 0x0077;
  fill(data, length, variant_.dastatus_checksum_right || !dastatus);
  previous_command_ = address;
  busy_until_us_ = time_us + 600;  // DASTATUS5 660 us, others 400 to 600 us (a published table of command times)
}

/// Subcommands without data that concern modes (SLUUBY2B, 12.4). Returns false for another one.
bool Bq76952Model::control_command(std::uint16_t address) {
  switch (address) {
    case 0x000E:  // EXIT_DEEPSLEEP
      deep_sleep = false;
      return true;
    case 0x000F:  // DEEPSLEEP, twice in a row
      if (previous_command_ == address && !config_) deep_sleep = true;
      return true;
    case 0x0010:  // SHUTDOWN; sealed it has to be sent twice
      if (sealed && previous_command_ != address) return true;
      shutdown_ = !in_.ts2_low && in_.ld_v < ld_high_v;
      ending_ = !shutdown_;
      return true;
    case 0x0012:  // RESET
      if (!sealed && !ignores_reset) reset();
      return true;
    case 0x0082:  // RESET_PASSQ
      measurement_.restart_charge();
      return true;
    case 0x0090:  // SET_CFGUPDATE
      config_ = !sealed;
      return true;
    case 0x0092:  // EXIT_CFGUPDATE
      if (config_) exit_config();
      return true;
    case 0x0099:  // SLEEP_ENABLE
    case 0x009A:  // SLEEP_DISABLE
    case 0x2857:  // PF_FORCE_A
      return true;
    case 0x29A3:  // PF_FORCE_B
      if (previous_command_ == 0x2857) protections_.force_permanent_fail();
      return true;
    case 0x29BC:  // SWAP_COMM_MODE
      checked_ = memory_[bq::comm_type] == 0x11 || memory_[bq::comm_type] == 0x12;
      return true;
    default:
      return false;
  }
}

void Bq76952Model::exit_config() {
  config_ = was_reset_ = false;
  start_firmware();
  // Comm Type 0x11: I2C with CRC, 0x12: the same above 100 kHz (SLUUBY2B, 13.3.2.5)
  if (!needs_swap) checked_ = memory_[bq::comm_type] == 0x11 || memory_[bq::comm_type] == 0x12;
}

/// Subcommands that concern FETs, protections and outputs (SLUUBY2B, 12.4). Returns false for another one.
bool Bq76952Model::fet_command(std::uint16_t address) {
  const bool host_may = (memory_[bq::fet_options] & 0x04) != 0;  // HOST_FET_EN
  const auto turn_off = [&](unsigned bits) {
    if (host_may) host_off_ = static_cast<std::uint8_t>(host_off_ | bits);
  };
  const auto gpo = [&](unsigned output, bool high) {
    outputs_high_ = static_cast<std::uint16_t>((outputs_high_ & ~(1U << output)) | (high ? 1U << output : 0U));
  };
  switch (address) {
    case 0x001F:  // CHGTEST
    case 0x0020:  // DSGTEST
      if (!fet_en_) tests_ ^= address == 0x001F ? 2 : 4;
      return true;
    case 0x0022:  // FET_ENABLE toggles FET_EN
      fet_en_ = !fet_en_;
      tests_ = 0;
      return true;
    case 0x0024:  // PF_ENABLE toggles PF_EN
      pf_en_ = !pf_en_;
      return true;
    case 0x0093:  // DSG_PDSG_OFF
      turn_off(0x03);
      return true;
    case 0x0094:  // CHG_PCHG_OFF
      turn_off(0x0C);
      return true;
    case 0x0095:  // ALL_FETS_OFF
      turn_off(0x0F);
      return true;
    case 0x0096:  // ALL_FETS_ON allows them to be on
      if (host_may) host_off_ = 0;
      return true;
    case 0x009B:
      protections_.recover_ocdl();
      return true;
    case 0x009C:
      protections_.recover_scdl();
      return true;
    default:
      // general-purpose outputs: 0x2800 + n drives low, 0x2810 + n drives high
      if ((address & ~0x1FU) != 0x2800 || (address & 0x0F) > 8) return false;
      gpo(address & 0x0F, (address & 0x10) != 0);
      return true;
  }
}

/// Subcommands that return a block. Returns its length, 0 for an unknown one.
std::size_t Bq76952Model::block(std::uint16_t address, std::span<std::uint8_t> data) {
  switch (address) {
    case 0x0001:  // DEVICE_NUMBER
      put(data, 0, device_number, 2);
      return 2;
    case 0x0053:  // SAVED_PF_STATUS
      for (std::size_t k = 0; k < 3; ++k) data[k] = protections_.pf_status(k);
      return 4;
    case 0x0057:  // MANUFACTURINGSTATUS
      put(data, 0, manufacturing_status(), 2);
      return 2;
    case 0x0071:
    case 0x0072:
    case 0x0073:
    case 0x0074:
      measurement_.fill_raw_cells(data, 4 * static_cast<std::size_t>(address - 0x0071));
      return 32;
    case 0x0075:
      measurement_.fill_dastatus5(data);
      return 32;
    case 0x0076:
      measurement_.fill_dastatus6(data);
      return 32;
    case 0x0083:  // CB_ACTIVE_CELLS
      put(data, 0, balancing_, 2);
      return 2;
    case 0x0097:  // FET_CONTROL
      data[0] = host_off_;
      return 1;
    case 0x0098:  // REG12_CONTROL
      data[0] = static_cast<std::uint8_t>(memory_[bq::reg12_config]);
      return 1;
    default:
      return 0;
  }
}

void Bq76952Model::commit(std::uint8_t length) {
  const auto address = static_cast<std::uint16_t>(high_ << 8 | low_);
  if (length < 5 || length > 36) return violations.push_back("a length that cannot be");
  std::uint8_t sum = static_cast<std::uint8_t>(low_ + high_);
  for (std::size_t k = 0; k + 4 < length; ++k) sum = static_cast<std::uint8_t>(sum + buffer_[k]);
  if (static_cast<std::uint8_t>(~sum) != checksum_) return violations.push_back("a wrong checksum");
  write_block(address, std::span(buffer_).first(length - 4U));
}

void Bq76952Model::write_block(std::uint16_t address, std::span<const std::uint8_t> data) {
  if (address == 0x0083) {
    if ((memory_[bq::balancing_configuration] & 0x10) != 0) return;  // CB_NO_CMD
    balancing_ = static_cast<std::uint16_t>(data[0] | (data.size() > 1 ? data[1] << 8 : 0));
    balancing_until_us_ = time_us + static_cast<std::uint64_t>(1e6 * variant_.balancing_lasts_s);
  } else if (address == 0x0097) {
    if ((memory_[bq::fet_options] & 0x04) != 0) host_off_ = data[0] & 0x0F;
  } else if (address == 0x0098) {
    memory_.set(bq::reg12_config, data[0]);  // the regulators' present state, here the same as their setting
  } else if (address >= bq::Memory::first) {
    if (!config_) return violations.push_back("data memory is written outside of CONFIG_UPDATE mode");
    if (ignores_writes) return;
    for (std::size_t k = 0; k < data.size(); ++k) memory_.write(static_cast<std::uint16_t>(address + k), 1, data[k]);
  }
}

// ---- registers ----

std::uint16_t Bq76952Model::manufacturing_status() const {
  return static_cast<std::uint16_t>(tests_ | (fet_en_ ? 0x10 : 0) | (pf_en_ ? 0x40 : 0));
}

/// Control, safety, permanent failure and battery status: addresses 0x00 to 0x13 (SLUUBY2B, 12.1).
std::uint8_t Bq76952Model::status_byte(std::uint8_t at) const {
  using enum bq::Protections::Register;
  const bool any_fault = (protections_.status(a) | protections_.status(b) | protections_.status(c)) != 0;
  const unsigned battery = (config_ ? 1U : 0U) | (was_reset_ ? 8U : 0U) | (sealed ? 0x300U : 0x100U) |
                           (any_fault ? 0x800U : 0U) | (protections_.permanent_fail() ? 0x1000U : 0U);
  const std::array<std::uint8_t, 20> bytes{static_cast<std::uint8_t>(deep_sleep ? 4 : 0),
                                           0,
                                           protections_.alert(a),
                                           protections_.status(a),
                                           protections_.alert(b),
                                           protections_.status(b),
                                           protections_.alert(c),
                                           protections_.status(c),
                                           0,
                                           0,
                                           protections_.pf_alert_a(),
                                           protections_.pf_status(0),
                                           0,
                                           protections_.pf_status(1),
                                           0,
                                           protections_.pf_status(2),
                                           0,
                                           0,
                                           static_cast<std::uint8_t>(battery),
                                           static_cast<std::uint8_t>(battery >> 8)};
  return bytes[at];
}

std::uint8_t Bq76952Model::register_byte(std::uint8_t at) const {
  if (at < 0x14) return status_byte(at);
  if (at >= 0x40 && at < 0x60) return buffer_[static_cast<std::size_t>(at - 0x40)];
  const std::uint16_t raw = alarm_raw();
  switch (at) {
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
    case 0x64:
      return static_cast<std::uint8_t>(raw);
    case 0x65:
      return static_cast<std::uint8_t>(raw >> 8);
    case 0x66:
      return static_cast<std::uint8_t>(alarm_enable_);
    case 0x67:
      return static_cast<std::uint8_t>(alarm_enable_ >> 8);
    case 0x7F:
      return fet_status();
    default:
      return measurement_.direct(at);
  }
}

void Bq76952Model::write_register(std::uint8_t at, std::uint8_t value) {
  if (at >= 0x40 && at < 0x60) {
    buffer_[static_cast<std::size_t>(at - 0x40)] = value;
    return;
  }
  switch (at) {
    case 0x3E:
      low_ = value;
      break;
    case 0x3F:
      high_ = value;
      command(static_cast<std::uint16_t>(high_ << 8 | low_));
      break;
    case 0x60:
      checksum_ = value;
      break;
    case 0x61:
      commit(value);
      break;
    case 0x62:
      alarm_ &= static_cast<std::uint16_t>(~value);
      break;
    case 0x63:
      alarm_ &= static_cast<std::uint16_t>(~(value << 8));
      break;
    case 0x66:
      alarm_enable_ = static_cast<std::uint16_t>((alarm_enable_ & 0xFF00) | value);
      break;
    case 0x67:
      alarm_enable_ = static_cast<std::uint16_t>((alarm_enable_ & 0x00FF) | value << 8);
      break;
    default:
      violations.push_back("a write to " + std::to_string(at));
  }
}

// ---- the wire ----

/// "0x11 = I2C with CRC (for use up to 100kHz bus speed)" (SLUUCG7, data memory). What the chip does above it is not
/// known; here it does not answer.
bool Bq76952Model::too_fast() const { return checked_ && memory_[bq::comm_type] == 0x11 && bus_hz > 100e3; }

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

/// Conversions go on during a transfer. The low byte of a measured value latches the high byte, unless the variant
/// tears.
void Bq76952Model::give(std::uint8_t command, std::span<std::uint8_t> in, std::uint64_t start_us,
                        std::size_t bytes_before) {
  std::vector<std::uint8_t> message{0x10, command, 0x11};
  const bool checks = checked_;
  std::uint8_t high = 0;
  bool latched = false;
  const std::uint8_t first = command;
  for (std::size_t k = 0; k < in.size(); ++k, ++command) {
    const bool measured = is_measured(command);
    if (measured && (command % 2 == 0 || variant_.tears_within_transfer)) {
      const std::uint64_t due_us = start_us + wire_us(bytes_before + k);
      if (due_us > time_us) run_for(due_us - time_us);
    }
    std::uint8_t byte = register_byte(command);
    if (measured && command % 2 == 1 && latched && !variant_.tears_within_transfer) byte = high;
    latched = measured && command % 2 == 0;
    if (latched) high = register_byte(static_cast<std::uint8_t>(command + 1));
    const bool buffer = command >= 0x3E && command < 0x62;
    if (!variant_.transfer_spans_commands && !buffer && command - first >= 2) byte = 0xFF;
    in[k] = byte;
    message.push_back(byte);
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
  if (gone || shutdown_ || address != 0x08 || too_fast() || (hit && fault.kind == Fault::no_acknowledge)) {
    advance(25);
    return I2cResult::no_acknowledge;
  }
  bytes_sent += static_cast<unsigned>(on_wire);
  const auto us = static_cast<unsigned>(wire_us(on_wire)) + (in.empty() ? 5U : 8U);
  clocked_us += us;
  const std::uint64_t start_us = time_us;
  I2cResult result = out.size() > 1 ? take(out) : I2cResult::done;
  if (!in.empty()) give(out[0], in, start_us, 2 + out.size());
  if (result == I2cResult::done) protections_.communicated();
  if (hit && fault.kind == Fault::flipped_bit) {
    if (in.empty())
      result = I2cResult::no_acknowledge;  // the chip received a wrong CRC
    else
      in[(transfers * 7) % in.size()] ^= static_cast<std::uint8_t>(1U << transfers % 8);
  }
  if (start_us + us > time_us) advance(start_us + us - time_us);
  return result;
}

bool Bq76952Model::recover() {
  advance(150);
  stuck_ = hung;
  return !hung;
}

}  // namespace bms
