# Settings of the project's own targets. They do not reach a project that adds this one by add_subdirectory().
#
#   bms_warnings      interface library with the warning options. Warnings are errors only with
#                     -DCMAKE_COMPILE_WARNING_AS_ERROR=ON (./bms lint): another compiler warns of other things, and must
#                     not keep anybody from building
#   bms_own_targets   links it, and adds the include paths, to every library and program below a folder
#   BMS_INCLUDE_ROOTS folders whose rooms are included by their name alone: "protection/table.hpp"

set(BMS_INCLUDE_ROOTS ${PROJECT_SOURCE_DIR})
foreach(group firmware host_sim inference evidence)
  list(APPEND BMS_INCLUDE_ROOTS ${PROJECT_SOURCE_DIR}/${group})
endforeach()

add_library(bms_warnings INTERFACE)
# In a unit of several sources a name may hide one of another source (bms_unity_build).
target_compile_options(bms_warnings INTERFACE -Wall -Wextra -Wconversion
  $<$<NOT:$<BOOL:$<TARGET_PROPERTY:UNITY_BUILD>>>:-Wshadow>)

# bms_own_targets(FOLDER): call it after all targets are defined
function(bms_own_targets folder)
  get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target ${targets})
    get_target_property(type ${target} TYPE)
    if(type MATCHES "^(STATIC_LIBRARY|MODULE_LIBRARY|OBJECT_LIBRARY|EXECUTABLE)$")
      target_link_libraries(${target} PRIVATE bms_warnings)
      target_include_directories(${target} PRIVATE ${BMS_INCLUDE_ROOTS})
    endif()
  endforeach()
  get_property(subfolders DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
  foreach(subfolder ${subfolders})
    bms_own_targets(${subfolder})
  endforeach()
endfunction()
