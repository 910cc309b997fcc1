# Embeds files in a C++ source:
#
#   cmake -DOUT=x.cpp -DHEADER=h.hpp -DNAMES=a|b -DFILES=fa|fb -P embed.cmake
#
# Each file becomes a constant of its name. With CELLS=ON the source holds the list of built-in cells instead.
string(REPLACE "|" ";" names "${NAMES}")
string(REPLACE "|" ";" files "${FILES}")
set(source "#include \"${HEADER}\"\n\n")
if(CELLS)
  string(APPEND source "namespace bms::files {\n\nconst std::vector<BuiltInCell>& built_in_cells() {\n"
    "  static const std::vector<BuiltInCell> cells = {\n")
else()
  string(APPEND source "namespace bms::reports::embedded {\n\n")
endif()
list(LENGTH names count)
math(EXPR last "${count} - 1")
foreach(k RANGE ${last})
  list(GET names ${k} name)
  list(GET files ${k} file)
  file(READ "${file}" content)
  if(CELLS)
    string(APPEND source "      {\"${name}\", R\"bms_embed(${content})bms_embed\"},\n")
  else()
    string(APPEND source "const std::string_view ${name} = R\"bms_embed(${content})bms_embed\";\n\n")
  endif()
endforeach()
if(CELLS)
  string(APPEND source "  };\n  return cells;\n}\n\n}  // namespace bms::files\n")
else()
  string(APPEND source "}  // namespace bms::reports::embedded\n")
endif()
file(WRITE "${OUT}" "${source}")
