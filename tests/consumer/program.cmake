# SPDX-License-Identifier: MIT
# What the consumers share: the program, as strict as a careful user would have it, and the
# check that a uwbpos taken in as sources brings one target and nothing else.

function(add_consumer)
  add_executable(consumer ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/main.cpp)
  target_link_libraries(consumer PRIVATE uwbpos::uwbpos)
  target_compile_options(consumer PRIVATE -Wall -Wextra -Wconversion -Werror)
endfunction()

function(expect_equal what actual expected)
  if(NOT actual STREQUAL expected)
    message(FATAL_ERROR "uwbpos brings ${what}: \"${actual}\", not \"${expected}\"")
  endif()
endfunction()

function(expect_one_target cache_before)
  get_property(targets DIRECTORY ${uwbpos_SOURCE_DIR} PROPERTY BUILDSYSTEM_TARGETS)
  get_property(folders DIRECTORY ${uwbpos_SOURCE_DIR} PROPERTY SUBDIRECTORIES)
  get_property(tests DIRECTORY ${uwbpos_SOURCE_DIR} PROPERTY TESTS)
  get_target_property(type uwbpos TYPE)
  expect_equal("targets" "${targets}" "uwbpos")
  expect_equal("subdirectories" "${folders}" "")
  expect_equal("tests" "${tests}" "")
  expect_equal("a library of type" "${type}" "INTERFACE_LIBRARY")

  # No options. What project(), find_package() and FetchContent themselves remember is theirs.
  get_cmake_property(cache CACHE_VARIABLES)
  list(REMOVE_ITEM cache ${cache_before})
  list(FILTER cache EXCLUDE REGEX "^(uwbpos_(SOURCE_DIR|BINARY_DIR|IS_TOP_LEVEL)|Eigen3_DIR)$")
  list(FILTER cache EXCLUDE REGEX "^FETCHCONTENT_|^CMAKE_PROJECT_")
  expect_equal("cache variables" "${cache}" "")
endfunction()
