# The packing code of the CAN messages, generated from the DBC files by ./bms messages and committed, so that a build
# needs no canmatrix:
#
#   firmware/can/greybox_bms.dbc      firmware/can/generated/can_messages.hpp
#   firmware/can/j1939_profile.dbc    firmware/can/generated/j1939_messages.hpp
#   firmware/can/parallel_bus.dbc     firmware/can/generated/parallel_messages.hpp
#
# Link bms_can to include them.
find_program(BMS_PYTHON python3 PATHS /usr/bin NO_DEFAULT_PATH)
if(NOT BMS_PYTHON)
  find_program(BMS_PYTHON python3 REQUIRED)
endif()

# The header knows the DBC file that it was generated from: a changed one is not used in silence.
function(bms_check_messages header dbc)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${dbc} ${header})
  file(SHA256 ${dbc} sha256)
  file(STRINGS ${header} generated_from LIMIT_COUNT 1 REGEX "SHA-256 of that file: ${sha256}")
  if(NOT generated_from)
    message(FATAL_ERROR "${header} was generated from another ${dbc}; ./bms messages writes it again.")
  endif()
endfunction()

set(can_messages ${PROJECT_SOURCE_DIR}/firmware/can/generated/can_messages.hpp)
set(j1939_messages ${PROJECT_SOURCE_DIR}/firmware/can/generated/j1939_messages.hpp)
set(parallel_messages ${PROJECT_SOURCE_DIR}/firmware/can/generated/parallel_messages.hpp)
bms_check_messages(${can_messages} ${PROJECT_SOURCE_DIR}/firmware/can/greybox_bms.dbc)
bms_check_messages(${j1939_messages} ${PROJECT_SOURCE_DIR}/firmware/can/j1939_profile.dbc)
bms_check_messages(${parallel_messages} ${PROJECT_SOURCE_DIR}/firmware/can/parallel_bus.dbc)
add_library(bms_can INTERFACE)
target_include_directories(bms_can INTERFACE ${BMS_INCLUDE_ROOTS} ${PROJECT_SOURCE_DIR}/firmware/can/generated)
