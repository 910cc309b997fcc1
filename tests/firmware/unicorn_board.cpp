#include "tests/firmware/unicorn_board.hpp"

#include <unicorn/unicorn.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace bms::firmware {

namespace {

constexpr std::uint32_t ccm = 0x10000000, ccm_size = 0x10000, scs = 0xE000E000, untouched = 0xA5A5A5A5;
constexpr std::uint32_t nmi = 2, systick_exception = 15, pvd = 16 + 1, can_tx = 16 + 19, can_rx0 = 16 + 20,
                        timer_5 = 16 + TimerModel::interrupt_number;
constexpr std::uint32_t apb1enr = 0x40023840, pwr_cr = 0x40007000;
constexpr double longest_run_us = 20;  ///< peripherals are asked for interrupts so often
constexpr std::uint32_t one_time_memory = 0x1FFF7800, slots_begin = 0x08020000, slots_end = 0x080E0000;

constexpr std::uint32_t longest_slice = 200;  ///< instructions between an event and its interrupt

template <class Words>
std::vector<std::uint8_t> bytes_of(const Words& words) {
  std::vector<std::uint8_t> bytes(words.size() * sizeof words[0]);
  std::memcpy(bytes.data(), words.data(), bytes.size());
  return bytes;
}

}  // namespace

UnicornBoard::UnicornBoard(const std::filesystem::path& image, std::uint32_t seed, bool crystal)
    : symbols_(symbols_of(image)), random_(seed) {
  rcc.crystal = crystal;
  map_memories(false);
  load(image);
  core_.find_instructions(symbols_);
  core_.on_entry = [this] {
    ++estimates;
    core_.set_limit(core_.executed());
  };
  core_.watch_entry(address_of("bms::firmware::estimator_step("));
  start();
}

void UnicornBoard::map_memories(bool with_slots) {
  constexpr std::uint32_t stored = FlashControllerModel::memory,
                          stored_bytes = FlashControllerModel::sectors * FlashControllerModel::sector_bytes,
                          code = stored + stored_bytes;
  using enum UnicornCore::Access;
  core_.map(0x08000000, stored - 0x08000000, read_and_execute);
  if (with_slots) {
    core_.map(code, slots_begin - code, read_and_execute);
    core_.map(slots_begin, slots_end - slots_begin, program_and_execute);
    core_.write(slots_begin, std::vector<std::uint8_t>(slots_end - slots_begin, 0xFF));
    core_.map(slots_end, 0x08100000 - slots_end, read_and_execute);
  } else {
    core_.map(code, 0x08100000 - code, read_and_execute);
  }
  core_.map(0x20000000, 0x20000, read_and_write);
  core_.map(ccm, ccm_size, read_and_write);
  core_.map(0x1FFF7000, 0x1000, with_slots ? program_and_execute : read);
  core_.map_registers(stored, stored_bytes);
  core_.map_registers(0x40000000, 0x30000);
  core_.map_registers(0x50060000, 0x1000);  // random number generator
  core_.map_registers(scs, 0x1000);
  core_.on_read = [this](std::uint32_t address, unsigned size) { return core_read(address, size); };
  core_.on_write = [this](std::uint32_t address, std::uint32_t value, unsigned size) {
    core_write(address, value, size);
  };
  core_.on_program = [this](std::uint32_t address, std::uint32_t value, unsigned size) {
    flash.program_elsewhere(address, size, value, core_.word(address));
    if (core_.in_blocks()) core_.set_limit(core_.executed());
    if (flash.power_failed) core_.stop();
  };
  flash.erase_slot_sector = [this](std::uint32_t begin, std::uint32_t size) {
    core_.write(begin, std::vector<std::uint8_t>(size, 0xFF));
  };
  core_.write(one_time_memory, std::vector<std::uint8_t>(0x210, 0xFF));  // and its lock bytes
  constexpr std::uint16_t reference = 1'502;  // VREFINT_CAL: 1.21 V of 3.3 V (datasheet, internal reference voltage)
  core_.write(0x1FFF7A2A, std::array<std::uint8_t, 2>{reference & 0xFF, reference >> 8});
  core_.write(ccm, std::vector<std::uint8_t>(ccm_size, untouched & 0xFF));
}

