# Installation and the Debian package. The tool finds what is installed relative to itself
# (host_sim/images/firmware_image.cpp).
include(GNUInstallDirs)
set(data ${CMAKE_INSTALL_DATADIR}/greybox)

# man pages and completions, from the texts of --help
set(manual ${PROJECT_BINARY_DIR}/manual)
add_custom_command(OUTPUT ${manual}/man/bms.1
  COMMAND ${CMAKE_COMMAND} -E rm -rf ${manual}
  COMMAND ${BMS_PYTHON} ${PROJECT_SOURCE_DIR}/cmake/manual.py $<TARGET_FILE:bms> ${PROJECT_VERSION} ${manual}
  DEPENDS bms ${PROJECT_SOURCE_DIR}/cmake/manual.py VERBATIM)
add_custom_target(manual ALL DEPENDS ${manual}/man/bms.1)

install(CODE "set(CMAKE_INSTALL_DO_STRIP ON)" COMPONENT tool)
install(TARGETS bms DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT tool)
install(TARGETS cell_header DESTINATION libexec/greybox COMPONENT tool)
install(DIRECTORY ${manual}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT tool)
set(completions ${manual}/completions)
install(FILES ${completions}/bms.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME bms
  COMPONENT tool)
install(FILES ${completions}/_bms DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT tool)
install(FILES ${completions}/bms.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT tool)

# data: cell files, CAN messages, the recording of the first example
install(DIRECTORY model/cells DESTINATION ${data} COMPONENT tool FILES_MATCHING PATTERN *.toml PATTERN README.md)
install(FILES firmware/can/greybox_bms.dbc firmware/can/j1939_profile.dbc firmware/can/parallel_bus.dbc
  DESTINATION ${data}/can COMPONENT tool)
install(FILES evidence/recordings/forklift_shift.csv DESTINATION ${data}/recordings COMPONENT tool)
install(FILES README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT tool)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright COMPONENT tool)
# sources from which the tool builds the firmware of a board with a cell
install(DIRECTORY arithmetic boards cmake estimator firmware hal library measurement model
  DESTINATION ${data}/source COMPONENT tool PATTERN __pycache__ EXCLUDE)
install(FILES CMakeLists.txt LICENSE DESTINATION ${data}/source COMPONENT tool)
foreach(image fault filter_forms pack protection)
  install(FILES tests/firmware/${image}_image.cpp DESTINATION ${data}/source/tests/firmware COMPONENT tool)
endforeach()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME greybox-bms)
set(CPACK_PACKAGE_VENDOR greybox-bms)
set(CPACK_PACKAGE_CONTACT "greybox-bms <greybox-bms@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Battery model: state of charge, identification, diagnosis, firmware")
set(CPACK_PACKAGE_DESCRIPTION "Replays logs of a battery through the estimator of its management system,
identifies cell models, diagnoses where model and log disagree, and has the
headers of the estimator for other firmware.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_FILE_NAME greybox-bms)
set(CPACK_OUTPUT_FILE_PREFIX ${PROJECT_BINARY_DIR}/package)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# what a command needs that builds or runs firmware
string(CONCAT CPACK_DEBIAN_PACKAGE_RECOMMENDS "cmake, ninja-build, gcc-arm-none-eabi, libnewlib-arm-none-eabi, "
  "libstdc++-arm-none-eabi-newlib, qemu-system-arm, python3")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS openocd)
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # a package needs the tool, not the tests
include(CPack)
