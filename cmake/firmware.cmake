# Firmware images of one board (BMS_BOARD) with one cell (BMS_CELL):
#
#   bms_<board>.elf          the application; telemetry and samples as SLCAN text on the UART
#   bms_<board>_replay.elf   the same application; samples and estimates stream through the emulator's files
#   bms_<board>_hil.elf      the application in lock step with a program on the host: its bus is a pair of the emulator's files
#   bms_<board>_bench.elf    as the first, for the chip itself: its clock tree, reset instead of the emulator's exit
#   bms_<board>_fault.elf    tests/firmware/fault_image.cpp; only when asked for
#   bms_<board>_pack.elf     tests/firmware/pack_image.cpp; only when asked for
#   bms_<board>_protection.elf  tests/firmware/protection_image.cpp; only when asked for
#
# Beside each bms_<board>*.elf lies what is in it, bms_<board>*.cdx.json (sbom.py).
#
# The first three run in QEMU only (hal/README.md). A board that QEMU does not have (BMS_EMULATED OFF) has bms_<board>.elf for the
# chip, bms_<board>_remote.elf with samples that another node measures, and bms_<board>_hil.elf for an emulated board with the same chip (BMS_LOOP_BOARD).
# board.cmake says which CAN back end it has, BMS_CAN slcan or bxcan, for the latter with a bit rate; and where its samples come from, BMS_SAMPLES
# bq76952 (measured by a chip on the board), adc (by the controller itself), remote (from another node) or emulated. What does not depend on the cell is compiled once for all.
#
# BMS_VEHICLE_PROFILE: messages that go out beside the battery's own: cia418, for a CANopen charger (nodes BMS_CANOPEN_NODE, BMS_CANOPEN_CHARGER), or
# j1939 (can/j1939_profile.dbc). can/messages.md says what they are.
include(${CMAKE_SOURCE_DIR}/boards/${BMS_BOARD}/board.cmake)
include(${CMAKE_SOURCE_DIR}/hal/${BMS_CHIP}/chip.cmake)  # compiler flags, core, what QEMU has in its place, flash
if(NOT BMS_CELL)
  set(BMS_CELL ${BMS_DEFAULT_CELL})
endif()

set(BMS_VEHICLE_PROFILE none CACHE STRING "messages beside the battery's own: none, cia418, j1939 (can/messages.md)")
set(BMS_CANOPEN_NODE 1 CACHE STRING "the battery's node on a CANopen bus")
set(BMS_CANOPEN_CHARGER 10 CACHE STRING "the charger's node")
set(vehicle_profile_none "")
set(vehicle_profile_cia418 BMS_VEHICLE_PROFILE_CIA418 BMS_CANOPEN_NODE=${BMS_CANOPEN_NODE} BMS_CANOPEN_CHARGER=${BMS_CANOPEN_CHARGER})
set(vehicle_profile_j1939 BMS_VEHICLE_PROFILE_J1939)
if(NOT DEFINED vehicle_profile_${BMS_VEHICLE_PROFILE})
  message(FATAL_ERROR "BMS_VEHICLE_PROFILE is ${BMS_VEHICLE_PROFILE}, expected none, cia418 or j1939")
endif()

# The header generator runs on the host: the one that is there, or one built for the purpose.
set(BMS_CELL_HEADER_TOOL "" CACHE FILEPATH "cell_header of a host build; empty: build it")
set(cell_header_tool ${BMS_CELL_HEADER_TOOL})
if(NOT cell_header_tool)
  include(ExternalProject)
  set(generators ${CMAKE_BINARY_DIR}/generators)
  ExternalProject_Add(generators
    SOURCE_DIR ${CMAKE_SOURCE_DIR}
    BINARY_DIR ${generators}
    CMAKE_ARGS -DBMS_GENERATORS_ONLY=ON -DBMS_TESTS=OFF
    BUILD_ALWAYS ON
    INSTALL_COMMAND ""
    BUILD_BYPRODUCTS ${generators}/files/cell_header)
  set(cell_header_tool ${generators}/files/cell_header)
