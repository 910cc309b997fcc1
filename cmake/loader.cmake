# The boot loader of a board with an STM32F405 (firmware/loader/):
#
#   bms_<board>_loader.elf   built on request
#
# It does not depend on the cell file. BMS_LOADER_VERSION is its own version: 0xMMMMmmpp.
include(${root}/cmake/mbedtls.cmake)
set(BMS_LOADER_VERSION 0x00000200)

set(slot_hal ${chip}/slot_flash.cpp ${chip}/start_image.cpp)
if(BMS_EMULATED)
  set(slot_hal ${hal}/emulated/slot_flash.cpp ${hal}/emulated/start_image.cpp)
endif()
if(BMS_EMULATED)
  set(loader_chip ${hal}/emulated/semihosting.cpp ${in_emulation} ${absent_hal}/device_key.cpp ${absent_hal}/random.cpp)
else()
  set(loader_chip ${core}/finish.cpp ${chip}/clock_tree.cpp ${chip_secrets})
endif()
bms_objects(loader_hal -Os EXCLUDE_FROM_ALL ${core}/startup.cpp ${core}/stack.cpp ${core}/fault_record.cpp
  ${core}/${BMS_CORE}.cpp ${chip}/vectors.cpp ${chip}/clock.cpp ${chip}/watchdog.cpp ${absent_hal}/supply.cpp
  ${can_${BMS_CAN}} ${loader_chip})
set(boot_sources crypto_mbedtls.cpp iso_tp.cpp receiver.cpp slots.cpp update_server.cpp verify.cpp)
list(TRANSFORM boot_sources PREPEND ${root}/firmware/boot/)
bms_shared_objects(boot -Os EXCLUDE_FROM_ALL ${boot_sources} ${slot_hal} ${can_messages})
if(BMS_SHARED_OBJECTS)
  bms_import_objects(loader_mbedtls)
else()
  target_include_directories(boot SYSTEM PRIVATE ${BMS_MBEDTLS}/include)
  target_include_directories(boot PRIVATE ${root}/firmware/boot/mbedtls)
  target_compile_definitions(boot PRIVATE MBEDTLS_CONFIG_FILE="loader_config.h")
  bms_mbedtls(loader_mbedtls OBJECT)  # bignums by size would make the check a quarter slower
  target_compile_options(loader_mbedtls PRIVATE -O2)
  set_target_properties(loader_mbedtls PROPERTIES EXCLUDE_FROM_ALL ON)
  bms_list_objects(loader_mbedtls)
  list(APPEND shared_objects loader_mbedtls)
endif()
# what an application in a slot takes of it
add_custom_target(bms_${BMS_BOARD}_update_shared)
add_dependencies(bms_${BMS_BOARD}_update_shared boot loader_mbedtls)
bms_objects(loader -Os EXCLUDE_FROM_ALL ${root}/firmware/loader/main.cpp ${can_messages})
target_compile_definitions(loader PRIVATE BMS_BOARD="${BMS_BOARD}" BMS_LOADER_VERSION=${BMS_LOADER_VERSION})

set(application_script ${linker_script})
set(linker_script ${root}/firmware/loader/memory.ld)
bms_image(bms_${BMS_BOARD}_loader loader_hal loader boot loader_mbedtls)
set(linker_script ${application_script})
set_target_properties(bms_${BMS_BOARD}_loader PROPERTIES EXCLUDE_FROM_ALL ON)
target_link_options(bms_${BMS_BOARD}_loader PRIVATE -Wl,-z,max-page-size=0x800)  # no ELF header in the flash

set(of_a_slot "")
if(BMS_SLOT)  # the application receives updates; what it does not call is not linked
  set(of_a_slot boot loader_mbedtls)
endif()
