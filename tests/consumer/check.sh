#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Builds a user's program in one of the ways that users do, and runs it.
#   check.sh install | find_package | pkg_config | add_subdirectory | fetch_content
# Environment: SOURCE and BUILD, uwbpos's own folders; WORK, a folder to work in; CXX.
set -euo pipefail
how="$1"
prefix="$WORK/prefix"
here="$SOURCE/tests/consumer"

fail() {
  echo "$how: $*" >&2
  exit 1
}

cmake_consumer() {
  local build="$WORK/$how"
  rm -rf "$build"
  cmake -G Ninja -S "$here/$how" -B "$build" -DCMAKE_CXX_COMPILER="$CXX" "$@"
  cmake --build "$build"
  "$build/consumer"
}

# Taken in as sources, uwbpos installs nothing with the program.
expect_no_install() {
  rm -rf "$WORK/$how-installed"
  cmake --install "$WORK/$how" --prefix "$WORK/$how-installed"
  [[ ! -e "$WORK/$how-installed" ]] || fail "uwbpos installs files with its consumer"
}

case "$how" in
  install)
    # Installed in one place and moved to another: nothing in it may remember where it was.
    rm -rf "$prefix" "$WORK/moved-from"
    cmake --install "${BUILD:?}" --prefix "$WORK/moved-from"
    mv "$WORK/moved-from" "$prefix"
    ! grep -rlE "moved-from|$SOURCE" "$prefix" || fail "these files hold a path of the build"
    diff -r "$SOURCE/include/uwbpos" "$prefix/include/uwbpos" || fail "the headers differ"
    ;;
  find_package)
    cmake_consumer -DCMAKE_PREFIX_PATH="$prefix" | tee "$WORK/$how.log"
    grep -q "headers in $prefix/include" "$WORK/$how.log" || fail "found another uwbpos"
    ;;
  pkg_config)
    export PKG_CONFIG_PATH="$prefix/share/pkgconfig"
    version="$(sed -n 's/.*kVersion = "\(.*\)".*/\1/p' "$SOURCE/include/uwbpos/core/version.hpp")"
    [[ "$(pkg-config --modversion uwbpos)" == "$version" ]] || fail "not version $version"
    read -ra flags <<<"$(pkg-config --define-prefix --cflags --libs uwbpos)"
    [[ " ${flags[*]} " == *" -I$prefix/include "* ]] || fail "flags are ${flags[*]}"
    "$CXX" -std=c++23 -Wall -Wextra -Wconversion -Werror "${flags[@]}" "$here/main.cpp" \
      -o "$WORK/$how"
    "$WORK/$how"
    ;;
  add_subdirectory)
    cmake_consumer -DUWBPOS_SOURCE="$SOURCE"
    expect_no_install
    ;;
  fetch_content)
    cmake_consumer -DFETCHCONTENT_SOURCE_DIR_UWBPOS="$SOURCE" -DFETCHCONTENT_FULLY_DISCONNECTED=ON
    expect_no_install
    ;;
  *) fail "no such consumer" ;;
esac
