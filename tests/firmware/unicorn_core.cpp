#include "tests/firmware/unicorn_core.hpp"

#include <dlfcn.h>
#include <unicorn/unicorn.h>

#include <bit>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <new>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace bms::firmware {

namespace {

constexpr std::uint32_t flash = 0x08000000, flash_end = 0x08100000, no_code = 0xFFFFFF00;
constexpr std::size_t page = 4096, by_blocks = 0, by_instructions = 1;

void must(uc_err error, const char* what) {
  if (error != UC_ERR_OK) throw std::runtime_error(fmt::format("{}: {}", what, uc_strerror(error)));
}

/// What moves from one Unicorn to the other. CONTROL comes first: it selects the stack pointer.
constexpr std::array core_registers{
    UC_ARM_REG_CONTROL, UC_ARM_REG_PRIMASK, UC_ARM_REG_BASEPRI, UC_ARM_REG_FAULTMASK, UC_ARM_REG_FPSCR, UC_ARM_REG_R0,
    UC_ARM_REG_R1,      UC_ARM_REG_R2,      UC_ARM_REG_R3,      UC_ARM_REG_R4,        UC_ARM_REG_R5,    UC_ARM_REG_R6,
    UC_ARM_REG_R7,      UC_ARM_REG_R8,      UC_ARM_REG_R9,      UC_ARM_REG_R10,       UC_ARM_REG_R11,   UC_ARM_REG_R12,
    UC_ARM_REG_SP,      UC_ARM_REG_LR,      UC_ARM_REG_PC,      UC_ARM_REG_XPSR};
constexpr std::size_t double_registers = 16;

unsigned version() {
  static const unsigned loaded = uc_version(nullptr, nullptr) >> 8;
  return loaded;
}
constexpr unsigned with_useless_locks = 0x020001;

}  // namespace

struct UnicornCore::Memory {
  Memory(std::uint32_t at, std::uint32_t size)
      : address(at), bytes(size), content(static_cast<std::uint8_t*>(std::aligned_alloc(page, size)), &std::free) {
    if (content == nullptr) throw std::bad_alloc();
    std::memset(content.get(), 0, size);
  }
  std::uint32_t address, bytes;
  std::unique_ptr<std::uint8_t, decltype(&std::free)> content;
};

UnicornCore::UnicornCore() {
  for (uc_struct*& engine : engines_) {
    must(uc_open(UC_ARCH_ARM, static_cast<uc_mode>(UC_MODE_THUMB | UC_MODE_MCLASS), &engine), "open");
    must(uc_ctl_set_cpu_model(engine, UC_CPU_ARM_CORTEX_M4), "model");
    must(uc_ctl_exits_enable(engine), "exits");  // without any: an address to end at costs time in each run
  }
  const auto on_block = +[](uc_engine*, std::uint64_t address, std::uint32_t bytes, void* self) {
    static_cast<UnicornCore*>(self)->begin_block(static_cast<std::uint32_t>(address), bytes);
  };
  uc_hook hook = 0;
  must(uc_hook_add(engines_[by_blocks], &hook, UC_HOOK_BLOCK, reinterpret_cast<void*>(on_block), this, 1, 0), "hook");
}

UnicornCore::~UnicornCore() {
  for (uc_struct* engine : engines_) uc_close(engine);
}

void UnicornCore::map(std::uint32_t address, std::uint32_t bytes, Access access) {
  std::uint32_t protection = UC_PROT_READ;
  if (access == Access::read_and_execute) protection |= UC_PROT_EXEC;
  if (access == Access::read_and_write) protection |= UC_PROT_WRITE;
  if (access == Access::program_and_execute) protection |= UC_PROT_WRITE | UC_PROT_EXEC;
  memories_.push_back(std::make_unique<Memory>(address, bytes));
  for (uc_struct* engine : engines_)
    must(uc_mem_map_ptr(engine, address, bytes, protection, memories_.back()->content.get()), "memory");
  if (access != Access::program_and_execute) return;
  const auto stores = +[](uc_engine*, uc_mem_type, std::uint64_t at, int size, std::int64_t value, void* self) {
    static_cast<UnicornCore*>(self)->on_program(static_cast<std::uint32_t>(at), static_cast<std::uint32_t>(value),
                                                static_cast<unsigned>(size));
  };
  for (uc_struct* engine : engines_) {
    uc_hook hook = 0;
    must(uc_hook_add(engine, &hook, UC_HOOK_MEM_WRITE, reinterpret_cast<void*>(stores), this, address,
                     std::uint64_t{address} + bytes - 1),
         "hook");
  }
}

