# nRF51822-QFAA, Cortex-M0. QEMU emulates it as microbit.
set(BMS_SCALAR_DEFINITION BMS_FIXED_POINT)
set(BMS_DEFAULT_CELL table9)
set(BMS_LINKER_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/memory.ld)
set(BMS_CHIP nrf51)
set(BMS_EMULATED ON)
set(BMS_CAN slcan)
set(BMS_SAMPLES emulated)
set(BMS_CELLS 1)
set(BMS_FEWEST_CELLS 1)
set(BMS_MOST_CELLS 1)
set(BMS_SAMPLE_PERIOD_S 1.0)
# Budgets of the image for the chip [bytes]: flash, static RAM, worst-case stack; and the longest processing time of a
# sample [ms] (tests/firmware/board_budget.hpp).
set(BMS_BUDGET_FLASH 86016)  # rows of seconds and voltages outside the range took 1.5 KB; the chip has 256 KiB
set(BMS_BUDGET_RAM 8192)
set(BMS_BUDGET_STACK 4096)
set(BMS_BUDGET_SAMPLE_MS 100)  # a tenth of its period; the first sample takes longest
# Debug probe and target for ./bms flash: file names in OpenOCD's interface/ and target/.
set(BMS_PROBE cmsis-dap)
set(BMS_PROBE_TARGET nrf51)