void UnicornBoard::start() {
  watchdog.reset(now_us(), (flash.option_bytes & 1U << 5) == 0);
  set_reg(UC_ARM_REG_SP, core_.word(0x08000000));
  set_reg(UC_ARM_REG_LR, 0xFFFFFFFF);
  set_reg(UC_ARM_REG_PC, core_.word(0x08000004) | 1);
}

/// RM0090, 7.1.1: resets everything except the backup domain and the reset flags.
void UnicornBoard::start_again(std::uint32_t flags) {
  resets.push_back(flags);
  rcc.reset();
  rcc.reset_flags = flags;
  registers_.clear();
  ended_.clear();
  sleeping_ = stopped_ = systick_pending_ = supply_pending_ = false;
  active_.clear();
  priorities_.fill(0);
  systick_csr_ = systick_rvr_ = 0;
  enabled_ = {};
  can.write(0, 1U << 15);
  flash.reset();
  timer.reset();
  for (const auto& [base, peripheral] : plugged) peripheral->chip_reset();
  core_.forget_code(slots_begin, slots_end);
  set_reg(UC_ARM_REG_CONTROL, 0);
  set_reg(UC_ARM_REG_PRIMASK, 0);
  set_reg(UC_ARM_REG_XPSR, 1U << 24);
  start();
}

void UnicornBoard::patch(const std::string& function, Instructions with) {
  const std::uint32_t at = address_of(function), before = core_.word(at);
  patched_.push_back({at, {static_cast<std::uint16_t>(before & 0xFFFF), static_cast<std::uint16_t>(before >> 16)}});
  core_.write(at, bytes_of(with));
}

void UnicornBoard::unpatch() {
  for (const auto& [at, before] : patched_) core_.write(at, bytes_of(before));
  patched_.clear();
}

std::uint32_t UnicornBoard::address_of(const std::string& function) const {
  return static_cast<std::uint32_t>(symbol_named(symbols_, function).address) & ~1U;
}

void UnicornBoard::stick(std::uint32_t address, unsigned bit, bool at) {
  stuck_ = {address, bit, at};
  core_.before_word = [this] {
    std::array<std::uint8_t, 1> byte{};
    core_.read(stuck_.address, byte);
    const unsigned mask = 1U << stuck_.bit;
    byte[0] = static_cast<std::uint8_t>(stuck_.at ? byte[0] | mask : byte[0] & ~mask);
    core_.write(stuck_.address, byte);
  };
  core_.watch_word(address);
}

void UnicornBoard::flip_bit(std::uint32_t address, unsigned bit) {
  std::array<std::uint8_t, 1> byte{};
  if (!core_.read(address, byte)) throw std::runtime_error(fmt::format("no memory at {:08x}", address));
  byte[0] = static_cast<std::uint8_t>(byte[0] ^ 1U << bit);
  core_.write(address, byte);
}

void UnicornBoard::write_one_time_memory(std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> content(bytes.size());
  core_.read(one_time_memory, content);
  for (std::size_t k = 0; k < bytes.size(); ++k) content[k] &= bytes[k];
  core_.write(one_time_memory, content);
}

void UnicornBoard::load(const std::filesystem::path& image) {
  for (const ProgramPart& part : program_of(image)) {
    if (!core_.write(part.address, bytes_of(part.bytes)))
      throw std::runtime_error(fmt::format("{}: no memory at {:08x}", image.string(), part.address));
  }
}

std::uint32_t UnicornBoard::register_value(std::uint32_t address) const {
  const auto found = registers_.find(address);
  return found == registers_.end() ? 0 : found->second;
}

