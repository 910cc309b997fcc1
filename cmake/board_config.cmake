# bms_board_config(NAME FOLDER SOURCE TEXT [CELLS N] [SAMPLE_PERIOD_S S] [CURRENT_RANGE_A A] [FIXED_POINT true|false]
#                  [DC_LINK true|false] [TRUCK_STATED true|false] [PRECHARGE_S S] [CLOSING_A A] [CLOSING_OHM OHM]
#                  [VEHICLE_PROFILE none|cia418|j1939|elcon] [CANOPEN_NODE N] [CANOPEN_CHARGER N]
#                  [CAN_BIT_RATE R] [CAN_BASE ID] [CAN_STOP ID] [PARAMETERS true|false]
#                  [CHARGER_BUS true|false] [CHARGER_BIT_RATE R] [PARALLEL true|false]
#                  [INPUTS BITS] [OUTPUTS BITS] [CLOSES_BY_INPUTS true|false] [INSULATION absent|pwm|iso175]
#                  [SECOND_CURRENT true|false] [TRUCK_SIDE true|false] [BLEED_OHM OHM])
#
# Writes FOLDER/board_config.hpp: all that the C++ code knows about a board and about the build options. NAME becomes
# an interface library with FOLDER in its include path. The values below are those of the host.
function(bms_board_config name folder)
  set(bms_config_CELLS 1)
  set(bms_config_SAMPLE_PERIOD_S 0.1)
  set(bms_config_CURRENT_RANGE_A 2147)
  set(bms_config_FIXED_POINT false)
  set(bms_config_DC_LINK true)
  set(bms_config_TRUCK_STATED false)
  set(bms_config_PRECHARGE_S 0.5)
  set(bms_config_CLOSING_A 600)
  set(bms_config_CLOSING_OHM 0.015)
  set(bms_config_VEHICLE_PROFILE none)
  set(bms_config_CANOPEN_NODE 1)
  set(bms_config_CANOPEN_CHARGER 10)
  set(bms_config_CAN_BIT_RATE 250000)
  set(bms_config_CAN_BASE 0x180)
  set(bms_config_CAN_STOP 0x0A0)
  set(bms_config_PARAMETERS true)
  set(bms_config_CHARGER_BUS false)
  set(bms_config_CHARGER_BIT_RATE 250000)
  set(bms_config_PARALLEL false)
  set(bms_config_INPUTS 0)
  set(bms_config_OUTPUTS 7)
  set(bms_config_CLOSES_BY_INPUTS false)
  set(bms_config_SECOND_CURRENT true)
  set(bms_config_TRUCK_SIDE true)
  set(bms_config_BLEED_OHM 33)
  set(bms_config_INSULATION absent)
  set(settings CELLS SAMPLE_PERIOD_S CURRENT_RANGE_A FIXED_POINT DC_LINK TRUCK_STATED PRECHARGE_S
    CLOSING_A CLOSING_OHM VEHICLE_PROFILE CANOPEN_NODE CANOPEN_CHARGER CAN_BIT_RATE CAN_BASE CAN_STOP
    CHARGER_BUS CHARGER_BIT_RATE PARALLEL PARAMETERS INPUTS OUTPUTS CLOSES_BY_INPUTS INSULATION
    SECOND_CURRENT TRUCK_SIDE BLEED_OHM)
  cmake_parse_arguments(arg "" "SOURCE;${settings}" "" ${ARGN})
  set(bms_config_source ${arg_SOURCE})
  foreach(setting ${settings})
    if(DEFINED arg_${setting})
      set(bms_config_${setting} ${arg_${setting}})
    endif()
  endforeach()
  configure_file(${PROJECT_SOURCE_DIR}/cmake/board_config.hpp.in ${folder}/board_config.hpp @ONLY)
  add_library(${name} INTERFACE)
  target_include_directories(${name} INTERFACE ${folder})
endfunction()

# bms_bits(OUT SETTING KNOWN WANTED): one bit for each wanted word, by its place in the list of known ones.
function(bms_bits out setting known wanted)
  set(bits 0)
  foreach(word ${wanted})
    list(FIND known ${word} place)
    if(place EQUAL -1)
      message(FATAL_ERROR "${setting} has ${word}, expected words of: ${known}")
    endif()
    math(EXPR bits "${bits} | (1 << ${place})")
  endforeach()
  set(${out} ${bits} PARENT_SCOPE)
endfunction()
