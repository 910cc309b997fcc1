#include "tests/firmware/world/gpio_model.hpp"

#include <fmt/format.h>

namespace bms::world {

namespace {

constexpr std::uint32_t ahb1_clocks = 0x40023830, exti_ports = 0x40013808;

}  // namespace

void GpioPort::reset() {
  // the debug pins of ports A and B are alternate functions after a reset
  constexpr std::array<std::uint32_t, 2> modes{0xA8000000, 0x00000280};
  mode_ = port_ < modes.size() ? modes[port_] : 0;
  open_drain_ = speed_ = pull_ = output_ = 0;
  alternate_ = {};
  ++writes;
}

Level GpioPort::driven(unsigned pin) const {
  if ((mode_ >> 2 * pin & 3) != 1) return Level::floating;
  if ((output_ >> pin & 1) == 0) return Level::low;
  return (open_drain_ >> pin & 1) != 0 ? Level::floating : Level::high;
}

void GpioPort::set_outside(unsigned pin, bool high) { outside_ = (outside_ & ~(1U << pin)) | (high ? 1U << pin : 0U); }

std::uint32_t GpioPort::read(std::uint32_t offset, double) {
  if ((board_.register_value(ahb1_clocks) >> port_ & 1) == 0) return 0;
  switch (offset) {
    case 0x00:
      return mode_;
    case 0x04:
      return open_drain_;
    case 0x08:
      return speed_;
    case 0x0C:
      return pull_;
    case 0x10: {
      std::uint32_t levels = 0;
      for (unsigned pin = 0; pin < 16; ++pin) {
        const Level level = driven(pin);
        const bool high = level == Level::floating ? !analog(pin) && outside(pin) : level == Level::high;
        levels |= high ? 1U << pin : 0U;
      }
      return levels;
    }
    case 0x14:
      return output_;
    case 0x20:
    case 0x24:
      return alternate_[(offset - 0x20) / 4];
    default:
      return 0;
  }
}

void GpioPort::write(std::uint32_t offset, std::uint32_t value, double) {
  if ((board_.register_value(ahb1_clocks) >> port_ & 1) == 0) {
    violations.push_back(fmt::format("port {} is written without its clock", "ABCDEFGHI"[port_]));
    return;
  }
  switch (offset) {
    case 0x00:
      mode_ = value;
      break;
    case 0x04:
      open_drain_ = value & 0xFFFF;
      break;
    case 0x08:
      speed_ = value;
      break;
    case 0x0C:
      pull_ = value;
      break;
    case 0x14:
      output_ = value & 0xFFFF;
      break;
    case 0x18:  // a bit that is both set and reset is set
      output_ = (output_ & ~(value >> 16)) | (value & 0xFFFF);
      break;
    case 0x20:
    case 0x24:
      alternate_[(offset - 0x20) / 4] = value;
      break;
    default:
      break;
  }
  ++writes;
}

std::uint32_t ExtiModel::read(std::uint32_t offset, double) {
  switch (offset) {
    case 0x00:
      return mask_;
    case 0x08:
      return rising_;
    case 0x0C:
      return falling_;
    case 0x14:
      return pending_;
    default:
      return 0;
  }
}

void ExtiModel::write(std::uint32_t offset, std::uint32_t value, double) {
  if (offset == 0x00) mask_ = value;
  if (offset == 0x08) rising_ = value;
  if (offset == 0x0C) falling_ = value;
  if (offset == 0x10) pending_ |= value & mask_;
  if (offset == 0x14) pending_ &= ~value;
}

/// RM0090, table 61: lines 0 to 4 have an interrupt each, 5 to 9 and 10 to 15 share one.
int ExtiModel::interrupt(double) {
  const std::uint32_t active = pending_ & mask_;
  if (active == 0) return -1;
  if ((active >> supply_line & 1) != 0) return 1;
  if ((active >> clock_line & 1) != 0) return 3;
  for (unsigned line = 0; line < 5; ++line) {
    if ((active >> line & 1) != 0) return static_cast<int>(6 + line);
  }
  if ((active & 0x3E0) != 0) return 23;
  return (active & 0xFC00) != 0 ? 40 : -1;
}

void ExtiModel::pin_edge(unsigned port, unsigned line, bool rises) {
  const std::uint32_t selected = board_.register_value(exti_ports + line / 4 * 4) >> line % 4 * 4 & 15;
  if (selected == port) line_edge(line, rises);
}

void ExtiModel::line_edge(unsigned line, bool rises) {
  if (((rises ? rising_ : falling_) >> line & 1) != 0) pending_ |= 1U << line;
}

}  // namespace bms::world
