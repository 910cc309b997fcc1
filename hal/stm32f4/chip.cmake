# STM32F405, Cortex-M4F. Settings of every board with this chip (cmake/firmware.cmake).
set(BMS_CPU_FLAGS -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16)
set(BMS_CORE armv7m)
set(BMS_REPLACED_IN_EMULATION clock_tree clock_check)
set(BMS_STREAM_BLOCK 512)
set(BMS_FLASH stm32f4)
