# STM32F405RG, Cortex-M4F, on the board of a forklift with 8 to 16 cells. No emulator has its CAN controller;
# tests/firmware runs the image on a model of it.
set(BMS_SCALAR_DEFINITION "")
set(BMS_DEFAULT_CELL table9)
set(BMS_LINKER_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/memory.ld)
set(BMS_CHIP stm32f4)
set(BMS_CELLS 16)  # another number: -DBMS_CELLS=N
set(BMS_FEWEST_CELLS 8)
set(BMS_MOST_CELLS 16)
set(BMS_SAMPLE_PERIOD_S 0.1)
set(BMS_CURRENT_RANGE_A 2000)  # 200 mV at 0.1 mohm
set(BMS_PRECHARGE_S 0.5)  # 50 ohm x 10 mF
set(BMS_CLOSING_A 600)
set(BMS_CLOSING_OHM 0.015)
set(BMS_BLEED_OHM 33)  # an external switch for each cell (README.md, balancing)
set(BMS_EMULATED OFF)
set(BMS_LOOP_BOARD netduinoplus2)
set(BMS_CAN bxcan)
set(BMS_CAN_BIT_RATE 250000)  # another one: -DBMS_CAN_BIT_RATE=500000
set(BMS_CHARGER_BUS can1)  # can2: a bus of its own for the charger, with BMS_CHARGER_BIT_RATE (README.md, pins)
set(BMS_CHARGER_BIT_RATE 250000)
set(BMS_PARALLEL OFF)  # ON: one of two to four batteries, CAN2 is the bus between them (firmware/parallel/)
set(BMS_PARAMETERS true)
set(BMS_SAMPLES bq76952)
set(BMS_AUXILIARY_CONTACTS stm32f4)  # absent: a truck whose main contactors have none
# Of the truck; what it does not have is left out of the list (boards/README.md).
set(BMS_INPUTS charger_plug coil_supply interlock crash)
set(BMS_OUTPUTS heater fan soc_lamp)
set(BMS_SECOND_CURRENT hall)  # absent: a truck without a Hall sensor
set(BMS_SLEEPS ON)  # needs the 32,768 Hz crystal, without which the chip does not stop
set(BMS_SWITCHES_OFF OFF)  # ON: with REG1 in the supply and TS2 at key and plug (README.md, supply), and the input key
set(BMS_INSULATION absent)  # pwm: Bender IR155; iso175: Bender iso175, over CAN
# Budgets of the image for the chip [bytes]: flash, static RAM, worst-case stack; and the longest processing time of a
# sample [ms] (tests/firmware/board_budget.hpp).
set(BMS_BUDGET_FLASH 98304)  # the chip has 1 MiB
set(BMS_BUDGET_RAM 16384)
set(BMS_BUDGET_STACK 4096)
set(BMS_BUDGET_SAMPLE_MS 50)
# Debug probe and target for ./bms flash: file names in OpenOCD's interface/ and target/.
set(BMS_PROBE stlink)
set(BMS_PROBE_TARGET stm32f4x)
