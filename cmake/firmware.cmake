# Firmware images of one board (BMS_BOARD) with one cell (BMS_CELL).
#
#   bms_<board>.elf             the application, for the chip; of an emulated board for QEMU
#   bms_<board>_remote.elf      the application; another node measures and sends the samples over CAN
#   bms_<board>_replay.elf      the application; samples and estimates stream through files of the emulator
#   bms_<board>_hil.elf         the application in lock step with a host program; its bus is a pair of files
#   bms_<board>_bench.elf       the application of an emulated board for the chip: with clock tree, ends in a reset
#   bms_<board>_fault.elf       tests/firmware/fault_image.cpp, built on request
#   bms_<board>_pack.elf        tests/firmware/pack_image.cpp, built on request
#   bms_<board>_filter_forms.elf  tests/firmware/filter_forms_image.cpp, built on request, needs Eigen
#   bms_<board>_protection.elf  tests/firmware/protection_image.cpp, built on request
#   bms_<board>_loader.elf      the boot loader (loader.cmake), built on request
#   bms_<board>_remote_product.elf  the remote image as BMS_PRODUCTION=ON builds it, built on request
#
# A board that QEMU emulates (BMS_EMULATED ON) has all but the remote image. Another board has the first two, and the
# hil image for an emulated board with the same chip (BMS_LOOP_BOARD). Next to each image lies its bill of materials,
# bms_<board>*.cdx.json (sbom.py), and for a board with a BQ76952 what this chip does by itself, as the image sets it,
# bms_<board>*.second_line.md (second_line_table.py).
#
# board.cmake chooses the CAN back end and the source of the samples:
#   BMS_CAN        slcan, or bxcan
#   BMS_CAN_BIT_RATE, BMS_CAN_BASE, BMS_CAN_STOP  of bxcan: bit rate, identifiers of the first message and of Stop; also
#                  as -DBMS_CAN_BIT_RATE=R
#   BMS_CHARGER_BUS, BMS_CHARGER_BIT_RATE  can1: the charger is on the truck's bus; can2: on a bus of its own, with this
#                  bit rate (hal/charger_bus.hpp). Also as -DBMS_CHARGER_BUS=can2
#   BMS_PARALLEL   ON: one of two to four batteries at a DC link; CAN2 is the bus between them (firmware/parallel/). The
#                  chip does not stop between samples then. Also as -DBMS_PARALLEL=ON
#   BMS_PARAMETERS  true: parameters that a workshop sets over CAN (firmware/parameters/)
#   BMS_SAMPLES    bq76952 (a chip on the board), adc (the controller), remote (another node), emulated
#   BMS_DC_LINK    false: a single switch without a measured DC link and without precharge
#   BMS_PRECHARGE_S, BMS_CLOSING_A, BMS_CLOSING_OHM  of the truck, see boards/README.md; also as -DBMS_PRECHARGE_S=S
#   BMS_AUXILIARY_CONTACTS  of the main contactors: stm32f4 (PB14, PB15), or absent
#   BMS_INPUTS, BMS_OUTPUTS  of the truck: words of "key charger_plug coil_supply interlock crash" and of
#                  "heater fan soc_lamp"; also as -DBMS_INPUTS="coil_supply;crash"
#   BMS_INSULATION  monitor: absent, pwm (PA6) or iso175 (CAN)
#   BMS_SECOND_CURRENT  hall (PA1), or absent
#   BMS_SLEEPS     true: the chip of a parked battery stops between the samples (hal/sleep.hpp)
#   BMS_SWITCHES_OFF  true: an empty battery that nobody uses, or one of a workshop's command, switches itself off
#                  (firmware/shelf.hpp); needs the input key, and the wiring of the board's page, or nothing wakes it
#   BMS_CLOSES_BY_INPUTS  true: key and charger plug close the contactors without authority (docs/safety/threats.md)
#
# BMS_VEHICLE_PROFILE adds messages for other makers' devices (firmware/can/messages.md): cia418 for a CANopen charger,
# with the nodes BMS_CANOPEN_NODE and BMS_CANOPEN_CHARGER; elcon for a charger of 0x1806E5F4; or j1939.
#
# BMS_PRODUCTION=ON builds images for a product: without a device key, or with the one for development, no contactor
# closes and no service session opens (docs/safety/commands.md).
#
# BMS_CELLS is the number of cells in series: that of board.cmake, or another one within the range that board.cmake
# states, as -DBMS_CELLS=N.
#
# Whatever does not depend on the cell is compiled once for all images of this build. Builds of the same board with
# other cells link it from there: -DBMS_SHARED_OBJECTS=FOLDER, a build with the same options, in which target
# IMAGE_shared compiles what an image takes, and bms_<board>_update_shared what one in a slot takes besides.
set(root ${PROJECT_SOURCE_DIR})
set(build ${PROJECT_BINARY_DIR})
set(of_pack_and_truck CELLS BLEED_OHM PRECHARGE_S CLOSING_A CLOSING_OHM CAN_BIT_RATE CAN_BASE CAN_STOP
  CHARGER_BIT_RATE)