std::uint32_t UnicornBoard::core_read(std::uint32_t a, unsigned size) {
  if (a < ccm) return flash.read_memory(a - FlashControllerModel::memory, size);
  if (core_.in_blocks() && core_.executed() > passed_ + longest_slice) pass_instructions(core_.executed() - passed_);
  const std::uint32_t value = peripheral_read(a);
  if (stall_us > 0) core_.set_limit(core_.executed());
  return value;
}

/// What is written can request an interrupt. It comes after a random number of instructions.
void UnicornBoard::core_write(std::uint32_t a, std::uint32_t value, unsigned size) {
  if (core_.in_blocks() && !std::exchange(soon_ends_, true))
    core_.set_limit(core_.executed() + random_() % longest_slice);
  if (a < ccm) return flash.write_memory(a - FlashControllerModel::memory, size, value);
  if (core_.in_blocks() && core_.executed() > passed_ + longest_slice) pass_instructions(core_.executed() - passed_);
  peripheral_write(a, value, size);
}

std::uint32_t UnicornBoard::peripheral_read(std::uint32_t a) {
  const auto of = [&](std::uint32_t base) { return a >= base && a < base + 0x400; };
  if (of(BxcanModel::base)) return (register_value(apb1enr) & 1U << 25) != 0 ? can.read(a - BxcanModel::base) : 0;
  if (of(FlashControllerModel::registers)) return flash.read(a - FlashControllerModel::registers);
  if (of(RccModel::base) && RccModel::has(a - RccModel::base)) return rcc.read(a - RccModel::base, now_us());
  if (of(WatchdogModel::base)) return watchdog.read(a - WatchdogModel::base, now_us());
  if (of(TimerModel::base)) return timer.read(a - TimerModel::base);
  if (rtc != nullptr && of(RtcModel::base)) return rtc->read(a - RtcModel::base, now_us());
  if (const auto found = plugged.find(a & ~0x3FFU); found != plugged.end())
    return found->second->read(a & 0x3FF, now_us());
  switch (a) {
    case 0x40007004:
      return supply_low_ && (register_value(pwr_cr) & 1U << 4) != 0 ? 4U : 0U;  // PWR_CSR: PVDO, while it is on
    case 0x40023870:
      return rtc != nullptr ? rtc->read_bdcr(now_us()) : 0;
    case 0x50060804:
      return 1;  // RNG_SR: a number is ready
    case 0x50060808:
      return static_cast<std::uint32_t>(random_());
    case scs + 0xD04:
      return handling() ? active_.back() : 0;
    case scs + 0x010:
      return systick_csr_;
    case scs + 0x014:
      return systick_rvr_;
    case scs + 0x018:
      return next_systick_ > ticks_ && !core_stopped()
                 ? std::min(systick_rvr_,  // it is loaded with the first cycle
                            static_cast<std::uint32_t>(static_cast<double>(next_systick_ - ticks_) / ticks_a_cycle()))
                 : 0;
    case scs + 0x100:
    case scs + 0x104:
    case scs + 0x108:
    case scs + 0x180:
    case scs + 0x184:
    case scs + 0x188:
      return enabled_[(a & 0x7F) / 4];
    default:
      return register_value(a);
  }
}

