# nRF51822, Cortex-M0, without a flash driver. Settings of every board with this chip (cmake/firmware.cmake).
set(BMS_CPU_FLAGS -mcpu=cortex-m0 -mthumb)
set(BMS_CORE armv6m)
set(BMS_REPLACED_IN_EMULATION "")
set(BMS_STREAM_BLOCK 64)
set(BMS_FLASH absent)
