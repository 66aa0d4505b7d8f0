# SPDX-License-Identifier: MIT
# One unit with every public header, for clang-tidy to read.
file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}/include
     ${PROJECT_SOURCE_DIR}/include/*.hpp)
list(TRANSFORM headers REPLACE "(.+)" "#include \"\\1\"\n")
string(JOIN "" includes ${headers})
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/all_headers.cpp CONTENT "${includes}")
add_library(uwbpos_all_headers OBJECT ${PROJECT_BINARY_DIR}/all_headers.cpp)
target_link_libraries(uwbpos_all_headers PRIVATE uwbpos_own)