void UnicornBoard::peripheral_write(std::uint32_t a, std::uint32_t value, unsigned size) {
  const auto of = [&](std::uint32_t base) { return a >= base && a < base + 0x400; };
  if (of(BxcanModel::base)) {
    if ((register_value(apb1enr) & 1U << 25) == 0)
      return can.violations.push_back("bxCAN is written without its clock");
    return can.write(a - BxcanModel::base, value);
  }
  if (of(FlashControllerModel::registers)) {
    flash.write(a - FlashControllerModel::registers, value);
    return rcc.check(flash.read(0), register_value(pwr_cr));
  }
  if (of(RccModel::base) && RccModel::has(a - RccModel::base)) {
    rcc.write(a - RccModel::base, value, now_us());
    return rcc.check(flash.read(0), register_value(pwr_cr));
  }
  if (of(WatchdogModel::base)) return watchdog.write(a - WatchdogModel::base, value, now_us());
  if (of(TimerModel::base)) {
    if ((register_value(apb1enr) & 1U << 3) == 0) timer.violations.push_back("TIM5 is written without its clock");
    return timer.write(a - TimerModel::base, value);
  }
  if (rtc != nullptr && of(RtcModel::base)) return rtc->write(a - RtcModel::base, value, now_us());
  if (const auto found = plugged.find(a & ~0x3FFU); found != plugged.end())
    return found->second->write(a & 0x3FF, value, now_us());
  if (a >= scs && write_core_register(a - scs, value, size)) return;
  switch (a) {
    case 0x40013C14:
      if ((value & 1U << 16) != 0) supply_pending_ = false;
      return;
    case 0x40023870:
      if (rtc != nullptr) rtc->write_bdcr(value, (register_value(pwr_cr) & 1U << 8) != 0, now_us());
      return;
    default:
      registers_[a] = value;
  }
}

/// ARMv7-M, B3.2 to B3.4. Returns false for a register without an effect here.
bool UnicornBoard::write_core_register(std::uint32_t at, std::uint32_t value, unsigned size) {
  const bool of_interrupt = at >= 0x400 && at < 0x400 + 96, of_system = at >= 0xD18 && at < 0xD24;
  if (of_interrupt || of_system) {
    const std::uint32_t first = of_interrupt ? 16 + at - 0x400 : 4 + at - 0xD18;
    for (unsigned k = 0; k < size; ++k)
      priorities_[first + k] = static_cast<std::uint8_t>(value >> (8 * k) & 0xF0);  // four bits (PM0214, 4.3.7)
    return true;
  }
  switch (at) {
    case 0xD28:
      registers_[scs + at] &= ~value;
      return true;
    case 0x010:
      if ((value & 1) != 0 && (systick_csr_ & 1) == 0)
        next_systick_ = ticks_ + static_cast<std::uint64_t>((systick_rvr_ + 1.0) * ticks_a_cycle());
      systick_csr_ = value;
      return true;
    case 0x014:
      systick_rvr_ = value;
      return true;
    case 0x100:
    case 0x104:
    case 0x108:
      enabled_[(at - 0x100) / 4] |= value;
      return true;
    case 0x180:
    case 0x184:
    case 0x188:
      enabled_[(at - 0x180) / 4] &= ~value;
      return true;
    case 0xD0C:
      if ((value & 4) != 0) ended_ = "the firmware has reset the core";
      if (!ended_.empty()) core_.stop();
      return true;
    default:
      return false;
  }
}

void UnicornBoard::pass(std::uint64_t ticks) {
  const std::uint64_t until = ticks_ + ticks, bit_ticks = ticks_per_second / can.bits_per_second;
  const double us = 1e6 * static_cast<double>(ticks) / static_cast<double>(ticks_per_second);
  const double lse_hz = rtc != nullptr ? rtc->lse_hz() : 0;
  if (!stopped_) timer.pass(us, rcc.apb1_timer_hz(), rcc.lsi_hz_now(now_us()), lse_hz);
  const auto apb1_hz = static_cast<std::uint32_t>(rcc.apb1_hz());
  if (next_bit_ == 0) next_bit_ = bit_ticks;
  while (next_bit_ <= until) {
    const std::uint64_t quiet = std::min(can.quiet_bits(), (until - next_bit_) / bit_ticks);
    can.pass_quiet(quiet);
    can.bit(apb1_hz);
    next_bit_ += (quiet + 1) * bit_ticks;
  }
  if (core_stopped() || stopped_) next_systick_ += ticks;
  if (stopped_) stopped_ticks_ += ticks;
  ticks_ = until;
  rcc.advance(now_us());
  watch_lines();
  if (const double hz = rcc.core_hz(); hz != core_hz_) {
    if (next_systick_ > ticks_ && hz > 0 && !core_stopped())
      next_systick_ = ticks_ + static_cast<std::uint64_t>(static_cast<double>(next_systick_ - ticks_) * core_hz_ / hz);
    core_hz_ = hz;
  }
  if ((systick_csr_ & 1) == 0 || core_stopped() || stopped_) return;
  while (next_systick_ <= ticks_) {
    systick_pending_ = true;
    next_systick_ += static_cast<std::uint64_t>((systick_rvr_ + 1.0) * ticks_a_cycle());
  }
}

