#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Instructions a fix, counted by Valgrind: a ratio that no other job on the machine disturbs.

instructions.py PEERS, the program that prints the table of ratios.
"""
import os
import re
import subprocess
import sys
import tempfile

CASES = 8  # a round of `peers --repeat`
ROUNDS = 100


def instructions(peers, what, rounds):
    with tempfile.TemporaryDirectory() as scratch:
        command = ["valgrind", "--tool=callgrind",
                   f"--callgrind-out-file={os.path.join(scratch, 'out')}",
                   peers, "--repeat", what, str(rounds)]
        told = subprocess.run(command, check=True, capture_output=True, text=True).stderr
    return int(re.search(r"Collected : (\d+)", told).group(1))


def per_fix(peers, what):
    # What the program does besides is the same twice.
    return (instructions(peers, what, ROUNDS + 1) - instructions(peers, what, 1)) / (ROUNDS * CASES)


def main():
    peers = sys.argv[1]
    print("\nInstructions a fix, 3-D, 8 anchors, double:")
    for what in ("ranges", "differences"):
        ours = per_fix(peers, what)
        tiny = per_fix(peers, what + "-tiny")
        print(f"{what}: uwbpos {ours:.0f}; ceres::TinySolver {tiny:.0f}, {tiny / ours:.1f} times as many")


if __name__ == "__main__":
    main()