void UnicornCore::forget_code(std::uint32_t begin, std::uint32_t end) {
  for (uc_struct* engine : engines_) uc_ctl_remove_cache(engine, begin, std::uint64_t{end});
}

void UnicornCore::map_registers(std::uint32_t address, std::uint32_t bytes) {
  peripherals_.push_back(std::make_unique<Peripherals>(Peripherals{this, address}));
  const auto reads = +[](uc_engine*, std::uint64_t at, unsigned size, void* of) -> std::uint64_t {
    const auto* peripherals = static_cast<Peripherals*>(of);
    return peripherals->core->on_read(peripherals->address + static_cast<std::uint32_t>(at), size);
  };
  const auto writes = +[](uc_engine*, std::uint64_t at, unsigned size, std::uint64_t value, void* of) {
    const auto* peripherals = static_cast<Peripherals*>(of);
    peripherals->core->on_write(peripherals->address + static_cast<std::uint32_t>(at),
                                static_cast<std::uint32_t>(value), size);
  };
  void* of = peripherals_.back().get();
  for (uc_struct* engine : engines_) must(uc_mmio_map(engine, address, bytes, reads, of, writes, of), "registers");
}

void UnicornCore::find_instructions(const std::vector<Symbol>& symbols) {
  std::map<std::uint32_t, bool> regions;  // from this address on: code, or data (AAELF32, mapping symbols)
  for (const Symbol& s : symbols) {
    if (s.address < flash || s.address >= flash_end) continue;
    if (s.name.starts_with("$t") || s.name.starts_with("$d"))
      regions[static_cast<std::uint32_t>(s.address)] = s.name[1] == 't';
  }
  if (regions.empty()) throw std::runtime_error("an image without mapping symbols");
  std::vector<bool> begins((regions.rbegin()->first - flash) / 2 + 1);
  const auto bytes = [&](std::uint32_t at) { return half_word(at) >= 0xE800 ? 4U : 2U; };
  for (auto r = regions.begin(); std::next(r) != regions.end(); ++r) {
    for (std::uint32_t at = r->first; r->second && at < std::next(r)->first; at += bytes(at)) {
      begins[(at - flash) / 2] = true;
      const unsigned mask = half_word(at) & 15U;
      if ((half_word(at) & 0xFF00) != 0xBF00 || mask == 0) continue;
      std::uint32_t end = at + 2;
      for (int left = 4 - std::countr_zero(mask); left > 0; --left) end += bytes(end);
      it_blocks_[at + 2] = end;
    }
  }
  before_.assign(begins.size() + 1, {});
  for (std::size_t k = 0; k < begins.size(); ++k) {
    const auto next = it_blocks_.upper_bound(flash + 2 * static_cast<std::uint32_t>(k));
    const bool conditional = next != it_blocks_.begin() && flash + 2 * k < std::prev(next)->second;
    before_[k + 1] = {before_[k].instructions + (begins[k] ? 1 : 0),
                      before_[k].conditional + (begins[k] && conditional ? 1 : 0)};
  }
}

void UnicornCore::watch_entry(std::uint32_t address) {
  entry_ = address;
  const auto enters =
      +[](uc_engine*, std::uint64_t, std::uint32_t, void* self) { static_cast<UnicornCore*>(self)->on_entry(); };
  uc_hook hook = 0;
  must(uc_hook_add(engines_[by_instructions], &hook, UC_HOOK_CODE, reinterpret_cast<void*>(enters), this, address,
                   address),
       "hook");
}

void UnicornCore::watch_word(std::uint32_t address) {
  const auto reads = +[](uc_engine*, uc_mem_type, std::uint64_t, int, std::int64_t, void* self) {
    static_cast<UnicornCore*>(self)->before_word();
  };
  for (uc_struct* engine : engines_) {
    uc_hook hook = 0;
    must(
        uc_hook_add(engine, &hook, UC_HOOK_MEM_READ, reinterpret_cast<void*>(reads), this, address & ~3U, address | 3U),
        "hook");
  }
}