/// B1.5.4: a lower number is more urgent. Faults and NMI have fixed ones.
int UnicornBoard::priority(std::uint32_t exception) const {
  if (exception == nmi) return -2;
  if (exception == 3) return -1;
  return priorities_.at(exception);
}

/// The most urgent enabled exception that is pending, or 0. Of equal ones that with the lowest number.
std::uint32_t UnicornBoard::pending_exception() const {
  if (rcc.failure_interrupt()) return nmi;
  std::uint32_t most_urgent = 0;
  const auto requests = [&](std::uint32_t exception) {
    if (most_urgent == 0 || priority(exception) < priority(most_urgent)) most_urgent = exception;
  };
  const auto enabled = [&](std::uint32_t exception) {
    return (enabled_[(exception - 16) / 32] >> (exception - 16) % 32 & 1) != 0;
  };
  if (systick_pending_ && (systick_csr_ & 2) != 0) requests(systick_exception);
  if (enabled(pvd) && supply_pending_) requests(pvd);
  if (enabled(can_tx) && can.transmit_interrupt()) requests(can_tx);
  if (!receive_interrupt_held && enabled(can_rx0) && can.receive_interrupt()) requests(can_rx0);
  for (const auto& [base, peripheral] : plugged) {
    const int number = peripheral->interrupt(now_us());
    if (number >= 0 && enabled(16 + static_cast<std::uint32_t>(number)))
      requests(16 + static_cast<std::uint32_t>(number));
  }
  if (enabled(timer_5) && timer.interrupt()) requests(timer_5);
  return most_urgent;
}

void UnicornBoard::deliver_interrupt() {
  const std::uint32_t exception = pending_exception();
  if (exception == 0 || core_stopped()) return;
  sleeping_ = false;
  if (std::exchange(stopped_, false) && rtc != nullptr) rtc->stop_ended();
  if (handling() && priority(exception) >= priority(active_.back())) return;
  if (exception != nmi && reg(UC_ARM_REG_PRIMASK) != 0) return;
  if (exception == systick_exception) systick_pending_ = false;
  enter(exception);
}

void UnicornBoard::refuse_violations() const {
  for (const auto* list : {&rcc.violations, &watchdog.violations, &timer.violations}) {
    if (!list->empty()) throw std::runtime_error(list->front());
  }
}

