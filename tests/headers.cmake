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

# Half of what a header takes to compile is Eigen. The units of headers that include core/eigen.hpp,
# themselves or through others, have that precompiled; they lack nothing that it would have hidden.
# Who includes it is read when CMake runs.
set(eigen uwbpos/core/eigen.hpp)
set(with_eigen ${eigen})
set(before)
while(NOT "${before}" STREQUAL "${with_eigen}")
  set(before ${with_eigen})
  list(JOIN with_eigen "|" any)
  foreach(header IN LISTS headers)
    if(NOT header IN_LIST with_eigen)
      file(STRINGS ${PROJECT_SOURCE_DIR}/include/${header} found LIMIT_COUNT 1
           REGEX "^#include \"(${any})\"")
      if(found)
        list(APPEND with_eigen ${header})
      endif()
    endif()
  endforeach()
endwhile()

set(alone)
set(alone_eigen)
foreach(header IN LISTS headers)
  string(REGEX REPLACE "[/.]" "_" name ${header})
  set(unit ${CMAKE_CURRENT_BINARY_DIR}/headers/${name}.cpp)
  string(JOIN "\n" content "#include \"${macros}\"" "#include \"${header}\""
         "#include \"${header}\"" "#include \"headers/macros_kept.hpp\"" "")
  file(CONFIGURE OUTPUT ${unit} CONTENT "${content}")
  if(header IN_LIST with_eigen AND NOT header STREQUAL eigen)
    list(APPEND alone_eigen ${unit})
  else()
    list(APPEND alone ${unit})
  endif()
endforeach()

foreach(which alone alone_eigen)
  # None includes core/eigen.hpp where each includes the one header of a release.
  if(NOT ${which})
    continue()
  endif()
  add_library(uwbpos_headers_${which} OBJECT ${${which}})
  target_link_libraries(uwbpos_headers_${which} PRIVATE uwbpos_own)
  target_include_directories(uwbpos_headers_${which} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}
                             ${CMAKE_CURRENT_BINARY_DIR})
  target_compile_options(uwbpos_headers_${which} PRIVATE -O0 -fno-exceptions -fno-rtti)
endforeach()
if(alone_eigen)
  target_precompile_headers(uwbpos_headers_alone_eigen PRIVATE
                            ${CMAKE_CURRENT_SOURCE_DIR}/${macros} ${PROJECT_SOURCE_DIR}/include/${eigen})
endif()
