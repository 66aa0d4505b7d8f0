# SPDX-License-Identifier: MIT
# Every public header, alone and twice, as the strictest firmware would compile it, among the macros
# of an Arduino sketch, which find themselves unchanged afterwards.
file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}/include
     ${PROJECT_SOURCE_DIR}/include/*.hpp)
list(FILTER headers EXCLUDE REGEX "/macros_(off|back)\\.hpp$")

set(macros embedded/arduino_macros.hpp)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${macros})
file(STRINGS ${macros} names REGEX "^#define ")
list(TRANSFORM names REPLACE "^#define ([A-Za-z0-9_]+).*"
     "#ifndef \\1\n#error \"\\1 is lost\"\n#endif\n")
string(JOIN "" kept ${names})
set(kept "#pragma once\n${kept}#include \"${macros}\"\n")
file(CONFIGURE OUTPUT headers/macros_kept.hpp CONTENT "${kept}")

set(units)
foreach(header IN LISTS headers)
  string(REGEX REPLACE "[/.]" "_" name ${header})
  set(unit ${CMAKE_CURRENT_BINARY_DIR}/headers/${name}.cpp)
  string(JOIN "\n" content "#include \"${macros}\"" "#include \"${header}\""
         "#include \"${header}\"" "#include \"headers/macros_kept.hpp\"" "")
  file(CONFIGURE OUTPUT ${unit} CONTENT "${content}")
  list(APPEND units ${unit})
endforeach()

add_library(uwbpos_headers_alone OBJECT ${units})
target_link_libraries(uwbpos_headers_alone PRIVATE uwbpos_own)
target_include_directories(uwbpos_headers_alone PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}
                           ${CMAKE_CURRENT_BINARY_DIR})
target_compile_options(uwbpos_headers_alone PRIVATE -O0 -fno-exceptions -fno-rtti)
