#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# One fuzzer of build/asan, for `./dev fuzz`.
#   fuzz_one.sh run NAME SECONDS   from the kept inputs and those found before
#   fuzz_one.sh keep NAME          the fewest of both that reach as far, under tests/fuzz/corpus;
#                                  and those whose name begins with mended
set -euo pipefail
cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")/.."
name="$2"
built=build/asan/tests/fuzz
found="$built/found_$name"
kept="tests/fuzz/corpus/$name"
log="$built/$name.log"

if [[ "$1" == run ]]; then
  seed=$((RANDOM + 1))
  "$built/fuzz_$name" -seed="$seed" -max_total_time="$3" -timeout=30 -max_len=2000 -verbosity=0 \
    -print_final_stats=1 -artifact_prefix="$found/" "$found" "$kept" >"$log" 2>&1 || {
    printf '!! %s, seed %s:\n' "$name" "$seed"
    grep -vE 'NEW_FUNC|symbolizer' "$log" | tail -40
    exit 1
  }
  printf '%-12s %s inputs\n' "$name" "$(sed -n 's/stat::number_of_executed_units: *//p' "$log")"
else
  fewest="$(mktemp -d)"
  "$built/fuzz_$name" -set_cover_merge=1 -use_counters=0 -max_len=2000 -verbosity=0 \
    "$fewest" "$kept" "$found" >"$log" 2>&1 || { tail -20 "$log"; exit 1; }
  find "$kept" -name 'mended*' -exec cp {} "$fewest" \;
  rm -rf "$kept"
  mv "$fewest" "$kept"
  chmod 755 "$kept"
  printf '%-12s %s inputs, %s bytes\n' "$name" "$(find "$kept" -type f | wc -l)" \
    "$(find "$kept" -type f -printf '%s\n' | awk '{ sum += $1 } END { print sum + 0 }')"
fi
