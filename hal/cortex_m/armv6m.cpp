// ARMv6-M: no FPU, fixed vector table, a single kind of fault and no register with its reason.
#include "hal/cortex_m/core.hpp"

namespace bms::hal::cortex_m {

void start_core() {}
void read_fault_status(FaultRecord&) {}

}  // namespace bms::hal::cortex_m