/// ARMv7-M, B1.5.6: stacks the frame, with the FPU part if the program has used the FPU.
void UnicornBoard::enter(std::uint32_t exception) {
  const std::uint32_t control = reg(UC_ARM_REG_CONTROL), psr = reg(UC_ARM_REG_XPSR);
  const bool fpu = (control & 4) != 0;
  std::vector<std::uint32_t> frame(fpu ? 26 : 8, 0);
  const std::array<int, 6> core{UC_ARM_REG_R0, UC_ARM_REG_R1,  UC_ARM_REG_R2,
                                UC_ARM_REG_R3, UC_ARM_REG_R12, UC_ARM_REG_LR};
  for (std::size_t k = 0; k < core.size(); ++k) frame[k] = reg(core[k]);
  frame[6] = reg(UC_ARM_REG_PC);
  std::uint32_t sp = reg(UC_ARM_REG_SP);
  const bool odd = (sp & 4) != 0;
  frame[7] = (psr & ~(1U << 9)) | (odd ? 1U << 9 : 0U);
  if (fpu) {
    for (int k = 0; k < 16; ++k) frame[8 + static_cast<std::size_t>(k)] = reg(UC_ARM_REG_S0 + k);
    frame[24] = reg(UC_ARM_REG_FPSCR);
  }
  sp = (sp & ~4U) - static_cast<std::uint32_t>(4 * frame.size());
  if (!core_.write(sp, bytes_of(frame))) {  // B1.5.6: this is a bus fault
    if (!may_start_again) throw std::runtime_error("no stack for an interrupt");
    registers_[scs + 0xD28] |= 1U << 12;
    exception = 5;
  }
  set_reg(UC_ARM_REG_SP, sp);
  const std::uint32_t return_to = handling() ? 0xFFFFFFF1 : 0xFFFFFFF9;  // table B1-8
  set_reg(UC_ARM_REG_LR, fpu ? return_to & ~16U : return_to);
  set_reg(UC_ARM_REG_CONTROL, control & ~4U);
  set_reg(UC_ARM_REG_XPSR, 1U << 24);                         // outside an IT block
  const std::uint32_t vectors = register_value(scs + 0xD08);  // VTOR; the boot pins map flash to 0
  set_reg(UC_ARM_REG_PC, core_.word((vectors == 0 ? 0x08000000 : vectors) + 4 * exception) | 1);
  active_.push_back(exception);
  ++interrupts_taken;
}

void UnicornBoard::leave(std::uint32_t exc_return) {
  if (!handling()) throw std::runtime_error("return from an exception that was not");
  active_.pop_back();
  if (((exc_return & 8) == 0) != handling()) throw std::runtime_error("return to the wrong mode");
  const bool fpu = (exc_return & 16) == 0;
  std::vector<std::uint32_t> frame(fpu ? 26 : 8);
  const std::uint32_t sp = reg(UC_ARM_REG_SP);
  for (std::size_t k = 0; k < frame.size(); ++k) frame[k] = core_.word(sp + static_cast<std::uint32_t>(4 * k));
  const std::array<int, 6> core{UC_ARM_REG_R0, UC_ARM_REG_R1,  UC_ARM_REG_R2,
                                UC_ARM_REG_R3, UC_ARM_REG_R12, UC_ARM_REG_LR};
  for (std::size_t k = 0; k < core.size(); ++k) set_reg(core[k], frame[k]);
  if (fpu) {
    for (int k = 0; k < 16; ++k) set_reg(UC_ARM_REG_S0 + k, frame[8 + static_cast<std::size_t>(k)]);
    set_reg(UC_ARM_REG_FPSCR, frame[24]);
  }
  set_reg(UC_ARM_REG_SP, sp + static_cast<std::uint32_t>(4 * frame.size()) + ((frame[7] & 1U << 9) != 0 ? 4U : 0U));
  set_reg(UC_ARM_REG_PC, frame[6] | 1);
  set_reg(UC_ARM_REG_XPSR, frame[7] & ~(1U << 9));
  const std::uint32_t control = reg(UC_ARM_REG_CONTROL);
  set_reg(UC_ARM_REG_CONTROL, fpu ? control | 4U : control & ~4U);
}

/// Where Unicorn stops, a chip takes the exception of the fault, with its cause in CFSR (ARMv7-M, B3.2.15).
bool UnicornBoard::take_fault(int error) {
  if (!may_start_again) return false;
  const bool no_code = error == UC_ERR_FETCH_UNMAPPED || error == UC_ERR_FETCH_PROT;
  const bool access = error == UC_ERR_READ_UNMAPPED || error == UC_ERR_WRITE_UNMAPPED || error == UC_ERR_WRITE_PROT ||
                      error == UC_ERR_READ_PROT;
  constexpr std::uint32_t ibuserr = 1U << 8, preciserr = 1U << 9, undefinstr = 1U << 16;
  if (no_code)
    registers_[scs + 0xD28] |= ibuserr;
  else
    registers_[scs + 0xD28] |= access ? preciserr : undefinstr;
  enter(no_code || access ? 5 : 6);
  return true;
}