set(of_inputs CHARGER_BUS PARALLEL INPUTS OUTPUTS INSULATION SECOND_CURRENT CLOSES_BY_INPUTS SLEEPS SWITCHES_OFF)
foreach(value ${of_pack_and_truck} ${of_inputs})
  if(DEFINED BMS_${value})
    set(wanted_${value} "${BMS_${value}}")  # OFF and an empty list are wishes, too
  endif()
endforeach()
include(${root}/boards/${BMS_BOARD}/board.cmake)
foreach(value ${of_pack_and_truck} ${of_inputs})
  if(DEFINED wanted_${value})
    set(BMS_${value} "${wanted_${value}}")
  endif()
endforeach()
foreach(value INSULATION SECOND_CURRENT)
  if(NOT BMS_${value})
    set(BMS_${value} absent)
  endif()
endforeach()
set(closes_by_inputs false)
if(BMS_CLOSES_BY_INPUTS)
  set(closes_by_inputs true)
endif()
set(second_current_possible true)
if(BMS_SECOND_CURRENT STREQUAL "absent")
  set(second_current_possible false)
endif()
list(REMOVE_ITEM BMS_INPUTS none)
list(REMOVE_ITEM BMS_OUTPUTS none)
set(may_stop false)
if(BMS_SLEEPS AND NOT BMS_PARALLEL AND BMS_SAMPLES STREQUAL "bq76952")
  set(may_stop true)
endif()
set(switches_off false)
if(BMS_SWITCHES_OFF)
  if(NOT may_stop OR NOT "key" IN_LIST BMS_INPUTS)
    message(FATAL_ERROR "BMS_SWITCHES_OFF needs BMS_SAMPLES bq76952, BMS_SLEEPS and key among BMS_INPUTS, and no "
      "BMS_PARALLEL: without a key that is read, a battery that is being used switches itself off")
  endif()
  set(switches_off true)
endif()
set(truck_side false)
if(BMS_INPUTS OR second_current_possible OR NOT BMS_INSULATION STREQUAL "absent")
  set(truck_side true)
endif()
bms_bits(input_bits BMS_INPUTS "key;charger_plug;coil_supply;interlock;crash" "${BMS_INPUTS}")
bms_bits(output_bits BMS_OUTPUTS "heater;fan;soc_lamp" "${BMS_OUTPUTS}")
set(of_truck)
foreach(value ${of_pack_and_truck})
  if(NOT "${BMS_${value}}" STREQUAL "")
    list(APPEND of_truck ${value} ${BMS_${value}})
  endif()
endforeach()
if(NOT BMS_CELLS MATCHES "^[0-9]+$" OR BMS_CELLS LESS BMS_FEWEST_CELLS OR BMS_CELLS GREATER BMS_MOST_CELLS)
  message(FATAL_ERROR "BMS_CELLS is ${BMS_CELLS}, but the board ${BMS_BOARD} measures from ${BMS_FEWEST_CELLS} to "
    "${BMS_MOST_CELLS} cells in series. More than 16 cells need two monitoring chips: boards/stm32f405_80v")
endif()
include(${root}/hal/${BMS_CHIP}/chip.cmake)  # compiler flags, core, flash, what QEMU replaces
if(NOT BMS_CELL)
  set(BMS_CELL ${BMS_DEFAULT_CELL})
endif()

set(BMS_VEHICLE_PROFILE none CACHE STRING
  "additional messages: none, cia418, j1939 or elcon (firmware/can/messages.md)")
