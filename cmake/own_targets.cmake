# Settings of the project's own targets. They do not reach a project that adds this one by add_subdirectory().
#
#   bms_warnings      interface library with the warning options. Warnings are errors only with
#                     -DCMAKE_COMPILE_WARNING_AS_ERROR=ON (./bms lint): another compiler warns of other things, and must
#                     not keep anybody from building
#   bms_own_targets   links it, and adds the include path, to every library and program below a folder

add_library(bms_warnings INTERFACE)
target_compile_options(bms_warnings INTERFACE -Wall -Wextra -Wshadow -Wconversion)

# bms_own_targets(FOLDER): call it after all targets are defined
function(bms_own_targets folder)
  get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target ${targets})
    get_target_property(type ${target} TYPE)
    if(type MATCHES "^(STATIC_LIBRARY|MODULE_LIBRARY|OBJECT_LIBRARY|EXECUTABLE)$")
      target_link_libraries(${target} PRIVATE bms_warnings)
      target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
    endif()
  endforeach()
  get_property(subfolders DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
  foreach(subfolder ${subfolders})
    bms_own_targets(${subfolder})
  endforeach()
endfunction()
