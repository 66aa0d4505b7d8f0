# SPDX-License-Identifier: MIT
# How this repository's own programs (tests, examples, benches) are compiled. None of it
# reaches a program that uses the library.
set(CMAKE_CXX_STANDARD 23)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

find_program(UWBPOS_CCACHE ccache)
if(UWBPOS_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # What it takes to cache programs with precompiled headers.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env
      CCACHE_SLOPPINESS=pch_defines,time_macros ${UWBPOS_CCACHE})
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # g++ that collects no garbage before it holds 2 GB is done a fifth sooner.
  add_compile_options(-fpch-preprocess "SHELL:--param ggc-min-heapsize=2000000"
                      "SHELL:--param ggc-min-expand=500")
endif()

add_library(uwbpos_own INTERFACE)
target_link_libraries(uwbpos_own INTERFACE uwbpos::uwbpos)
target_compile_options(uwbpos_own INTERFACE
  -Wall -Wextra -Wconversion -Wdouble-promotion -Wshadow -Werror
  # g++ 12 takes the copy of an array that is filled in part for a mistake; clang looks as well.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized -Wno-uninitialized>
  # libstdc++ 12's stable_sort calls a function that it deprecates; clang sees it.
  $<$<CXX_COMPILER_ID:Clang>:-Wno-deprecated-declarations>
  # A fused multiply-add rounds once where the source says twice, and each compiler fuses
  # where it likes. Firmware and server agree bit for bit only without it.
  -ffp-contract=off
  # __FILE__ and debug information name files from the repository's root.
  -ffile-prefix-map=${PROJECT_SOURCE_DIR}/=)