set(BMS_CANOPEN_NODE 1 CACHE STRING "CANopen node of the battery")
set(BMS_CANOPEN_CHARGER 10 CACHE STRING "CANopen node of the charger")
if(NOT BMS_VEHICLE_PROFILE MATCHES "^(none|cia418|j1939|elcon)$")
  message(FATAL_ERROR "BMS_VEHICLE_PROFILE is ${BMS_VEHICLE_PROFILE}, expected none, cia418, j1939 or elcon")
endif()
set(charger_bus false)
if(BMS_CHARGER_BUS STREQUAL "can2")
  if(NOT BMS_CAN STREQUAL "bxcan" OR NOT BMS_VEHICLE_PROFILE MATCHES "^(cia418|elcon)$")
    message(FATAL_ERROR "BMS_CHARGER_BUS is can2, which needs BMS_CAN bxcan and BMS_VEHICLE_PROFILE cia418 or elcon: "
      "no other profile has a charger that asks for a charge")
  endif()
  set(charger_bus true)
  set(truck_side true)  # its state is in TruckInputs
elseif(BMS_CHARGER_BUS AND NOT BMS_CHARGER_BUS STREQUAL "can1")
  message(FATAL_ERROR "BMS_CHARGER_BUS is ${BMS_CHARGER_BUS}, expected can1 or can2")
endif()
set(group_bus false)
if(BMS_PARALLEL)
  if(NOT BMS_CAN STREQUAL "bxcan" OR NOT BMS_PARAMETERS OR charger_bus OR BMS_VEHICLE_PROFILE STREQUAL "j1939")
    message(FATAL_ERROR "BMS_PARALLEL needs BMS_CAN bxcan, BMS_PARAMETERS, BMS_CHARGER_BUS can1 and "
      "BMS_VEHICLE_PROFILE none, elcon or cia418: the messages of j1939 speak for one battery")
  endif()
  set(group_bus true)
endif()
option(BMS_PRODUCTION "an image for a product: nothing works without a device key of its own" OFF)
if(NOT BMS_CURRENT_RANGE_A)
  set(BMS_CURRENT_RANGE_A 2147)  # the end of the range of a reading
endif()
set(fixed_point false)
if(BMS_SCALAR_DEFINITION MATCHES BMS_FIXED_POINT)
  set(fixed_point true)
endif()
if(NOT DEFINED BMS_DC_LINK)
  set(BMS_DC_LINK true)
endif()
if(NOT DEFINED BMS_PARAMETERS)
  set(BMS_PARAMETERS false)
endif()
set(truck_stated false)
if(DEFINED BMS_PRECHARGE_S OR DEFINED BMS_CLOSING_A OR DEFINED BMS_CLOSING_OHM)
  set(truck_stated true)
endif()
bms_board_config(bms_board ${build}/generated SOURCE boards/${BMS_BOARD}/board.cmake
  ${of_truck} SAMPLE_PERIOD_S ${BMS_SAMPLE_PERIOD_S} CURRENT_RANGE_A ${BMS_CURRENT_RANGE_A}
  FIXED_POINT ${fixed_point} DC_LINK ${BMS_DC_LINK} TRUCK_STATED ${truck_stated}
  VEHICLE_PROFILE ${BMS_VEHICLE_PROFILE} CANOPEN_NODE ${BMS_CANOPEN_NODE} CANOPEN_CHARGER ${BMS_CANOPEN_CHARGER}
  CHARGER_BUS ${charger_bus} PARALLEL ${group_bus} PARAMETERS ${BMS_PARAMETERS}
  INPUTS ${input_bits} OUTPUTS ${output_bits} INSULATION ${BMS_INSULATION}
  CLOSES_BY_INPUTS ${closes_by_inputs} SECOND_CURRENT ${second_current_possible} TRUCK_SIDE ${truck_side})

# The header generator runs on the host. Without BMS_CELL_HEADER_TOOL it is built here.
set(BMS_CELL_HEADER_TOOL "" CACHE FILEPATH "cell_header of a host build; empty: build it")
set(cell_header_tool ${BMS_CELL_HEADER_TOOL})
if(NOT cell_header_tool)
  include(ExternalProject)
  set(generators ${build}/generators)
  ExternalProject_Add(generators
    SOURCE_DIR ${root}
    BINARY_DIR ${generators}
    CMAKE_ARGS -DBMS_GENERATORS_ONLY=ON -DBMS_TESTS=OFF
    BUILD_ALWAYS ON
    INSTALL_COMMAND ""
    BUILD_BYPRODUCTS ${generators}/files/cell_header)
  set(cell_header_tool ${generators}/files/cell_header)
