# STM32F405RG, Cortex-M4F. QEMU emulates it as netduinoplus2.
set(BMS_CPU_FLAGS -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16)
set(BMS_SCALAR_DEFINITION "")
set(BMS_DEFAULT_CELL table9)
set(BMS_LINKER_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/memory.ld)
set(BMS_CHIP stm32f4)
set(BMS_EMULATED ON)
set(BMS_CAN slcan)