void UnicornBoard::ended(const UnicornCore::Run& run) {
  instructions += run.instructions;
  if ((run.pc & 0xFFFFFFE0) == 0xFFFFFFE0) return leave(run.pc | 1);
  if (run.error != UC_ERR_OK && take_fault(run.error)) return;
  if (run.error != UC_ERR_OK) {
    throw std::runtime_error(
        fmt::format("the firmware stops at {:08x}: {}", run.pc, uc_strerror(static_cast<uc_err>(run.error))));
  }
  sleeping_ = !run.at_limit && core_.half_word(run.pc - 2) == 0xBF30;  // wfi
  if (sleeping_) begin_stop();
}

/// To the next bit or tick, whichever comes first; in fast runs over bits that change nothing.
std::uint64_t UnicornBoard::sleep_ticks() const {
  const std::uint64_t of_systick = next_systick_ > ticks_ ? next_systick_ - ticks_ : 1,
                      to_tick = (systick_csr_ & 1) != 0 ? of_systick : ticks_per_second;
  const std::uint64_t to_bit = next_bit_ > ticks_ ? next_bit_ - ticks_ : 1;
  if (stopped_) {
    const double wakes_us = rtc != nullptr ? rtc->wakes_after_us() : longest_stop_us;
    const auto to_wake = static_cast<std::uint64_t>(std::min(longest_stop_us, wakes_us) * (ticks_per_second / 1e6)) + 1;
    const std::uint64_t to_edge = to_bit + can.quiet_bits() * (ticks_per_second / can.bits_per_second);
    return std::min({to_wake, to_edge, run_until_ticks_ > ticks_ ? run_until_ticks_ - ticks_ : 1});
  }
  if (longest_sleep_us <= 0) return std::min(to_tick, to_bit);
  constexpr double ticks_a_us = ticks_per_second / 1e6;
  const double lse_hz = rtc != nullptr ? rtc->lse_hz() : 0;
  const double us = std::min(longest_sleep_us, timer.capture_after_us(rcc.lsi_hz_now(now_us()), lse_hz));
  const std::uint64_t to_event = static_cast<std::uint64_t>(us * ticks_a_us) + 1;
  const std::uint64_t to_change = to_bit + can.quiet_bits() * (ticks_per_second / can.bits_per_second);
  const std::uint64_t to_end = run_until_ticks_ > ticks_ ? run_until_ticks_ - ticks_ : 1;
  return std::min({to_tick, to_event, to_change, to_end});
}

void UnicornBoard::pass_instructions(std::uint64_t count) {
  passed_ += count;
  pass(static_cast<std::uint64_t>(static_cast<double>(count) * ticks_a_cycle()));
}

/// Instructions that end before the next event. An interrupt is then never late in the eyes of its program.
std::uint64_t UnicornBoard::instructions_to_event() const {
  constexpr double ticks_a_us = ticks_per_second / 1e6;
  const std::uint64_t bit_ticks = ticks_per_second / can.bits_per_second;
  const std::uint64_t to_bit = next_bit_ > ticks_ ? next_bit_ - ticks_ : 1;
  const double lse_hz = rtc != nullptr ? rtc->lse_hz() : 0;
  const double most_us = longest_sleep_us > 0 ? longest_sleep_us : longest_run_us;
  const double us = std::min(most_us, timer.capture_after_us(rcc.lsi_hz_now(now_us()), lse_hz));
  std::uint64_t ticks = std::min(static_cast<std::uint64_t>(us * ticks_a_us), to_bit + can.quiet_bits() * bit_ticks);
  if (run_until_ticks_ > ticks_) ticks = std::min(ticks, run_until_ticks_ - ticks_);
  if ((systick_csr_ & 1) != 0 && next_systick_ > ticks_) ticks = std::min(ticks, next_systick_ - ticks_);
  return static_cast<std::uint64_t>(static_cast<double>(ticks - std::min<std::uint64_t>(ticks, 1)) / ticks_a_cycle());
}

