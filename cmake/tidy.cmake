# SPDX-License-Identifier: MIT
# One unit with every public header and every example, for clang-tidy to read: most of its time
# goes into what they share.
file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}/include
     ${PROJECT_SOURCE_DIR}/include/*.hpp)
# These two come in pairs, around what a header holds.
list(FILTER headers EXCLUDE REGEX "/macros_(off|back)\\.hpp$")
list(TRANSFORM headers REPLACE "(.+)" "#include \"\\1\"\n")
file(GLOB examples CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/examples/*.cpp)
set(units ${headers})
foreach(example IN LISTS examples)
  cmake_path(GET example STEM name)
  list(APPEND units "#define main ${name}_main\n#include \"${example}\"\n#undef main\n")
endforeach()
string(JOIN "" includes ${units})
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/everything.cpp CONTENT "${includes}")
add_library(uwbpos_everything OBJECT ${PROJECT_BINARY_DIR}/everything.cpp)
target_link_libraries(uwbpos_everything PRIVATE uwbpos_own)
