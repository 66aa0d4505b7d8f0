# SPDX-License-Identifier: MIT
# What `cmake --install` installs: headers, the CMake package and a pkg-config file. All of it
# is independent of the processor, and may be moved to another place once installed.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(uwbpos_package_dir ${CMAKE_INSTALL_DATADIR}/cmake/uwbpos)
set(uwbpos_pkgconfig_dir ${CMAKE_INSTALL_DATADIR}/pkgconfig)

install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/uwbpos DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        FILES_MATCHING PATTERN "*.hpp")
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/licenses/uwbpos)

install(TARGETS uwbpos EXPORT uwbpos-targets INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT uwbpos-targets NAMESPACE uwbpos:: DESTINATION ${uwbpos_package_dir})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/uwbpos-config.cmake.in
                              uwbpos-config.cmake INSTALL_DESTINATION ${uwbpos_package_dir}
                              NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(uwbpos-config-version.cmake COMPATIBILITY SameMajorVersion
                                 ARCH_INDEPENDENT)
install(FILES ${PROJECT_BINARY_DIR}/uwbpos-config.cmake
              ${PROJECT_BINARY_DIR}/uwbpos-config-version.cmake DESTINATION ${uwbpos_package_dir})

# pkg-config finds the prefix from where the .pc file lies.
cmake_path(IS_ABSOLUTE CMAKE_INSTALL_DATADIR uwbpos_absolute_datadir)
if(uwbpos_absolute_datadir)
  set(uwbpos_pc_prefix ${CMAKE_INSTALL_PREFIX})
else()
  file(RELATIVE_PATH uwbpos_pc_up /x/${uwbpos_pkgconfig_dir} /x)
  string(REGEX REPLACE "/$" "" uwbpos_pc_up "${uwbpos_pc_up}")
  set(uwbpos_pc_prefix "\${pcfiledir}/${uwbpos_pc_up}")
endif()
cmake_path(IS_ABSOLUTE CMAKE_INSTALL_INCLUDEDIR uwbpos_absolute_includedir)
if(uwbpos_absolute_includedir)
  set(uwbpos_pc_includedir ${CMAKE_INSTALL_INCLUDEDIR})
else()
  set(uwbpos_pc_includedir "\${prefix}/${CMAKE_INSTALL_INCLUDEDIR}")
endif()
configure_file(${CMAKE_CURRENT_LIST_DIR}/uwbpos.pc.in uwbpos.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/uwbpos.pc DESTINATION ${uwbpos_pkgconfig_dir})
