// ARMv7-M with an FPU: Architecture Reference Manual, B3.2.
#include "hal/cortex_m/core.hpp"
#include "hal/cortex_m/registers.hpp"

extern "C" std::uint32_t image_vectors[];

namespace bms::hal::cortex_m {

namespace {

Register& scb_vtor() { return at<0xE000ED08>(); }
Register& scb_shcsr() { return at<0xE000ED24>(); }
Register& scb_cfsr() { return at<0xE000ED28>(); }
Register& scb_hfsr() { return at<0xE000ED2C>(); }
Register& scb_mmfar() { return at<0xE000ED34>(); }
Register& scb_bfar() { return at<0xE000ED38>(); }
Register& scb_cpacr() { return at<0xE000ED88>(); }

}  // namespace

void start_core() {
  scb_cpacr() = scb_cpacr() | 15U << 20;                        // FPU on, before any code uses it
  scb_vtor() = reinterpret_cast<std::uint32_t>(image_vectors);  // the boot pins may map other memory to 0
  asm volatile("dsb\n isb" ::: "memory");
  scb_shcsr() = scb_shcsr() | 7U << 16;  // separate memory, bus and usage faults
}

void read_fault_status(FaultRecord& record) {
  record.cfsr = scb_cfsr();
  record.hfsr = scb_hfsr();
  record.address = (record.cfsr & 1U << 7) != 0 ? scb_mmfar() : scb_bfar();
}

}  // namespace bms::hal::cortex_m
