# Compiles files into a program.
#
#   bms_embed(OUT_VARIABLE NAME HEADER h.hpp NAMESPACE n NAMES a b FILES fa fb [LIST function TYPE Type])
#
# Writes NAME.cpp in the build folder and sets OUT_VARIABLE to its path. Without LIST the file has one std::string_view
# per name. With LIST it has `const std::vector<Type>& function()`, a list of {name, text}. HEADER declares them.
if(NOT CMAKE_SCRIPT_MODE_FILE)
  function(bms_embed out_variable name)
    cmake_parse_arguments(arg "" "HEADER;NAMESPACE;LIST;TYPE" "NAMES;FILES" ${ARGN})
    set(out ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp)
    list(JOIN arg_NAMES "|" names)
    list(JOIN arg_FILES "|" files)
    add_custom_command(OUTPUT ${out}
      COMMAND ${CMAKE_COMMAND} -DOUT=${out} -DHEADER=${arg_HEADER} -DNAMESPACE=${arg_NAMESPACE} -DLIST=${arg_LIST}
        -DTYPE=${arg_TYPE}
        "-DNAMES=${names}" "-DFILES=${files}" -P ${PROJECT_SOURCE_DIR}/cmake/embed.cmake
      DEPENDS ${arg_FILES} ${PROJECT_SOURCE_DIR}/cmake/embed.cmake VERBATIM)
    set(${out_variable} ${out} PARENT_SCOPE)
  endfunction()
  return()
endif()

string(REPLACE "|" ";" names "${NAMES}")
string(REPLACE "|" ";" files "${FILES}")
set(source "#include \"${HEADER}\"\n\nnamespace ${NAMESPACE} {\n\n")
if(LIST)
  string(APPEND source "const std::vector<${TYPE}>& ${LIST}() {\n  static const std::vector<${TYPE}> list = {\n")
endif()
foreach(name file IN ZIP_LISTS names files)
  file(READ "${file}" content)
  if(LIST)
    string(APPEND source "      {\"${name}\", R\"bms_embed(${content})bms_embed\"},\n")
  else()
    string(APPEND source "const std::string_view ${name} = R\"bms_embed(${content})bms_embed\";\n\n")
  endif()
endforeach()
if(LIST)
  string(APPEND source "  };\n  return list;\n}\n\n")
endif()
string(APPEND source "}  // namespace ${NAMESPACE}\n")
file(WRITE "${OUT}" "${source}")
