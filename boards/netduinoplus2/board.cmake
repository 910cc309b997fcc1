# STM32F405RG, Cortex-M4F. QEMU emulates it as netduinoplus2.
set(BMS_SCALAR_DEFINITION "")
set(BMS_DEFAULT_CELL table9)
set(BMS_LINKER_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/memory.ld)
set(BMS_CHIP stm32f4)
set(BMS_EMULATED ON)
set(BMS_CAN slcan)
set(BMS_SAMPLES emulated)
set(BMS_CELLS 1)
set(BMS_FEWEST_CELLS 1)
set(BMS_MOST_CELLS 1)
set(BMS_SAMPLE_PERIOD_S 1.0)
# Budgets of the image for the chip [bytes]: flash, static RAM, worst-case stack; and the longest processing time of a
# sample [ms] (tests/firmware/board_budget.hpp).
set(BMS_BUDGET_FLASH 81920)  # service sessions and stored actions took 6.6 KB; the chip has 1 MiB
set(BMS_BUDGET_RAM 16384)
set(BMS_BUDGET_STACK 4096)
set(BMS_BUDGET_SAMPLE_MS 50)
# Debug probe and target for ./bms flash: file names in OpenOCD's interface/ and target/.
set(BMS_PROBE stlink)
set(BMS_PROBE_TARGET stm32f4x)
