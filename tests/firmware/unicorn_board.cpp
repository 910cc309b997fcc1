#include "tests/firmware/unicorn_board.hpp"

#include <elf.h>
#include <unicorn/unicorn.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <iterator>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "files/text_file.hpp"

namespace bms::firmware {

namespace {

constexpr std::uint32_t ccm = 0x10000000, ccm_size = 0x10000, scs = 0xE000E000, untouched = 0xA5A5A5A5;
constexpr std::uint32_t nmi = 2, systick_exception = 15, pvd = 16 + 1, can_tx = 16 + 19, can_rx0 = 16 + 20,
                        timer_5 = 16 + TimerModel::interrupt_number;
constexpr std::uint32_t apb1enr = 0x40023840, pwr_cr = 0x40007000;
constexpr std::uint32_t return_of_call = 0xFFFFFF00;  // no code there: ends call()
constexpr std::uint32_t one_time_memory = 0x1FFF7800;

void must(uc_err error, const char* what) {
  if (error != UC_ERR_OK) throw std::runtime_error(fmt::format("{}: {}", what, uc_strerror(error)));
}

}  // namespace

UnicornBoard::UnicornBoard(const std::filesystem::path& image, std::uint32_t seed, bool crystal)
    : symbols_(symbols_of(image)), random_(seed) {
  rcc.crystal = crystal;
  must(uc_open(UC_ARCH_ARM, static_cast<uc_mode>(UC_MODE_THUMB | UC_MODE_MCLASS), &core_), "open");
  must(uc_ctl_set_cpu_model(core_, UC_CPU_ARM_CORTEX_M4), "model");
  constexpr std::uint32_t stored = FlashControllerModel::memory,
                          stored_bytes = FlashControllerModel::sectors * FlashControllerModel::sector_bytes,
                          code = stored + stored_bytes;
  must(uc_mem_map(core_, 0x08000000, stored - 0x08000000, UC_PROT_READ | UC_PROT_EXEC), "vectors");
  must(uc_mem_map(core_, code, 0x08100000 - code, UC_PROT_READ | UC_PROT_EXEC), "flash");
  must(uc_mmio_map(
           core_, stored, stored_bytes,
           [](uc_engine*, std::uint64_t at, unsigned size, void* self) -> std::uint64_t {
             return static_cast<UnicornBoard*>(self)->flash.read_memory(static_cast<std::uint32_t>(at), size);
           },
           this,
           [](uc_engine*, std::uint64_t at, unsigned size, std::uint64_t value, void* self) {
             static_cast<UnicornBoard*>(self)->flash.write_memory(static_cast<std::uint32_t>(at), size,
                                                                  static_cast<std::uint32_t>(value));
           },
           this),
       "storage");
  must(uc_mem_map(core_, 0x20000000, 0x20000, UC_PROT_READ | UC_PROT_WRITE), "RAM");
  must(uc_mem_map(core_, ccm, ccm_size, UC_PROT_READ | UC_PROT_WRITE), "core-coupled RAM");
  must(uc_mem_map(core_, 0x1FFF7000, 0x1000, UC_PROT_READ), "system memory");
  const std::vector<std::uint8_t> erased(0x210, 0xFF);  // one-time programmable memory and its lock bytes
  must(uc_mem_write(core_, one_time_memory, erased.data(), erased.size()), "system memory");
  const std::uint16_t reference = 1'502;  // VREFINT_CAL: 1.21 V of 3.3 V (datasheet, internal reference voltage)
  must(uc_mem_write(core_, 0x1FFF7A2A, &reference, 2), "system memory");
  const auto map = [&]<std::uint32_t Base>(std::integral_constant<std::uint32_t, Base>, std::size_t size) {
    must(uc_mmio_map(
             core_, Base, size,
             [](uc_engine*, std::uint64_t at, unsigned, void* self) -> std::uint64_t {
               return static_cast<UnicornBoard*>(self)->peripheral_read(Base + static_cast<std::uint32_t>(at));
             },
             this,
             [](uc_engine*, std::uint64_t at, unsigned bytes, std::uint64_t value, void* self) {
               static_cast<UnicornBoard*>(self)->peripheral_write(Base + static_cast<std::uint32_t>(at),
                                                                  static_cast<std::uint32_t>(value), bytes);
             },
             this),
         "registers");
  };
  map(std::integral_constant<std::uint32_t, 0x40000000>{}, 0x30000);
  map(std::integral_constant<std::uint32_t, 0x50060000>{}, 0x1000);  // random number generator
  map(std::integral_constant<std::uint32_t, scs>{}, 0x1000);
  const std::vector<std::uint32_t> paint(ccm_size / 4, untouched);
  must(uc_mem_write(core_, ccm, paint.data(), ccm_size), "paint");
  load(image);
  find_it_blocks();
  const std::uint64_t step = symbol_named(symbols_, "bms::firmware::estimator_step(").address & ~std::uint64_t{1};
  uc_hook hook = 0;
  const auto count =
      +[](uc_engine*, std::uint64_t, std::uint32_t, void* self) { ++static_cast<UnicornBoard*>(self)->estimates; };
  must(uc_hook_add(core_, &hook, UC_HOOK_CODE, reinterpret_cast<void*>(count), this, step, step), "hook");
  start();
}

void UnicornBoard::start() {
  watchdog.reset(now_us(), (flash.option_bytes & 1U << 5) == 0);
  std::array<std::uint32_t, 2> vectors{};
  must(uc_mem_read(core_, 0x08000000, vectors.data(), sizeof vectors), "vectors");
  set_reg(UC_ARM_REG_SP, vectors[0]);
  set_reg(UC_ARM_REG_LR, 0xFFFFFFFF);
  set_reg(UC_ARM_REG_PC, vectors[1] | 1);
}

/// RM0090, 7.1.1: resets everything except the backup domain and the reset flags.
void UnicornBoard::start_again(std::uint32_t flags) {
  resets.push_back(flags);
  rcc.reset();
  rcc.reset_flags = flags;
  registers_.clear();
  ended_.clear();
  sleeping_ = systick_pending_ = supply_pending_ = false;
  active_.clear();
  priorities_.fill(0);
  systick_csr_ = systick_rvr_ = 0;
  enabled_ = 0;
  can.write(0, 1U << 15);
  flash.reset();
  timer.reset();
  for (const auto& [base, peripheral] : plugged) peripheral->chip_reset();
  set_reg(UC_ARM_REG_CONTROL, 0);
  set_reg(UC_ARM_REG_PRIMASK, 0);
  set_reg(UC_ARM_REG_XPSR, 1U << 24);
  start();
}

void UnicornBoard::patch(const std::string& function, Instructions with) {
  const std::uint32_t at = address_of(function);
  Instructions before{};
  must(uc_mem_read(core_, at, before.data(), sizeof before), "patch");
  patched_.emplace_back(at, before);
  must(uc_mem_write(core_, at, with.data(), sizeof with), "patch");
  uc_ctl_remove_cache(core_, at, at + sizeof with);
}

void UnicornBoard::unpatch() {
  for (const auto& [at, before] : patched_) {
    must(uc_mem_write(core_, at, before.data(), sizeof before), "patch");
    uc_ctl_remove_cache(core_, at, at + sizeof before);
  }
  patched_.clear();
}

std::uint32_t UnicornBoard::address_of(const std::string& function) const {
  return static_cast<std::uint32_t>(symbol_named(symbols_, function).address) & ~1U;
}

void UnicornBoard::stick(std::uint32_t address, unsigned bit, bool at) {
  stuck_ = {address, bit, at};
  uc_hook hook = 0;
  const auto before_reading = +[](uc_engine* core, uc_mem_type, std::uint64_t, int, std::int64_t, void* self) {
    const Stuck& s = static_cast<UnicornBoard*>(self)->stuck_;
    std::uint8_t byte = 0;
    uc_mem_read(core, s.address, &byte, 1);
    byte = static_cast<std::uint8_t>(s.at ? byte | 1U << s.bit : byte & ~(1U << s.bit));
    uc_mem_write(core, s.address, &byte, 1);
  };
  must(uc_hook_add(core_, &hook, UC_HOOK_MEM_READ, reinterpret_cast<void*>(before_reading), this, address & ~3U,
                   address | 3U),
       "hook");
}

void UnicornBoard::flip_bit(std::uint32_t address, unsigned bit) {
  std::uint8_t byte = 0;
  must(uc_mem_read(core_, address, &byte, 1), "memory");
  byte = static_cast<std::uint8_t>(byte ^ 1U << bit);
  must(uc_mem_write(core_, address, &byte, 1), "memory");
  uc_ctl_remove_cache(core_, address & ~1U, (address & ~1U) + 2);
}

void UnicornBoard::write_one_time_memory(std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> content(bytes.size());
  must(uc_mem_read(core_, one_time_memory, content.data(), content.size()), "one-time memory");
  for (std::size_t k = 0; k < bytes.size(); ++k) content[k] &= bytes[k];
  must(uc_mem_write(core_, one_time_memory, content.data(), content.size()), "one-time memory");
}

UnicornBoard::~UnicornBoard() { uc_close(core_); }

void UnicornBoard::load(const std::filesystem::path& image) {
  const std::string bytes = files::read_file(image);
  Elf32_Ehdr head{};
  std::memcpy(&head, bytes.data(), sizeof head);
  for (unsigned k = 0; k < head.e_phnum; ++k) {
    Elf32_Phdr part{};
    std::memcpy(&part, bytes.data() + head.e_phoff + k * sizeof part, sizeof part);
    if (part.p_type == PT_LOAD && part.p_filesz > 0)
      must(uc_mem_write(core_, part.p_paddr, bytes.data() + part.p_offset, part.p_filesz), "load");
  }
}

std::uint32_t UnicornBoard::reg(int id) const {
  std::uint32_t value = 0;
  must(uc_reg_read(core_, id, &value), "register");
  return value;
}
void UnicornBoard::set_reg(int id, std::uint32_t value) { must(uc_reg_write(core_, id, &value), "register"); }

std::uint32_t UnicornBoard::register_value(std::uint32_t address) const {
  const auto found = registers_.find(address);
  return found == registers_.end() ? 0 : found->second;
}

std::uint32_t UnicornBoard::word(std::uint32_t address) const {
  std::uint32_t value = 0;
  must(uc_mem_read(core_, address, &value, sizeof value), "memory");
  return value;
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
                 ? static_cast<std::uint32_t>(static_cast<double>(next_systick_ - ticks_) / ticks_a_cycle())
                 : 0;
    case scs + 0x100:
    case scs + 0x180:
      return static_cast<std::uint32_t>(enabled_);
    case scs + 0x104:
    case scs + 0x184:
      return static_cast<std::uint32_t>(enabled_ >> 32);
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
      enabled_ |= value;
      return true;
    case 0x180:
      enabled_ &= ~std::uint64_t{value};
      return true;
    case 0x104:
      enabled_ |= std::uint64_t{value} << 32;
      return true;
    case 0x184:
      enabled_ &= ~(std::uint64_t{value} << 32);
      return true;
    case 0xD0C:
      if ((value & 4) != 0) ended_ = "the firmware has reset the core";
      if (!ended_.empty()) uc_emu_stop(core_);
      return true;
    default:
      return false;
  }
}