// ---- memory and registers ----

UnicornCore::Memory* UnicornCore::memory_at(std::uint32_t address, std::size_t bytes) const {
  const auto holds = [&](const auto& m) {
    return address >= m->address && address - m->address <= m->bytes && bytes <= m->bytes - (address - m->address);
  };
  const auto found = std::find_if(memories_.begin(), memories_.end(), holds);
  return found == memories_.end() ? nullptr : found->get();
}

bool UnicornCore::read(std::uint32_t address, std::span<std::uint8_t> bytes) const {
  const Memory* memory = memory_at(address, bytes.size());
  if (memory == nullptr) return false;
  std::memcpy(bytes.data(), memory->content.get() + (address - memory->address), bytes.size());
  return true;
}

bool UnicornCore::write(std::uint32_t address, std::span<const std::uint8_t> bytes) {
  Memory* memory = memory_at(address, bytes.size());
  if (memory == nullptr) return false;
  std::memcpy(memory->content.get() + (address - memory->address), bytes.data(), bytes.size());
  const bool code = address >= flash && address < flash_end;
  for (uc_struct* engine : engines_) {
    if (code) uc_ctl_remove_cache(engine, address & ~1U, (address + bytes.size() + 1) & ~std::uint64_t{1});
  }
  return true;
}

std::uint32_t UnicornCore::half_word(std::uint32_t address) const {
  std::array<std::uint8_t, 2> bytes{};
  read(address, bytes);
  return bytes[0] | std::uint32_t{bytes[1]} << 8;
}

std::uint32_t UnicornCore::word(std::uint32_t address) const {
  std::array<std::uint8_t, 4> bytes{};
  read(address, bytes);
  return bytes[0] | std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[2]} << 16 | std::uint32_t{bytes[3]} << 24;
}

std::uint32_t UnicornCore::reg(int id) const {
  std::uint32_t value = 0;
  must(uc_reg_read(engine(), id, &value), "register");
  return value;
}

void UnicornCore::set_reg(int id, std::uint32_t value) { must(uc_reg_write(engine(), id, &value), "register"); }

UnicornCore::Registers UnicornCore::registers() const {
  static_assert(std::tuple_size_v<Registers> == double_registers + core_registers.size());
  Registers values{};
  for (std::size_t k = 0; k < double_registers; ++k)
    must(uc_reg_read(engine(), UC_ARM_REG_D0 + static_cast<int>(k), &values[k]), "register");
  for (std::size_t k = 0; k < core_registers.size(); ++k) values[double_registers + k] = reg(core_registers[k]);
  return values;
}

void UnicornCore::set_registers(const Registers& values) {
  for (std::size_t k = 0; k < double_registers; ++k)
    must(uc_reg_write(engine(), UC_ARM_REG_D0 + static_cast<int>(k), &values[k]), "register");
  for (std::size_t k = 0; k < core_registers.size(); ++k) {
    const auto value = static_cast<std::uint32_t>(values[double_registers + k]);
    set_reg(core_registers[k], core_registers[k] == UC_ARM_REG_PC ? value | 1 : value);
  }
}

void UnicornCore::use(std::size_t other) {
  if (other == active_) return;
  const Registers values = registers();
  active_ = other;
  set_registers(values);
}

// ---- to run ----

std::pair<std::uint32_t, std::uint32_t> UnicornCore::instructions_in(std::uint32_t address, std::uint32_t bytes) const {
  const std::size_t first = (address - flash) / 2, end = first + bytes / 2;
  if (address < flash || end >= before_.size()) return {std::max(1U, bytes / 2), 0};
  return {std::max(1U, before_[end].instructions - before_[first].instructions),
          before_[end].conditional - before_[first].conditional};
}

/// Unicorn 2.0.1 does not execute the block that begins if it is stopped here.
void UnicornCore::begin_block(std::uint32_t address, std::uint32_t bytes) {
  const auto [more, conditional] = instructions_in(address, bytes);
  if (executed_ + more > limit_) {
    stopped_ = true;
    uc_emu_stop(engine());
    return;
  }
  executed_ += more;
  conditional_ += conditional;
  if (address == entry_) on_entry();
}