endif()

set(cell_header ${CMAKE_BINARY_DIR}/generated/cell_constants.hpp)
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/generated)
set(cell_file "")
if(EXISTS ${BMS_CELL})
  set(cell_file ${BMS_CELL})
endif()
set(cell_source ${CMAKE_SOURCE_DIR}/model/cells/${BMS_CELL}.toml)
if(cell_file)
  set(cell_source ${cell_file})
endif()
set(cell_header_scalar "")
if(BMS_SCALAR_DEFINITION MATCHES BMS_FIXED_POINT)
  set(cell_header_scalar fixed)
endif()
add_custom_command(OUTPUT ${cell_header}
  COMMAND ${cell_header_tool} ${BMS_CELL} ${cell_header} ${cell_header_scalar}
  DEPENDS ${cell_header_tool} ${cell_file}
  COMMENT "Cell ${BMS_CELL}" VERBATIM)

add_compile_options(${BMS_CPU_FLAGS} -g -ffunction-sections -fdata-sections -fno-common -fstack-usage
  $<$<COMPILE_LANGUAGE:CXX>:-fno-exceptions> $<$<COMPILE_LANGUAGE:CXX>:-fno-rtti> $<$<COMPILE_LANGUAGE:CXX>:-fno-threadsafe-statics> $<$<COMPILE_LANGUAGE:CXX>:-fno-use-cxa-atexit>
  -Wsign-conversion -Wdouble-promotion -Wfloat-conversion
  -ffile-prefix-map=${CMAKE_SOURCE_DIR}=. -ffile-prefix-map=${CMAKE_BINARY_DIR}=build)  # the same bytes wherever it is built; what comes last is looked at first
add_link_options(${BMS_CPU_FLAGS} -nostartfiles --specs=nano.specs --specs=nosys.specs -L${CMAKE_SOURCE_DIR}/hal/cortex_m
  -Wl,--gc-sections,--no-warn-rwx-segments,--fatal-warnings)

include(${CMAKE_SOURCE_DIR}/cmake/can_messages.cmake)

# bms_objects(NAME OPTIMISATION SOURCE...)
function(bms_objects name optimisation)
  add_library(${name} OBJECT ${ARGN})
  target_link_libraries(${name} PUBLIC bms_estimator)
  target_compile_definitions(${name} PUBLIC ${BMS_SCALAR_DEFINITION} BMS_CELLS=${BMS_CELLS} BMS_SAMPLE_PERIOD_S=${BMS_SAMPLE_PERIOD_S})
  target_compile_options(${name} PRIVATE ${optimisation})
endfunction()

set(hal ${CMAKE_SOURCE_DIR}/hal)
set(chip ${hal}/${BMS_CHIP})
set(core ${hal}/cortex_m)
list(TRANSFORM BMS_REPLACED_IN_EMULATION APPEND .cpp OUTPUT_VARIABLE replaced)
list(TRANSFORM replaced PREPEND ${chip}/ OUTPUT_VARIABLE on_the_chip)
list(TRANSFORM replaced PREPEND ${hal}/emulated/ OUTPUT_VARIABLE in_emulation)
set(chip_flash ${hal}/${BMS_FLASH}/flash.cpp)  # BMS_FLASH: the chip's folder, or absent
set(emulated_flash ${hal}/emulated/flash.cpp)
if(BMS_FLASH STREQUAL absent)
  set(emulated_flash ${chip_flash})
endif()
# what a chip has no file for is absent
set(chip_calendar ${hal}/absent/calendar.cpp)
set(chip_state ${hal}/absent/board_state.cpp ${hal}/absent/supply.cpp)
if(EXISTS ${chip}/board_state.cpp)
  set(chip_calendar ${chip}/calendar.cpp)
  set(chip_state ${chip}/board_state.cpp ${chip}/supply.cpp ${core}/image_check.cpp)