endif()

set(cell_header ${build}/generated/cell_constants.hpp)
file(MAKE_DIRECTORY ${build}/generated)
set(cell_file "")
if(EXISTS ${BMS_CELL})
  set(cell_file ${BMS_CELL})
endif()
set(cell_source ${root}/model/cells/${BMS_CELL}.toml)
if(cell_file)
  set(cell_source ${cell_file})
endif()
set(cell_header_scalar "")
if(fixed_point)
  set(cell_header_scalar fixed)
elseif(BMS_PARALLEL)
  set(cell_header_scalar aged)
endif()
add_custom_command(OUTPUT ${cell_header}
  COMMAND ${cell_header_tool} ${BMS_CELL} ${cell_header} ${cell_header_scalar}
  DEPENDS ${cell_header_tool} ${cell_file}
  COMMENT "Cell ${BMS_CELL}" VERBATIM)

# The image has the same bytes in every folder, so paths are mapped to relative ones. GCC tries the last map first.
set(path_maps -ffile-prefix-map=${root}=. -ffile-prefix-map=${build}=build)
set(no_runtime -fno-exceptions -fno-rtti -fno-threadsafe-statics -fno-use-cxa-atexit)
list(TRANSFORM no_runtime PREPEND "$<$<COMPILE_LANGUAGE:CXX>:")
list(TRANSFORM no_runtime APPEND ">")
add_compile_options(${BMS_CPU_FLAGS} -g -ffunction-sections -fdata-sections -fno-common -fstack-usage ${no_runtime}
  -Wsign-conversion -Wdouble-promotion -Wfloat-conversion ${path_maps})
add_link_options(${BMS_CPU_FLAGS} -nostartfiles --specs=nano.specs --specs=nosys.specs -L${root}/hal/cortex_m
  -Wl,--gc-sections,--no-warn-rwx-segments,--fatal-warnings)

include(${root}/cmake/can_messages.cmake)

if(BMS_CELLS LESS_EQUAL 24)
  add_compile_definitions(BMS_STORED_CELLS=24)
endif()
if(NOT group_bus)
  add_compile_definitions(BMS_WITHOUT_GROUP)
endif()

# bms_objects(NAME OPTIMISATION SOURCE...)
function(bms_objects name optimisation)
  add_library(${name} OBJECT ${ARGN})
  target_link_libraries(${name} PUBLIC bms_estimator bms_board bms_can)
  target_compile_options(${name} PRIVATE ${optimisation})
endfunction()

set(BMS_SHARED_OBJECTS "" CACHE PATH "build of this board whose objects are linked if no cell decides on them")
set(shared_objects "")
# bms_import_objects(NAME): NAME as the other build has compiled it
function(bms_import_objects name)
  set(list ${BMS_SHARED_OBJECTS}/${name}.objects)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${list})
  file(STRINGS ${list} objects)
  add_library(${name} OBJECT IMPORTED)
  set_target_properties(${name} PROPERTIES IMPORTED_OBJECTS "${objects}")
endfunction()
# bms_list_objects(NAME): NAME.objects lists them for others
function(bms_list_objects name)
  file(GENERATE OUTPUT ${build}/${name}.objects CONTENT "$<JOIN:$<TARGET_OBJECTS:${name}>,\n>\n")
endfunction()
# bms_shared_objects(NAME OPTIMISATION SOURCE...): no source depends on the cell
function(bms_shared_objects name optimisation)
  if(BMS_SHARED_OBJECTS)
    bms_import_objects(${name})
  else()
    bms_objects(${name} ${optimisation} ${ARGN})
    bms_list_objects(${name})
    set(shared_objects ${shared_objects} ${name} PARENT_SCOPE)
  endif()
endfunction()

