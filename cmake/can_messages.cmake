# Generates the packing code of the CAN messages in ${PROJECT_BINARY_DIR}/generated:
#
#   can/greybox_bms.dbc      can_messages.hpp
#   can/j1939_profile.dbc    j1939_messages.hpp
#
# Link bms_can to include them.
find_program(BMS_PYTHON python3 PATHS /usr/bin NO_DEFAULT_PATH DOC "python3 with canmatrix")
if(NOT BMS_PYTHON)
  find_program(BMS_PYTHON python3 REQUIRED)
endif()
execute_process(COMMAND ${BMS_PYTHON} -c "import canmatrix" OUTPUT_QUIET ERROR_QUIET RESULT_VARIABLE no_canmatrix)
if(no_canmatrix)
  message(FATAL_ERROR "${BMS_PYTHON} cannot import canmatrix, which generates the CAN messages. "
    "Install it (Debian: python3-canmatrix).")
endif()

# bms_dbc_header(OUT IN [NAMESPACE]): OUT is the header, IN the DBC file, NAMESPACE inside bms::can
function(bms_dbc_header out in)
  set(generators ${PROJECT_SOURCE_DIR}/cmake/dbc_header.py ${PROJECT_SOURCE_DIR}/cmake/dbc_file.py)
  get_filename_component(name ${in} NAME)
  add_custom_command(OUTPUT ${out}
    COMMAND ${BMS_PYTHON} ${PROJECT_SOURCE_DIR}/cmake/dbc_header.py ${in} ${out} ${ARGN}
    DEPENDS ${generators} ${in}
    COMMENT "CAN messages of ${name}" VERBATIM)
endfunction()

file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/generated)
set(can_messages ${PROJECT_BINARY_DIR}/generated/can_messages.hpp)
set(j1939_messages ${PROJECT_BINARY_DIR}/generated/j1939_messages.hpp)
bms_dbc_header(${can_messages} ${PROJECT_SOURCE_DIR}/can/greybox_bms.dbc)
bms_dbc_header(${j1939_messages} ${PROJECT_SOURCE_DIR}/can/j1939_profile.dbc j1939)
add_custom_target(generate_can_messages DEPENDS ${can_messages} ${j1939_messages})
add_library(bms_can INTERFACE)
target_include_directories(bms_can INTERFACE ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR}/generated)
add_dependencies(bms_can generate_can_messages)
