# SPDX-License-Identifier: MIT
# Every public header, alone and twice, as the strictest firmware would compile it.
file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}/include
     ${PROJECT_SOURCE_DIR}/include/*.hpp)

set(units)
foreach(header IN LISTS headers)
  string(REGEX REPLACE "[/.]" "_" name ${header})
  set(unit ${CMAKE_CURRENT_BINARY_DIR}/headers/${name}.cpp)
  file(CONFIGURE OUTPUT ${unit} CONTENT "#include \"${header}\"\n#include \"${header}\"\n")
  list(APPEND units ${unit})
endforeach()

add_library(uwbpos_headers_alone OBJECT ${units})
target_link_libraries(uwbpos_headers_alone PRIVATE uwbpos_own)
target_compile_options(uwbpos_headers_alone PRIVATE -O0 -fno-exceptions -fno-rtti)