set(hal ${root}/hal)
set(chip ${hal}/${BMS_CHIP})
set(core ${hal}/cortex_m)
set(absent_hal ${hal}/absent)
list(TRANSFORM BMS_REPLACED_IN_EMULATION APPEND .cpp OUTPUT_VARIABLE replaced)
list(TRANSFORM replaced PREPEND ${chip}/ OUTPUT_VARIABLE on_the_chip)
list(TRANSFORM replaced PREPEND ${hal}/emulated/ OUTPUT_VARIABLE in_emulation)
set(chip_flash ${hal}/${BMS_FLASH}/flash.cpp)  # BMS_FLASH: folder of the chip, or absent
set(emulated_flash ${hal}/emulated/flash.cpp)
if(BMS_FLASH STREQUAL "absent")
  set(emulated_flash ${chip_flash})
endif()
# A chip without one of these files gets the absent back end.
set(chip_calendar ${absent_hal}/calendar.cpp)
set(chip_state ${absent_hal}/board_state.cpp ${absent_hal}/supply.cpp)
if(EXISTS ${chip}/board_state.cpp)
  set(chip_calendar ${chip}/calendar.cpp)
  set(chip_state ${chip}/board_state.cpp ${chip}/supply.cpp ${core}/image_check.cpp)
endif()
set(chip_secrets ${absent_hal}/device_key.cpp ${absent_hal}/random.cpp)
if(EXISTS ${chip}/device_key.cpp)
  set(chip_secrets ${chip}/device_key.cpp ${chip}/random.cpp)
endif()
bms_shared_objects(hal_core -Os ${core}/startup.cpp ${core}/stack.cpp ${core}/fault_record.cpp ${core}/retained.cpp
  ${core}/${BMS_CORE}.cpp ${chip}/vectors.cpp ${chip}/power.cpp)
bms_shared_objects(hal_clock -Os ${chip}/clock.cpp)
bms_shared_objects(hal_chip -Os ${core}/finish.cpp ${on_the_chip} ${chip_flash} ${chip_calendar}
  ${chip_secrets})
bms_shared_objects(hal_emulated -Os ${hal}/emulated/semihosting.cpp ${in_emulation} ${absent_hal}/device_key.cpp
  ${absent_hal}/random.cpp)
bms_shared_objects(development_image -Os ${hal}/image_kind/development.cpp)
bms_shared_objects(product_image -Os ${hal}/image_kind/product.cpp)
set(image_kind development_image)
if(BMS_PRODUCTION)
  set(image_kind product_image)
endif()
# Back ends by BMS_CAN and BMS_SAMPLES.
set(auxiliary_contacts ${absent_hal}/auxiliary_contacts.cpp)
if(DEFINED BMS_AUXILIARY_CONTACTS)
  set(auxiliary_contacts ${hal}/${BMS_AUXILIARY_CONTACTS}/auxiliary_contacts.cpp)
endif()
set(truck_pins ${absent_hal}/truck_inputs.cpp)
if(BMS_INPUTS OR BMS_OUTPUTS)
  set(truck_pins ${chip}/truck_pins.cpp)
endif()
set(insulation ${absent_hal}/insulation.cpp)
if(BMS_INSULATION STREQUAL "pwm")
  set(insulation ${chip}/insulation_pwm.cpp)
endif()
set(second_current ${absent_hal}/second_current.cpp)
if(BMS_SECOND_CURRENT STREQUAL "hall")
  set(second_current ${hal}/adc/second_current.cpp)
endif()
set(no_truck ${absent_hal}/truck_inputs.cpp ${absent_hal}/insulation.cpp)
set(can_slcan ${hal}/slcan/can.cpp ${chip}/uart.cpp)
set(can_bxcan ${chip}/bxcan.cpp)
set(no_chain ${absent_hal}/calibration.cpp ${absent_hal}/second_line.cpp ${absent_hal}/auxiliary_contacts.cpp
  ${absent_hal}/second_current.cpp ${no_truck})  # for a board without a measuring chain
set(samples_emulated ${hal}/emulated/samples_can.cpp ${hal}/frame_dispatch.cpp ${no_chain})
set(samples_remote ${hal}/remote/samples.cpp ${absent_hal}/sleep.cpp ${hal}/frame_dispatch.cpp ${no_chain})
set(samples_adc ${hal}/adc/samples.cpp ${hal}/frame_dispatch.cpp ${chip}/adc.cpp ${chip}/contactor_pins.cpp
  ${absent_hal}/second_line.cpp ${absent_hal}/auxiliary_contacts.cpp ${absent_hal}/second_current.cpp ${no_truck})