std::uint64_t UnicornBoard::run_by_instructions() {
  const std::uint64_t count = 1 + random_() % longest_slice;
  ended(core_.run_instructions(reg(UC_ARM_REG_PC), count));
  return count;
}

/// Where the next block would reach beyond the event, single instructions do.
std::uint64_t UnicornBoard::run_by_blocks() {
  passed_ = 0;
  soon_ends_ = false;
  const UnicornCore::Run run = core_.run_blocks(reg(UC_ARM_REG_PC), instructions_to_event());
  if (run.at_limit && run.instructions == 0) return run_by_instructions();
  ended(run);
  return run.instructions - passed_;
}

void UnicornBoard::slice() {
  if (sleeping_ || core_stopped() || (program_held && !handling())) {
    pass(sleep_ticks());
  } else {
    const bool exactly = by_instructions || pending_exception() != 0;
    const std::uint64_t count = exactly ? run_by_instructions() : run_by_blocks();
    const double waits_us = flash.take_stall_us() + std::exchange(stall_us, 0);
    pass(static_cast<std::uint64_t>(static_cast<double>(count) * ticks_a_cycle()) +
         static_cast<std::uint64_t>(waits_us * (ticks_per_second / 1e6)));
  }
  refuse_violations();
  if (flash.power_failed) return lose_power();
  deliver_interrupt();
  const bool watchdog_expired = watchdog.expired(now_us());
  if (watchdog_expired) ended_ = "the watchdog has reset the core";
  if (ended_.empty()) return;
  if (!may_start_again) throw std::runtime_error(ended_);
  start_again(1U << 26 | (watchdog_expired ? 1U << 29 : 1U << 28));  // each also pulls the reset pin
}

void UnicornBoard::run_for_ms(double ms) {
  const std::uint64_t until = run_until_ticks_ = ticks_ + static_cast<std::uint64_t>(ms * (ticks_per_second / 1e3));
  while (ticks_ < until) slice();
}

bool UnicornBoard::run_until(const std::function<bool()>& becomes, double within_ms) {
  const std::uint64_t until = run_until_ticks_ =
      ticks_ + static_cast<std::uint64_t>(within_ms * (ticks_per_second / 1e3));
  while (!becomes()) {
    if (ticks_ >= until) return false;
    slice();
  }
  return true;
}

std::vector<std::uint32_t> UnicornBoard::call(const std::string& function, std::size_t words) {
  while (handling()) slice();
  const std::uint32_t result = ccm + 64;  // the lowest words of the stack
  core_.call(address_of(function), result);
  std::vector<std::uint32_t> returned(words);
  for (std::size_t k = 0; k < words; ++k) returned[k] = core_.word(result + static_cast<std::uint32_t>(4 * k));
  return returned;
}

hal::CanHealth UnicornBoard::can_health() {
  static_assert(sizeof(hal::CanHealth) == 32);
  const auto words = call("bms::hal::can_health()", 8);
  hal::CanHealth health;
  std::memcpy(static_cast<void*>(&health), words.data(), sizeof health);
  return health;
}

hal::BoardState UnicornBoard::board_state() {
  static_assert(sizeof(hal::BoardState) <= 12);
  const auto words = call("bms::hal::board_state()", 3);
  hal::BoardState state;
  std::memcpy(static_cast<void*>(&state), words.data(), sizeof state);
  return state;
}

void UnicornBoard::supply(bool low) {
  supply_low_ = low;
  const bool watched = (register_value(0x40007000) & 1U << 4) != 0 &&
                       (register_value(0x40013C00) & register_value(0x40013C08) & 1U << 16) != 0;
  if (low && watched) supply_pending_ = true;
}

std::uint32_t UnicornBoard::stack_used() const {
  std::uint32_t free = 4 * 64;  // below: results of call()
  while (free < ccm_size && core_.word(ccm + free) == untouched) free += 4;
  return ccm_size - free;
}

}  // namespace bms::firmware