endif()
bms_objects(hal_core -Os ${core}/startup.cpp ${core}/stack.cpp ${core}/fault_record.cpp ${core}/${BMS_CORE}.cpp ${chip}/vectors.cpp ${chip}/power.cpp)
bms_objects(hal_clock -Os ${chip}/clock.cpp)
bms_objects(hal_chip -Os ${core}/finish.cpp ${on_the_chip} ${chip_flash} ${chip_calendar})
bms_objects(hal_emulated -Os ${hal}/emulated/semihosting.cpp ${in_emulation})
# the board's back ends: BMS_CAN names how it talks, BMS_SAMPLES where its samples come from
set(can_slcan ${hal}/slcan/can.cpp ${chip}/uart.cpp)
set(can_bxcan ${chip}/bxcan.cpp)
set(samples_emulated ${hal}/emulated/samples_can.cpp ${hal}/frame_dispatch.cpp ${hal}/absent/calibration.cpp)
set(samples_remote ${hal}/remote/samples.cpp ${hal}/frame_dispatch.cpp ${hal}/absent/calibration.cpp)
set(samples_adc ${hal}/adc/samples.cpp ${hal}/frame_dispatch.cpp ${chip}/adc.cpp ${chip}/contactor_pins.cpp)
set(samples_bq76952 ${hal}/absent/calibration.cpp ${hal}/bq76952/samples.cpp ${hal}/frame_dispatch.cpp ${hal}/bq76952/front_end.cpp ${hal}/bq76952/wire.cpp ${chip}/i2c.cpp ${chip}/contactor_pins.cpp)
bms_objects(hal_board -Os ${can_${BMS_CAN}} ${chip}/watchdog.cpp ${chip_state} ${hal}/absent/estimate_record.cpp)
bms_objects(hal_samples -Os ${samples_${BMS_SAMPLES}})
bms_objects(hal_remote_samples -Os ${samples_remote})
target_compile_definitions(hal_board PRIVATE ${BMS_CAN_DEFINITION} ${vehicle_profile_${BMS_VEHICLE_PROFILE}})
bms_objects(hal_emulated_flash -Os ${emulated_flash} ${hal}/emulated/calendar.cpp)
bms_objects(hal_stream -O2 ${hal}/emulated/samples_stream.cpp ${hal}/absent/can.cpp ${hal}/absent/power_path.cpp ${hal}/absent/requests.cpp ${hal}/absent/watchdog.cpp ${hal}/absent/flash.cpp ${hal}/absent/calendar.cpp ${hal}/absent/board_state.cpp ${hal}/absent/supply.cpp ${hal}/absent/calibration.cpp)
target_compile_definitions(hal_stream PRIVATE BMS_STREAM_BLOCK=${BMS_STREAM_BLOCK})

bms_objects(hal_hil -Os ${hal}/emulated/can_pipe.cpp ${samples_remote} ${hal}/absent/estimate_record.cpp ${hal}/absent/watchdog.cpp ${hal}/absent/flash.cpp ${hal}/absent/calendar.cpp ${hal}/absent/board_state.cpp ${hal}/absent/supply.cpp)

bms_objects(storage -Os ${CMAKE_SOURCE_DIR}/storage/log.cpp ${CMAKE_SOURCE_DIR}/storage/persistence.cpp)
bms_objects(application -Os ${CMAKE_SOURCE_DIR}/firmware/main.cpp ${CMAKE_SOURCE_DIR}/firmware/board_cell.cpp ${cell_header} ${can_messages} ${j1939_messages})  # the cell says which model
target_include_directories(application PRIVATE ${CMAKE_BINARY_DIR}/generated)
target_compile_definitions(application PRIVATE ${vehicle_profile_${BMS_VEHICLE_PROFILE}})
bms_objects(estimator_step -O2 ${CMAKE_SOURCE_DIR}/firmware/estimator_step.cpp ${cell_header} ${can_messages})
target_include_directories(estimator_step PRIVATE ${CMAKE_BINARY_DIR}/generated)
math(EXPR version "${PROJECT_VERSION_MAJOR} * 65536 + ${PROJECT_VERSION_MINOR} * 256 + ${PROJECT_VERSION_PATCH}" OUTPUT_FORMAT HEXADECIMAL)
target_compile_definitions(estimator_step PRIVATE BMS_VERSION=${version})