void UnicornBoard::pass(std::uint64_t ticks) {
  const std::uint64_t until = ticks_ + ticks, bit_ticks = ticks_per_second / can.bits_per_second;
  const double us = 1e6 * static_cast<double>(ticks) / static_cast<double>(ticks_per_second);
  const double lse_hz = rtc != nullptr ? rtc->lse_hz() : 0;
  timer.pass(us, rcc.apb1_timer_hz(), rcc.lsi_hz_now(now_us()), lse_hz);
  const auto apb1_hz = static_cast<std::uint32_t>(rcc.apb1_hz());
  if (next_bit_ == 0) next_bit_ = bit_ticks;
  while (next_bit_ <= until) {
    const std::uint64_t quiet = std::min(can.quiet_bits(), (until - next_bit_) / bit_ticks);
    can.pass_quiet(quiet);
    can.bit(apb1_hz);
    next_bit_ += (quiet + 1) * bit_ticks;
  }
  if (core_stopped()) next_systick_ += ticks;
  ticks_ = until;
  rcc.advance(now_us());
  if (const double hz = rcc.core_hz(); hz != core_hz_) {
    if (next_systick_ > ticks_ && hz > 0 && !core_stopped())
      next_systick_ = ticks_ + static_cast<std::uint64_t>(static_cast<double>(next_systick_ - ticks_) * core_hz_ / hz);
    core_hz_ = hz;
  }
  if ((systick_csr_ & 1) == 0 || core_stopped()) return;
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
  const auto enabled = [&](std::uint32_t exception) { return (enabled_ >> (exception - 16) & 1) != 0; };
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
  if (uc_mem_write(core_, sp, frame.data(), 4 * frame.size()) != UC_ERR_OK) {  // B1.5.6: this is a bus fault
    if (!may_start_again) throw std::runtime_error("no stack for an interrupt");
    registers_[scs + 0xD28] |= 1U << 12;
    exception = 5;
  }
  set_reg(UC_ARM_REG_SP, sp);
  const std::uint32_t return_to = handling() ? 0xFFFFFFF1 : 0xFFFFFFF9;  // table B1-8
  set_reg(UC_ARM_REG_LR, fpu ? return_to & ~16U : return_to);
  set_reg(UC_ARM_REG_CONTROL, control & ~4U);
  set_reg(UC_ARM_REG_XPSR, 1U << 24);  // outside an IT block
  std::uint32_t handler = 0;
  must(uc_mem_read(core_, 0x08000000 + 4 * exception, &handler, 4), "vector");
  set_reg(UC_ARM_REG_PC, handler | 1);
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
  must(uc_mem_read(core_, sp, frame.data(), 4 * frame.size()), "the stack of an interrupt");
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

void UnicornBoard::find_it_blocks() {
  std::map<std::uint32_t, bool> regions;  // from this address on: code, or data (AAELF32, mapping symbols)
  for (const Symbol& s : symbols_) {
    if (s.address < 0x08000000 || s.address >= 0x08100000) continue;
    if (s.name.starts_with("$t") || s.name.starts_with("$d"))
      regions[static_cast<std::uint32_t>(s.address)] = s.name[1] == 't';
  }
  const auto half = [&](std::uint32_t at) {
    std::uint16_t h = 0;
    return uc_mem_read(core_, at, &h, 2) == UC_ERR_OK ? h : std::uint16_t{0};
  };
  const auto bytes = [&](std::uint32_t at) { return half(at) >= 0xE800 ? 4U : 2U; };
  for (auto r = regions.begin(); r != regions.end() && std::next(r) != regions.end(); ++r) {
    for (std::uint32_t at = r->first; r->second && at < std::next(r)->first; at += bytes(at)) {
      const unsigned mask = half(at) & 15U;
      if ((half(at) & 0xFF00) != 0xBF00 || mask == 0) continue;
      std::uint32_t end = at + 2;
      for (int left = 4 - std::countr_zero(mask); left > 0; --left) end += bytes(end);
      it_blocks_[at + 2] = end;
    }
  }
  if (it_blocks_.empty()) throw std::runtime_error("an image without mapping symbols");
}

/// If Unicorn 2.0.1 is stopped within an IT block, it finishes the block. If a translation block begins inside, it
/// leaves the program counter within the IT block although EPSR.IT is that of its end, and the last instruction would
/// run twice. A regular stop within an IT block has the state of the block.
std::uint32_t UnicornBoard::behind_it_block(std::uint32_t pc) const {
  if ((reg(UC_ARM_REG_XPSR) & 0x0600FC00) != 0) return pc;
  const auto next = it_blocks_.upper_bound(pc);
  return next != it_blocks_.begin() && pc < std::prev(next)->second ? std::prev(next)->second : pc;
}

void UnicornBoard::execute(std::uint32_t from, std::size_t count) {
  const uc_err error = uc_emu_start(core_, from | 1, 0xFFFFFFFE, 0, count);
  instructions += count;
  std::uint32_t pc = reg(UC_ARM_REG_PC);
  if (error == UC_ERR_OK) {
    if (const std::uint32_t behind = behind_it_block(pc); behind != pc) set_reg(UC_ARM_REG_PC, (pc = behind) | 1);
  }
  if ((pc & 0xFFFFFFE0) == 0xFFFFFFE0) return leave(pc | 1);
  if (pc >= return_of_call) return;
  if (error != UC_ERR_OK && take_fault(error)) return;
  if (error != UC_ERR_OK)
    throw std::runtime_error(fmt::format("the firmware stops at {:08x}: {}", pc, uc_strerror(error)));
  std::uint16_t last = 0;
  must(uc_mem_read(core_, pc - 2, &last, 2), "code");
  sleeping_ = last == 0xBF30;  // wfi
}

/// To the next bit or tick, whichever comes first; in fast runs over bits that change nothing.
std::uint64_t UnicornBoard::sleep_ticks() const {
  const std::uint64_t to_tick = next_systick_ > ticks_ ? next_systick_ - ticks_ : 1;
  const std::uint64_t to_bit = next_bit_ > ticks_ ? next_bit_ - ticks_ : 1;
  if (longest_sleep_us <= 0) return std::min(to_tick, to_bit);
  constexpr double ticks_a_us = ticks_per_second / 1e6;
  const double lse_hz = rtc != nullptr ? rtc->lse_hz() : 0;
  const double us = std::min(longest_sleep_us, timer.capture_after_us(rcc.lsi_hz_now(now_us()), lse_hz));
  const std::uint64_t to_event = static_cast<std::uint64_t>(us * ticks_a_us) + 1;
  const std::uint64_t to_change = to_bit + can.quiet_bits() * (ticks_per_second / can.bits_per_second);
  const std::uint64_t to_end = run_until_ticks_ > ticks_ ? run_until_ticks_ - ticks_ : 1;
  return std::min({to_tick, to_event, to_change, to_end});
}

void UnicornBoard::slice() {
  if (sleeping_ || core_stopped() || (program_held && !handling())) {
    pass(sleep_ticks());
  } else {
    const auto count = static_cast<std::size_t>(1 + random_() % 200);
    execute(reg(UC_ARM_REG_PC), count);
    const double waits_us = flash.take_stall_us() + std::exchange(stall_us, 0);
    pass(static_cast<std::uint64_t>(static_cast<double>(count) * ticks_a_cycle()) +
         static_cast<std::uint64_t>(waits_us * (ticks_per_second / 1e6)));
  }
  refuse_violations();
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
  uc_context* context = nullptr;
  must(uc_context_alloc(core_, &context), "context");
  must(uc_context_save(core_, context), "context");
  const std::uint32_t result = ccm + 64;  // the lowest words of the stack
  set_reg(UC_ARM_REG_R0, result);
  set_reg(UC_ARM_REG_LR, return_of_call | 1);
  uc_emu_start(core_, address_of(function) | 1, return_of_call, 0, 1'000'000);
  std::vector<std::uint32_t> returned(words);
  must(uc_mem_read(core_, result, returned.data(), 4 * words), "result");
  must(uc_context_restore(core_, context), "context");
  uc_context_free(context);
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
  std::vector<std::uint32_t> words(ccm_size / 4);
  must(uc_mem_read(core_, ccm, words.data(), ccm_size), "stack");
  std::size_t free = 64;  // below: results of call()
  while (free < words.size() && words[free] == untouched) ++free;
  return static_cast<std::uint32_t>(ccm_size - 4 * free);
}

}  // namespace bms::firmware
