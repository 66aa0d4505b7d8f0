# SPDX-License-Identifier: MIT
# The README's first block of C++ is a program that compiles and runs.
set(readme ${PROJECT_SOURCE_DIR}/README.md)
if(NOT EXISTS ${readme})
  return()
endif()
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${readme})

# The fence's marker, and the line that closes it.
set(fence "\n```")
file(READ ${readme} text)
string(FIND "${text}" "${fence}cpp\n" start)
if(start EQUAL -1)
  message(FATAL_ERROR "README.md has no block of C++")
endif()
math(EXPR start "${start} + 8")
string(SUBSTRING "${text}" ${start} -1 text)
string(FIND "${text}" "${fence}" length)
string(SUBSTRING "${text}" 0 ${length} block)

file(CONFIGURE OUTPUT readme_block.cpp CONTENT "@block@\n" @ONLY)
add_executable(readme_block ${CMAKE_CURRENT_BINARY_DIR}/readme_block.cpp)
target_link_libraries(readme_block PRIVATE uwbpos::uwbpos)
target_compile_options(readme_block PRIVATE -Wall -Wextra -Werror)
add_test(NAME readme_block COMMAND readme_block)

# It prints what the README says it prints.
string(REGEX MATCH "It prints `([^`]*)`" promised "${text}")
if(NOT promised)
  message(FATAL_ERROR "README.md does not say what its program prints")
endif()
string(REGEX REPLACE "([+.])" "\\\\\\1" promised "${CMAKE_MATCH_1}")
set_tests_properties(readme_block PROPERTIES PASS_REGULAR_EXPRESSION "${promised}")