set(linker_script ${BMS_LINKER_SCRIPT})
# bms_image(NAME OBJECTS...); of functions that several of them hold, the linker takes the first: the step's, which are made for speed
function(bms_image name)
  list(TRANSFORM ARGN PREPEND "$<TARGET_OBJECTS:" OUTPUT_VARIABLE objects)
  list(TRANSFORM objects APPEND ">")
  add_executable(${name} ${objects})
  target_link_options(${name} PRIVATE -T${linker_script} -Wl,--undefined=image_cell_hash -Wl,-Map=${CMAKE_BINARY_DIR}/${name}.map)
  add_custom_command(TARGET ${name} POST_BUILD
    COMMAND ${BMS_PYTHON} ${CMAKE_SOURCE_DIR}/cmake/image_check.py $<TARGET_FILE:${name}>
    COMMAND ${BMS_PYTHON} ${CMAKE_SOURCE_DIR}/cmake/sbom.py ${name} ${PROJECT_VERSION} ${CMAKE_CXX_COMPILER} ${cell_source} ${CMAKE_BINARY_DIR}/${name}.map ${CMAKE_BINARY_DIR}/${name}.elf
    BYPRODUCTS ${CMAKE_BINARY_DIR}/${name}.cdx.json VERBATIM)
  set_target_properties(${name} PROPERTIES LINK_DEPENDS "${linker_script};${core}/sections.ld" RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR})
endfunction()

if(NOT BMS_EMULATED)
  bms_image(bms_${BMS_BOARD} hal_core hal_clock hal_chip hal_board hal_samples estimator_step storage application)
  bms_image(bms_${BMS_BOARD}_remote hal_core hal_clock hal_chip hal_board hal_remote_samples estimator_step storage application)
  foreach(image bms_${BMS_BOARD} bms_${BMS_BOARD}_remote)
    target_link_options(${image} PRIVATE -Wl,--undefined=_ZN3bms3hal10can_healthEv)  # for a debugger, and tests/firmware
  endforeach()
  set(linker_script ${CMAKE_SOURCE_DIR}/boards/${BMS_LOOP_BOARD}/memory.ld)  # the memory of an emulated board with the same chip
  bms_image(bms_${BMS_BOARD}_hil hal_core hal_emulated hal_hil estimator_step storage application)
  return()
endif()
bms_image(bms_${BMS_BOARD} hal_core hal_clock hal_emulated hal_emulated_flash hal_board hal_samples estimator_step storage application)
bms_image(bms_${BMS_BOARD}_replay hal_core hal_clock hal_emulated hal_stream estimator_step storage application)
bms_image(bms_${BMS_BOARD}_hil hal_core hal_emulated hal_hil estimator_step storage application)
bms_image(bms_${BMS_BOARD}_bench hal_core hal_clock hal_chip hal_board hal_samples estimator_step storage application)

bms_objects(fault_image -Os ${CMAKE_SOURCE_DIR}/tests/firmware/fault_image.cpp)
bms_image(bms_${BMS_BOARD}_fault hal_core hal_clock hal_emulated fault_image)
bms_objects(pack_image -O2 ${CMAKE_SOURCE_DIR}/tests/firmware/pack_image.cpp ${cell_header})
target_include_directories(pack_image PRIVATE ${CMAKE_BINARY_DIR}/generated)
bms_image(bms_${BMS_BOARD}_pack hal_core hal_clock hal_emulated pack_image)
bms_objects(protection_image -O2 ${CMAKE_SOURCE_DIR}/tests/firmware/protection_image.cpp)
bms_image(bms_${BMS_BOARD}_protection hal_core hal_clock hal_emulated protection_image)
set_target_properties(protection_image bms_${BMS_BOARD}_protection PROPERTIES EXCLUDE_FROM_ALL ON)
set_target_properties(fault_image bms_${BMS_BOARD}_fault pack_image bms_${BMS_BOARD}_pack PROPERTIES EXCLUDE_FROM_ALL ON)
