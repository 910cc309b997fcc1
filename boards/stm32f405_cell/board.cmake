# STM32F405RG, Cortex-M4F, on a board with one cell that the controller measures itself. No emulator has its CAN
# controller; tests/firmware runs the image on models of it and of the converter.
set(BMS_SCALAR_DEFINITION "")
set(BMS_DEFAULT_CELL table9)
set(BMS_LINKER_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/../stm32f405_forklift/memory.ld)  # the same chip and memory layout
set(BMS_CHIP stm32f4)
set(BMS_CELLS 1)
set(BMS_FEWEST_CELLS 1)
set(BMS_MOST_CELLS 1)
set(BMS_SAMPLE_PERIOD_S 0.1)
set(BMS_CURRENT_RANGE_A 41)  # 1.65 V / (20 x 2 mohm): hal/adc/cell_readings.hpp
set(BMS_EMULATED OFF)
set(BMS_LOOP_BOARD netduinoplus2)
set(BMS_CAN bxcan)
set(BMS_CAN_BIT_RATE 250000)
set(BMS_SAMPLES adc)
set(BMS_DC_LINK false)
# Budgets of the image for the chip [bytes]: flash, static RAM, worst-case stack; and the longest processing time of a
# sample [ms] (tests/firmware/board_budget.hpp).
set(BMS_BUDGET_FLASH 81920)  # service sessions and stored actions took 6.6 KB; the chip has 1 MiB
set(BMS_BUDGET_RAM 16384)
set(BMS_BUDGET_STACK 4096)
set(BMS_BUDGET_SAMPLE_MS 50)
# Debug probe and target for ./bms flash: file names in OpenOCD's interface/ and target/.
set(BMS_PROBE stlink)
set(BMS_PROBE_TARGET stm32f4x)
