// ARMv6-M: no FPU, no vector table elsewhere, one kind of fault and no register that tells why.
#include "hal/cortex_m/core.hpp"

namespace bms::hal::cortex_m {

void start_core() {}
void read_fault_status(FaultRecord&) {}

}  // namespace bms::hal::cortex_m