# The settings of the chip's own protections follow the cell file; what stands around them is shared.
set(front_end_bq76952 ${hal}/bq76952/samples.cpp ${hal}/frame_dispatch.cpp ${hal}/bq76952/front_end.cpp
  ${hal}/bq76952/second_line.cpp ${hal}/bq76952/wire.cpp)
set(samples_bq76952 ${chip}/i2c.cpp ${chip}/sleep.cpp ${chip}/contactor_pins.cpp ${hal}/adc/dc_link.cpp ${chip}/adc.cpp
  ${auxiliary_contacts} ${second_current} ${truck_pins} ${insulation})
# More than 16 cells have two chips, each on a bus of its own.
set(isolated_bus "")
if(BMS_SAMPLES STREQUAL "bq76952" AND BMS_CELLS GREATER 16)
  list(APPEND samples_bq76952 ${hal}/bq76952/stack.cpp)
  set(isolated_bus hal_isolated_bus)
  bms_shared_objects(hal_isolated_bus -Os ${chip}/i2c.cpp)
  if(NOT BMS_SHARED_OBJECTS)
    target_compile_definitions(hal_isolated_bus PRIVATE BMS_ISOLATED_BUS)
  endif()
endif()
# The charger's own bus, or that between batteries: the same driver on a second controller.
set(second_can "")
set(no_second_can "")
set(second_bus "")
if(charger_bus)
  set(second_bus charger_bus)
elseif(group_bus)
  set(second_bus group_bus)
endif()
if(second_bus)
  set(second_can hal_${second_bus})
  bms_shared_objects(hal_${second_bus} -Os ${chip}/bxcan.cpp)
  if(NOT BMS_SHARED_OBJECTS)
    string(TOUPPER BMS_${second_bus} which)
    target_compile_definitions(hal_${second_bus} PRIVATE ${which})
  endif()
  set(no_second_can ${absent_hal}/${second_bus}.cpp)
endif()
bms_shared_objects(hal_board -Os ${can_${BMS_CAN}} ${chip}/watchdog.cpp ${chip_state} ${absent_hal}/estimate_record.cpp)
bms_shared_objects(hal_remote_samples -Os ${samples_remote})
if(BMS_SAMPLES MATCHES "^(bq76952|adc)$")  # the board measures itself
  list(APPEND samples_${BMS_SAMPLES} ${absent_hal}/starting_point.cpp)
endif()
set(samples hal_samples)
if(BMS_SAMPLES STREQUAL "bq76952")
  bms_shared_objects(hal_front_end -Os ${front_end_bq76952})
  bms_objects(front_end_settings -Os ${root}/firmware/front_end/settings.cpp ${cell_header})
  set(samples hal_front_end front_end_settings hal_samples)
endif()
bms_shared_objects(hal_samples -Os ${samples_${BMS_SAMPLES}})
bms_shared_objects(hal_emulated_flash -Os ${emulated_flash} ${hal}/emulated/calendar.cpp)
set(no_hardware watchdog flash calendar board_state supply)
list(TRANSFORM no_hardware PREPEND ${absent_hal}/)
list(TRANSFORM no_hardware APPEND .cpp)
bms_shared_objects(hal_stream -O2 ${hal}/emulated/samples_stream.cpp ${absent_hal}/can.cpp ${absent_hal}/power_path.cpp
  ${absent_hal}/requests.cpp ${no_hardware} ${no_chain})
bms_shared_objects(hal_hil -Os ${hal}/emulated/can_pipe.cpp ${samples_remote} ${absent_hal}/estimate_record.cpp
  ${no_hardware} ${no_second_can})
bms_shared_objects(storage -Os ${root}/firmware/storage/log.cpp ${root}/firmware/storage/persistence.cpp)
if(NOT BMS_SHARED_OBJECTS)
  target_compile_definitions(hal_stream PRIVATE BMS_STREAM_BLOCK=${BMS_STREAM_BLOCK})
endif()

# The cell file decides which model these compile.
set(generated_headers ${cell_header} ${can_messages} ${j1939_messages})
set(parameters "")
if(BMS_PARAMETERS)
  set(parameters ${root}/firmware/board_parameters.cpp)
