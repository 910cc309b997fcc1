# Firmware images of one board (BMS_BOARD) with one cell (BMS_CELL):
#
#   bms_<board>.elf          the application; telemetry and samples as SLCAN text on the UART
#   bms_<board>_replay.elf   the same application; samples and estimates stream through the emulator's files
#
# What does not depend on the cell is compiled once for both.
include(${CMAKE_SOURCE_DIR}/boards/${BMS_BOARD}/board.cmake)
if(NOT BMS_CELL)
  set(BMS_CELL ${BMS_DEFAULT_CELL})
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
    BUILD_BYPRODUCTS ${generators}/host_sim/cell_header)
  set(cell_header_tool ${generators}/host_sim/cell_header)
endif()

set(cell_header ${CMAKE_BINARY_DIR}/generated/cell_constants.hpp)
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/generated)
set(cell_file "")
if(EXISTS ${BMS_CELL})
  set(cell_file ${BMS_CELL})
endif()
add_custom_command(OUTPUT ${cell_header}
  COMMAND ${cell_header_tool} ${BMS_CELL} ${cell_header}
  DEPENDS ${cell_header_tool} ${cell_file}
  COMMENT "Cell ${BMS_CELL}" VERBATIM)

add_compile_options(${BMS_CPU_FLAGS} -O2 -g -ffunction-sections -fdata-sections -fno-common -fstack-usage
  $<$<COMPILE_LANGUAGE:CXX>:-fno-exceptions> $<$<COMPILE_LANGUAGE:CXX>:-fno-rtti> $<$<COMPILE_LANGUAGE:CXX>:-fno-threadsafe-statics> $<$<COMPILE_LANGUAGE:CXX>:-fno-use-cxa-atexit>
  -Wsign-conversion -Wdouble-promotion -Wfloat-conversion)
add_link_options(${BMS_CPU_FLAGS} -nostartfiles --specs=nano.specs --specs=nosys.specs -T${BMS_LINKER_SCRIPT}
  -Wl,--gc-sections,--no-warn-rwx-segments,--fatal-warnings)

set(chip ${CMAKE_SOURCE_DIR}/hal/${BMS_CHIP})
set(emulated ${CMAKE_SOURCE_DIR}/hal/emulated)
add_library(hal_core OBJECT ${chip}/startup.cpp ${chip}/power.cpp ${chip}/clock.cpp ${chip}/watchdog.cpp ${emulated}/clock_tree.cpp ${emulated}/semihosting.cpp)
add_library(hal_slcan OBJECT ${CMAKE_SOURCE_DIR}/hal/slcan/can.cpp ${chip}/uart.cpp ${emulated}/samples_can.cpp ${CMAKE_SOURCE_DIR}/hal/absent/record.cpp)
add_library(hal_stream OBJECT ${CMAKE_SOURCE_DIR}/hal/absent/can.cpp ${emulated}/samples_stream.cpp)
# what only a real board needs compiles all the same
add_library(hal_board OBJECT ${chip}/clock_tree.cpp ${chip}/finish.cpp)

add_library(application OBJECT ${CMAKE_SOURCE_DIR}/firmware/main.cpp ${CMAKE_SOURCE_DIR}/firmware/estimator_step.cpp ${cell_header})
target_include_directories(application PRIVATE ${CMAKE_BINARY_DIR}/generated)
foreach(part hal_core hal_slcan hal_stream hal_board application)
  target_link_libraries(${part} PUBLIC bms_estimator)
  target_compile_definitions(${part} PUBLIC ${BMS_SCALAR_DEFINITION})
endforeach()

function(bms_image name)
  add_executable(${name} ${ARGN})
  target_link_options(${name} PRIVATE -Wl,-Map=${CMAKE_BINARY_DIR}/${name}.map)
  set_target_properties(${name} PROPERTIES LINK_DEPENDS ${BMS_LINKER_SCRIPT} RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR})
endfunction()

bms_image(bms_${BMS_BOARD} $<TARGET_OBJECTS:hal_core> $<TARGET_OBJECTS:hal_slcan> $<TARGET_OBJECTS:application>)
bms_image(bms_${BMS_BOARD}_replay $<TARGET_OBJECTS:hal_core> $<TARGET_OBJECTS:hal_stream> $<TARGET_OBJECTS:application>)
