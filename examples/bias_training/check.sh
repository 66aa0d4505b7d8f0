#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Trains on two simulated flights and scores on two that training did not see, for ranges and for
# differences; then corrects an unseen flight at estimated positions and attitudes. Fails if the
# network takes less than 48 % off the rms error of either, noise of 3 cm included.
#   examples/bias_training/check.sh FLIGHTS UWBPOS [TRAIN_OPTIONS]
# FLIGHTS: the built examples/flights.cpp; UWBPOS: the host command.
set -euo pipefail
flights="$1" uwbpos="$2"
shift 2
here="$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")"
if ! /usr/bin/python3 -c 'import scipy' 2>/dev/null; then
  echo "*** SKIPPED: training a bias network; python3-scipy is missing" >&2
  exit 0
fi
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
for flight in 1 2 3 4; do "$flights" "$work/$flight" "$flight" 120; done

rmse() { /usr/bin/python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["error_m"]["rmse"])' "$1"; }

for kind in ranges tdoa; do
  log() { echo "$work/$1/$kind.csv"; }
  truth() { echo "$work/$1/truth.tum"; }
  echo "== $kind"
  OMP_NUM_THREADS=1 /usr/bin/python3 "$here/train.py" --anchors "$work/1/anchors.csv" \
    "--$kind" "$(log 1)" "$(log 2)" --truth "$(truth 1)" "$(truth 2)" \
    --unseen "$(log 3)" "$(log 4)" --unseen-truth "$(truth 3)" "$(truth 4)" --expect 48 \
    --alpha 3 --examples 4000 --iterations 150 --out "$work/net" "$@"
  # shellcheck disable=SC2054 # a point, not a list
  replay=("$uwbpos" replay --anchors "$work/3/anchors.csv" "--$kind" "$(log 3)"
    --truth "$(truth 3)" --dim 3 --prior 5,4,1.7)
  "${replay[@]}" --out "$work/raw" >"$work/said" 2>&1 || { cat "$work/said"; exit 1; }
  "${replay[@]}" --bias-network "$work/net/bias_network.json" --attitude "$work/3/attitude.tum" \
    --out "$work/less" >"$work/said" 2>&1 || { cat "$work/said"; exit 1; }
  raw="$(rmse "$work/raw/summary.json")" less="$(rmse "$work/less/summary.json")"
  echo "unseen flight, positions: rmse $raw m, less the network's biases $less m"
  awk -v raw="$raw" -v less="$less" 'BEGIN { exit !(less < 0.7 * raw) }' ||
    { echo "expected positions better by three tenths"; exit 1; }
done