endif()
# BMS_SLOT=a or b: the application is linked for a slot of the boot loader (firmware/boot/flash_map.hpp), behind the
# header of its container, and receives updates. BMS_SLOT=a;b: for both, as IMAGE_slot_a and IMAGE_slot_b, compiled
# once. Without it the image starts by itself at every reset.
set(BMS_SLOT "" CACHE STRING "slot of the boot loader: a, b or both (a;b); empty: an image without a loader")
set(updates "")
set(in_slot false)
set(step_of_update "")
if(BMS_SLOT)
  set(in_slot true)
  set(updates ${root}/firmware/update_service.cpp ${root}/firmware/cell_of_update.cpp)
  set(step_of_update ${root}/firmware/step_of_update.cpp)
endif()
bms_objects(application -Os ${root}/firmware/main.cpp ${root}/firmware/board_cell.cpp ${parameters} ${updates}
  ${generated_headers})
bms_objects(estimator_step -O2 ${root}/firmware/estimator_step.cpp ${step_of_update} ${generated_headers})
foreach(objects application estimator_step)
  target_compile_definitions(${objects} PRIVATE BMS_IN_SLOT=${in_slot} BMS_MAY_STOP=${may_stop}
    BMS_SWITCHES_OFF=${switches_off} BMS_BOARD="${BMS_BOARD}")
endforeach()
math(EXPR version "(${PROJECT_VERSION_MAJOR} << 16) + (${PROJECT_VERSION_MINOR} << 8) + ${PROJECT_VERSION_PATCH}"
  OUTPUT_FORMAT HEXADECIMAL)
target_compile_definitions(estimator_step PRIVATE BMS_VERSION=${version})

# bms_image(NAME OBJECTS...)
# The linker uses the first copy of a function that several objects have: estimator_step, compiled for speed, comes
# before the objects compiled for size.
set(linker_script ${BMS_LINKER_SCRIPT})
if(BMS_SLOT)
  set(slot_a 0x08020800)
  set(slot_b 0x08060800)
  file(READ ${BMS_LINKER_SCRIPT} script)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${BMS_LINKER_SCRIPT})
  foreach(slot ${BMS_SLOT})
    if(NOT DEFINED slot_${slot} OR NOT BMS_CHIP STREQUAL stm32f4)
      message(FATAL_ERROR "BMS_SLOT is ${BMS_SLOT}, expected a, b or a;b, of a board with an STM32F405")
    endif()
    string(REGEX REPLACE "VECTORS \\(rx\\)[^\n]*" "VECTORS (rx) : ORIGIN = ${slot_${slot}}, LENGTH = 2K" of_slot
      "${script}")
    string(REGEX REPLACE "FLASH \\(rx\\)[^\n]*" "FLASH (rx) : ORIGIN = ${slot_${slot}} + 2K, LENGTH = 222K" of_slot
      "${of_slot}")
    file(CONFIGURE OUTPUT ${build}/slot_${slot}.ld CONTENT "${of_slot}" @ONLY)
  endforeach()
  add_link_options(-Wl,-z,max-page-size=0x800)  # otherwise the header of the ELF file is loaded before the vectors
endif()
function(bms_image name)
  add_custom_target(${name}_shared)
  foreach(objects ${ARGN})
    if(objects IN_LIST shared_objects)
      add_dependencies(${name}_shared ${objects})
    endif()
  endforeach()
  list(TRANSFORM ARGN PREPEND "$<TARGET_OBJECTS:" OUTPUT_VARIABLE objects)
  list(TRANSFORM objects APPEND ">")
  add_executable(${name} ${objects})
  target_link_options(${name} PRIVATE
    -T${linker_script} -Wl,--undefined=image_cell_hash -Wl,-Map=${build}/${name}.map)
  add_custom_command(TARGET ${name} POST_BUILD
    COMMAND ${BMS_PYTHON} ${root}/cmake/image_check.py $<TARGET_FILE:${name}>
    COMMAND ${BMS_PYTHON} ${root}/cmake/sbom.py ${name} ${PROJECT_VERSION} ${CMAKE_CXX_COMPILER} ${cell_source}
      ${build}/${name}.map ${build}/${name}.elf
    COMMAND ${BMS_PYTHON} ${root}/cmake/second_line_table.py ${build}/${name}.elf ${build}/${name}.second_line.md
    BYPRODUCTS ${build}/${name}.cdx.json VERBATIM)
  set_target_properties(${name} PROPERTIES
    LINK_DEPENDS "${linker_script};${core}/sections.ld" RUNTIME_OUTPUT_DIRECTORY ${build})
