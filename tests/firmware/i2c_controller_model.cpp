#include "tests/firmware/i2c_controller_model.hpp"

namespace bms::firmware {

namespace {

constexpr std::uint32_t on = 1, start = 1U << 8, stop_bit = 1U << 9, ack = 1U << 10, pos = 1U << 11, reset = 1U << 15;

}  // namespace

void I2cControllerModel::update(double now_us) {
  const auto now = static_cast<std::uint64_t>(now_us);
  if (now > chip_.time_us) chip_.advance(now - chip_.time_us);
  while (pending(now_us)) {
    const double then = ready_us_;
    ready_us_ = 0;
    switch (phase_) {
      case Phase::starting:
        phase_ = Phase::started;
        sb_ = true;
        break;
      case Phase::addressing:
        address_done();
        break;
      case Phase::sending:
        if (bytes_until_refused >= 0 && bytes_until_refused-- == 0) {
          refused_ = true;
          out_.pop_back();
          empty_ = dr_waits_ = false;
          break;
        }
        if (!dr_waits_) break;
        dr_waits_ = false;
        out_.push_back(dr_);
        empty_ = true;
        ready_us_ = then + byte_us;
        break;
      case Phase::receiving:
        byte_received(then);
        break;
      default:
        break;
    }
  }
}

void I2cControllerModel::address_done() {
  if (bus_errors > 0) {  // 27.3.4: in master mode the lines are not released, and the transmission goes on
    --bus_errors;
    bus_error_ = true;
  }
  if (arbitrations_lost > 0) {  // 27.3.4: the controller goes back to slave mode
    --arbitrations_lost;
    arbitration_ = true;
    phase_ = Phase::idle;
    out_.clear();
    return;
  }
  reading_ = (address_byte_ & 1) != 0;
  bool acknowledged = !chip_.gone && address_byte_ >> 1 == 0x08;
  if (reading_ && acknowledged) {
    ++transfers;
    acknowledged = chip_.transfer(address_byte_ >> 1, out_, in_) == hal::I2cResult::done;
    out_.clear();
    at_ = 0;
  }
  if (!acknowledged) {
    refused_ = true;
    return;
  }
  phase_ = Phase::addressed;
  address_ = true;
}

void I2cControllerModel::begin_reception(double now_us) { ready_us_ = now_us + byte_us; }

/// The next byte follows at once. The chip's own time is ahead by the whole transfer, which it has answered at its
/// address.
void I2cControllerModel::byte_received(double then_us) {
  const std::uint8_t byte = in_[at_++ % in_.size()];
  last_acked_ = (cr1_ & ack) != 0 || ((cr1_ & pos) != 0 && at_ == 1);
  if (!received_) {
    dr_ = byte;
    received_ = true;
    if (stop_wanted_)
      stop();
    else if (last_acked_)
      begin_reception(then_us);
  } else {
    shift_ = byte;
    shift_full_ = true;
    if (stop_wanted_) stop();
  }
}

void I2cControllerModel::stop() {
  if (phase_ == Phase::receiving && last_acked_) violations.push_back("a byte too many is acknowledged before a stop");
  if (!out_.empty()) {
    ++transfers;
    chip_.transfer(0x08, out_, {});
    out_.clear();
  }
  cr1_ &= ~stop_bit;
  stop_wanted_ = false;
  phase_ = Phase::idle;
  empty_ = false;
  ready_us_ = 0;
}

std::uint32_t I2cControllerModel::read(std::uint32_t offset, double now_us) {
  update(now_us);
  switch (offset) {
    case 0x00:
      return cr1_;
    case 0x04:
      return cr2_;
    case 0x10: {
      if (!received_) violations.push_back("DR is read while empty");
      const std::uint8_t byte = dr_;
      received_ = shift_full_;
      if (shift_full_) {
        dr_ = shift_;
        shift_full_ = false;
        if (phase_ == Phase::receiving && last_acked_ && ready_us_ == 0) begin_reception(now_us);
      }
      return byte;
    }
    case 0x14: {
      status_read_ = true;
      const bool finished = phase_ == Phase::sending ? ready_us_ == 0 && !dr_waits_ && empty_ : shift_full_;
      return (sb_ ? 1U : 0U) | (address_ ? 2U : 0U) | (finished ? 4U : 0U) | (received_ ? 1U << 6 : 0U) |
             (empty_ ? 1U << 7 : 0U) | (bus_error_ ? 1U << 8 : 0U) | (arbitration_ ? 1U << 9 : 0U) |
             (refused_ ? 1U << 10 : 0U);
    }
    case 0x18:
      if (address_ && status_read_) {
        address_ = false;
        phase_ = reading_ ? Phase::receiving : Phase::sending;
        empty_ = !reading_;
        received_ = shift_full_ = dr_waits_ = false;
        if (reading_) begin_reception(now_us);
      }
      return (phase_ != Phase::idle || chip_.hung ? 2U : 0U) | (phase_ != Phase::idle ? 1U : 0U);
    case 0x1C:
      return ccr;
    case 0x20:
      return trise;
    default:
      return 0;
  }
}

void I2cControllerModel::write_cr1(std::uint32_t value, double now_us) {
  if ((value & reset) != 0 || (value & on) == 0) {
    phase_ = Phase::idle;
    sb_ = address_ = received_ = shift_full_ = empty_ = refused_ = stop_wanted_ = dr_waits_ = false;
    bus_error_ = arbitration_ = false;
    out_.clear();
    ready_us_ = 0;
    cr1_ = value & ~(start | stop_bit);
    return;
  }
  if ((value & start) != 0 && (cr1_ & start) == 0) {
    if (phase_ != Phase::idle && !(phase_ == Phase::sending && ready_us_ == 0))
      violations.push_back("a start during a transfer");
    phase_ = Phase::starting;
    empty_ = false;
    ready_us_ = now_us + start_us;
  }
  cr1_ = value & ~start;
  if ((value & stop_bit) != 0) {
    stop_wanted_ = true;
    if (phase_ != Phase::receiving || ready_us_ == 0) stop();
  }
}

void I2cControllerModel::write(std::uint32_t offset, std::uint32_t value, double now_us) {
  update(now_us);
  switch (offset) {
    case 0x00:
      write_cr1(value, now_us);
      return;
    case 0x04:
      cr2_ = value;
      frequency_mhz = value & 63;
      return;
    case 0x10:
      if (sb_) {
        sb_ = false;
        phase_ = Phase::addressing;
        address_byte_ = static_cast<std::uint8_t>(value);
        ready_us_ = now_us + byte_us;
      } else if (phase_ == Phase::sending && empty_) {
        if (ready_us_ == 0) {
          out_.push_back(static_cast<std::uint8_t>(value));
          ready_us_ = now_us + byte_us;
        } else {
          dr_ = static_cast<std::uint8_t>(value);
          dr_waits_ = true;
          empty_ = false;
        }
      } else {
        violations.push_back("DR is written outside a transfer");
      }
      return;
    case 0x14:
      if ((value & 1U << 8) == 0) bus_error_ = false;
      if ((value & 1U << 9) == 0) arbitration_ = false;
      if ((value & 1U << 10) == 0) refused_ = false;
      return;
    case 0x1C:
      ccr = value;
      if ((ccr & 0xFFF) != 0) {  // RM0090, 27.6.8: F/S and DUTY
        const double fast_periods = (ccr >> 14 & 1) == 0 ? 3 : 25, periods = (ccr >> 15 & 1) == 0 ? 2 : fast_periods;
        chip_.bus_hz = 1e6 * frequency_mhz / (periods * (ccr & 0xFFF));
      }
      return;
    case 0x20:
      trise = value;
      return;
    default:
      return;
  }
}

}  // namespace bms::firmware
