# Functions for projects that use greybox::estimator, by find_package(), add_subdirectory() or FetchContent.
#
#   greybox_cell_header(OUT_VARIABLE CELL [FIXED])
#       Writes the header of a cell with `bms cell header`, again whenever the cell file changes, and sets OUT_VARIABLE
#       to its path, CURRENT_BINARY_DIR/NAME.hpp. CELL: a cell file, or the name of a built-in cell. FIXED: for a core
#       without an FPU. The program bms is found in the PATH, or GREYBOX_BMS is its path.
#
#   greybox_c_library(TARGET CELL_HEADER [FIXED])
#       Static library with the functions of greybox/greybox.h for the cell of that header.

function(greybox_cell_header out_variable cell)
  find_program(GREYBOX_BMS bms HINTS ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/../../../bin NO_CMAKE_FIND_ROOT_PATH
    DOC "the tool of greybox-bms on this machine, which writes headers of cells")
  if(NOT GREYBOX_BMS)
    message(FATAL_ERROR "the tool bms is missing, expected -DGREYBOX_BMS=PATH; or write the header by hand "
      "(bms cell header ${cell} --out FILE.hpp) and use it instead of greybox_cell_header()")
  endif()
  set(fixed "")
  if("FIXED" IN_LIST ARGN)
    set(fixed --fixed)
  endif()
  get_filename_component(file ${cell} ABSOLUTE)
  get_filename_component(name ${cell} NAME_WE)
  set(source ${cell})
  set(depends ${GREYBOX_BMS})
  if(EXISTS ${file})
    set(source ${file})
    list(APPEND depends ${file})
  endif()
  set(out ${CMAKE_CURRENT_BINARY_DIR}/${name}.hpp)
  add_custom_command(OUTPUT ${out} COMMAND ${GREYBOX_BMS} cell header ${source} --out ${out} ${fixed} --quiet
    DEPENDS ${depends} COMMENT "Header of the cell ${name}" VERBATIM)
  set(${out_variable} ${out} PARENT_SCOPE)
endfunction()

function(greybox_c_library target header)
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${target}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "#include \"${header}\"\n\n#include <greybox/c_interface.hpp>\n")
  add_library(${target} STATIC ${source} ${header})
  target_link_libraries(${target} PUBLIC greybox::estimator)
  if(NOT WIN32)
    target_link_libraries(${target} PUBLIC m)  # sqrt of cores without such an instruction
  endif()
  if("FIXED" IN_LIST ARGN)
    target_compile_definitions(${target} PRIVATE GREYBOX_SCALAR=greybox::FixedPoint)
  endif()
endfunction()
