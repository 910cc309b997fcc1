# can/greybox_bms.dbc -> ${CMAKE_BINARY_DIR}/generated/can_messages.hpp, can/j1939_profile.dbc -> j1939_messages.hpp beside it; link bms_can to include them.
find_program(BMS_PYTHON python3 PATHS /usr/bin NO_DEFAULT_PATH DOC "python3 with canmatrix")
if(NOT BMS_PYTHON)
  find_program(BMS_PYTHON python3 REQUIRED)
endif()
execute_process(COMMAND ${BMS_PYTHON} -c "import canmatrix" OUTPUT_QUIET ERROR_QUIET RESULT_VARIABLE no_canmatrix)
if(no_canmatrix)
  message(FATAL_ERROR "${BMS_PYTHON} cannot import canmatrix, which the CAN messages are generated with (Debian: python3-canmatrix)")
endif()
set(can_messages ${CMAKE_BINARY_DIR}/generated/can_messages.hpp)
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/generated)
add_custom_command(OUTPUT ${can_messages}
  COMMAND ${BMS_PYTHON} ${CMAKE_SOURCE_DIR}/cmake/dbc_header.py ${CMAKE_SOURCE_DIR}/can/greybox_bms.dbc ${can_messages}
  DEPENDS ${CMAKE_SOURCE_DIR}/cmake/dbc_header.py ${CMAKE_SOURCE_DIR}/cmake/dbc_file.py ${CMAKE_SOURCE_DIR}/can/greybox_bms.dbc
  COMMENT "CAN messages" VERBATIM)
set(j1939_messages ${CMAKE_BINARY_DIR}/generated/j1939_messages.hpp)
add_custom_command(OUTPUT ${j1939_messages}
  COMMAND ${BMS_PYTHON} ${CMAKE_SOURCE_DIR}/cmake/dbc_header.py ${CMAKE_SOURCE_DIR}/can/j1939_profile.dbc ${j1939_messages} j1939
  DEPENDS ${CMAKE_SOURCE_DIR}/cmake/dbc_header.py ${CMAKE_SOURCE_DIR}/cmake/dbc_file.py ${CMAKE_SOURCE_DIR}/can/j1939_profile.dbc
  COMMENT "CAN messages of the J1939 profile" VERBATIM)
add_custom_target(generate_can_messages DEPENDS ${can_messages} ${j1939_messages})
add_library(bms_can INTERFACE)
target_include_directories(bms_can INTERFACE ${CMAKE_BINARY_DIR}/generated)
add_dependencies(bms_can generate_can_messages)