void UnicornCore::stop() {
  set_limit(0);
  if (!in_blocks()) uc_emu_stop(engine());
}

UnicornCore::Run UnicornCore::run_blocks(std::uint32_t from, std::uint64_t limit) {
  use(by_blocks);
  executed_ = conditional_ = 0;
  limit_ = limit;
  stopped_ = false;
  if (before_blocks) before_blocks();
  running_ = true;
  const uc_err error = uc_emu_start(engine(), from | 1, 0, 0, 0);
  running_ = false;
  Run run = finish(error, executed_);
  run.conditional = conditional_;
  if (after_blocks) after_blocks(run);
  return run;
}

UnicornCore::Run UnicornCore::run_instructions(std::uint32_t from, std::uint64_t count) {
  use(by_instructions);
  stopped_ = false;
  running_ = true;
  const uc_err error = uc_emu_start(engine(), from | 1, 0, 0, count);
  running_ = false;
  return finish(error, count);
}

UnicornCore::Run UnicornCore::finish(int error, std::uint64_t instructions) {
  Run run{.error = error, .pc = reg(UC_ARM_REG_PC), .instructions = instructions, .at_limit = stopped_};
  if (error != UC_ERR_OK) return run;
  if (const std::uint32_t now = after_what_was_executed(run.pc); now != run.pc)
    set_reg(UC_ARM_REG_PC, (run.pc = now) | 1);
  return run;
}

/// If Unicorn 2.0.1 is stopped within an IT block, it finishes the block. If a translation block begins inside, as at
/// the border of two pages, it leaves the program counter at its last instruction although that was executed and
/// EPSR.IT is the state after it. That state says where the program is: each instruction of an IT block has its own.
std::uint32_t UnicornCore::after_what_was_executed(std::uint32_t pc) const {
  const auto next = it_blocks_.upper_bound(pc);
  if (next == it_blocks_.begin() || pc >= std::prev(next)->second) return pc;
  const auto [first, end] = *std::prev(next);
  const std::uint32_t psr = reg(UC_ARM_REG_XPSR), state = (psr >> 8 & 0xFC) | (psr >> 25 & 3);
  std::uint32_t at = first;
  // ARMv7-M, A7.3.2: the state shifts with each instruction, and ends with the last
  for (std::uint32_t of_next = half_word(first - 2) & 0xFF; at < end; at += half_word(at) >= 0xE800 ? 4U : 2U) {
    if (state == of_next) return at;
    of_next = (of_next & 7) == 0 ? 0 : (of_next & 0xE0) | (of_next << 1 & 0x1F);
  }
  return end;
}

void UnicornCore::call(std::uint32_t function, std::uint32_t result) {
  use(by_instructions);
  uc_context* context = nullptr;
  must(uc_context_alloc(engine(), &context), "context");
  must(uc_context_save(engine(), context), "context");
  set_reg(UC_ARM_REG_R0, result);
  set_reg(UC_ARM_REG_LR, no_code | 1);
  running_ = true;
  uc_emu_start(engine(), function | 1, 0, 0, 1'000'000);  // ends where no code is
  running_ = false;
  must(uc_context_restore(engine(), context), "context");
  uc_context_free(context);
}

}  // namespace bms::firmware

// Unicorn 2.0.1 locks the pages of translated code at each store to memory, although it runs in one thread: a tree on
// the heap for each store, which costs twice as much as the rest of it. These two functions are found before those of
// the library and do nothing. With another version they call the library's own.

extern "C" void* page_collection_lock_arm(void* core, std::uintptr_t begin, std::uintptr_t end) {
  using Lock = void* (*)(void*, std::uintptr_t, std::uintptr_t);
  static const auto own = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "page_collection_lock_arm"));
  return bms::firmware::version() == bms::firmware::with_useless_locks ? nullptr : own(core, begin, end);
}

extern "C" void page_collection_unlock_arm(void* pages) {
  using Unlock = void (*)(void*);
  static const auto own = reinterpret_cast<Unlock>(dlsym(RTLD_NEXT, "page_collection_unlock_arm"));
  if (bms::firmware::version() != bms::firmware::with_useless_locks) own(pages);
}