endfunction()

if(BMS_CHIP STREQUAL stm32f4)
  include(${root}/cmake/loader.cmake)
endif()
set(on_chip hal_core hal_clock hal_chip hal_board)
set(program estimator_step storage application)
set(portable ${program} ${image_kind})
# bms_applications(ENDING): the application; of a board with a chip also the one that is fed over CAN
function(bms_applications ending)
  if(BMS_EMULATED)
    bms_image(bms_${BMS_BOARD}${ending} hal_core hal_clock hal_emulated hal_emulated_flash hal_board ${samples}
      ${portable} ${of_a_slot})
  else()
    bms_image(bms_${BMS_BOARD}${ending} ${on_chip} ${second_can} ${samples} ${isolated_bus} ${portable}
      ${of_a_slot})
    bms_image(bms_${BMS_BOARD}_remote${ending} ${on_chip} ${second_can} hal_remote_samples ${portable} ${of_a_slot})
  endif()
endfunction()
if(BMS_SLOT)
  list(LENGTH BMS_SLOT slots)
  foreach(slot ${BMS_SLOT})
    set(linker_script ${build}/slot_${slot}.ld)
    if(slots EQUAL 1)
      bms_applications("")
    else()
      bms_applications(_slot_${slot})
    endif()
  endforeach()
  return()
endif()
bms_applications("")
if(NOT BMS_EMULATED)
  bms_image(bms_${BMS_BOARD}_remote_product ${on_chip} ${second_can} hal_remote_samples ${program} product_image)
  set_target_properties(bms_${BMS_BOARD}_remote_product PROPERTIES EXCLUDE_FROM_ALL ON)
  foreach(image bms_${BMS_BOARD} bms_${BMS_BOARD}_remote bms_${BMS_BOARD}_remote_product)
    # can_health() is called by debuggers and by tests/firmware
    target_link_options(${image} PRIVATE -Wl,--undefined=_ZN3bms3hal10can_healthEv)
    if(charger_bus)
      target_link_options(${image} PRIVATE -Wl,--undefined=_ZN3bms3hal18charger_can_healthEv)
    elseif(group_bus)
      target_link_options(${image} PRIVATE -Wl,--undefined=_ZN3bms3hal16group_can_healthEv)
    endif()
  endforeach()
  set(linker_script ${root}/boards/${BMS_LOOP_BOARD}/memory.ld)
  bms_image(bms_${BMS_BOARD}_hil hal_core hal_emulated hal_hil ${portable})
  return()
endif()
bms_image(bms_${BMS_BOARD}_replay hal_core hal_clock hal_emulated hal_stream ${portable})
bms_image(bms_${BMS_BOARD}_hil hal_core hal_emulated hal_hil ${portable})
bms_image(bms_${BMS_BOARD}_bench ${on_chip} ${samples} ${portable})

# bms_test_image(NAME OPTIMISATION SOURCE...): NAME_image.cpp of tests/firmware as the image bms_<board>_NAME
function(bms_test_image name optimisation)
  bms_objects(${name}_image ${optimisation} ${root}/tests/firmware/${name}_image.cpp ${ARGN})
  bms_image(bms_${BMS_BOARD}_${name} hal_core hal_clock hal_emulated ${name}_image)
  set_target_properties(${name}_image bms_${BMS_BOARD}_${name} PROPERTIES EXCLUDE_FROM_ALL ON)
endfunction()
bms_test_image(fault -Os)
bms_test_image(pack -O2 ${cell_header})
bms_test_image(protection -O2)
find_path(BMS_EIGEN Eigen/Core PATHS /usr/include/eigen3 NO_CMAKE_FIND_ROOT_PATH)
if(BMS_EIGEN)
  bms_test_image(filter_forms -O2 ${cell_header})
  target_include_directories(filter_forms_image SYSTEM PRIVATE ${BMS_EIGEN})
endif()
