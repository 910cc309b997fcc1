# STM32F405RG, Cortex-M4F, on a forklift's 16-cell board. No emulator has its CAN controller; tests/firmware runs the image on a model of it.
set(BMS_CPU_FLAGS -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16)
set(BMS_SCALAR_DEFINITION "")
set(BMS_DEFAULT_CELL table9)
set(BMS_LINKER_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/memory.ld)
set(BMS_CHIP stm32f4)
set(BMS_EMULATED OFF)
set(BMS_CAN bxcan)
set(BMS_CAN_DEFINITION BMS_CAN_BIT_RATE=250000)
