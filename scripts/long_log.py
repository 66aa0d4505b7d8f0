#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Long logs: what the host command costs on a log of 10^5 rows and on one of 10^6.

scripts/long_log.py build/release/examples/uwbpos/uwbpos [--rows N] [--filter] [--no-time]

Prints processor time and peak memory of both. Fails where ten times the rows take more than
LIMIT_TIME times the processor time, or a further row more than LIMIT_ROW bytes of memory. Looks at
no absolute time.
"""

import argparse
import math
import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path

ANCHORS = [(0, 0, 3), (10, 0, 2.5), (10, 8, 3), (0, 8, 2.5), (5, 0, 2.8), (5, 8, 2.2), (0, 4, 3), (10, 4, 2.4)]
FACTOR = 10
# n log n of the sort by time is 12 at these sizes; half as much again for caches and neighbours.
LIMIT_TIME = 18
# Twice what a reading, its epoch, its position and its residual take.
LIMIT_ROW = 500


def write_logs(folder, rows):
    """Anchors, and ranges of a tag that walks a circle: rounds of eight, ten a second."""
    with open(folder / "anchors.csv", "w") as file:
        file.write("anchor_id,x_m,y_m,z_m\n")
        for number, place in enumerate(ANCHORS):
            file.write(f"{number},{place[0]},{place[1]},{place[2]}\n")
    noise = random.Random(1)
    with open(folder / "ranges.csv", "w") as file:
        file.write("t_s,anchor_id,range_m\n")
        for row in range(rows):
            epoch, anchor = divmod(row, len(ANCHORS))
            t = 0.1 * epoch
            tag = (5 + 3 * math.cos(0.2 * t), 4 + 3 * math.sin(0.2 * t), 1.0)
            value = math.dist(tag, ANCHORS[anchor]) + noise.gauss(0, 0.1)
            file.write(f"{t:.3f},{anchor},{value:.3f}\n")


def run(command, folder, rows, options):
    """Processor time [s] and peak resident memory [bytes] of one replay."""
    write_logs(folder, rows)
    words = [command, "replay", "--anchors", folder / "anchors.csv", "--ranges", folder / "ranges.csv",
             "--height", "1", "--out", folder / "out", *options]  # fmt: skip
    child = subprocess.Popen([str(word) for word in words], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        sys.exit(f"replay of {rows} rows ended with {child.returncode}")
    # The kernel's maximum also covers programs that the command starts, as gnuplot.
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("command", type=Path, help="the uwbpos binary")
    parser.add_argument("--rows", type=int, default=1_000_000, help="of the longer log")
    parser.add_argument("--filter", action="store_true", help="replay --filter")
    parser.add_argument("--no-time", action="store_true", help="judge memory alone")
    arguments = parser.parse_args()
    options = ["--filter"] if arguments.filter else []
    with tempfile.TemporaryDirectory() as folder:
        few = arguments.rows // FACTOR
        time_few, memory_few = run(arguments.command, Path(folder), few, options)
        time_many, memory_many = run(arguments.command, Path(folder), arguments.rows, options)
    per_row = (memory_many - memory_few) / (arguments.rows - few)
    for rows, time, memory in ((few, time_few, memory_few), (arguments.rows, time_many, memory_many)):
        print(f"{rows:9d} rows: {time:8.2f} s of processor, {memory / 2**20:7.1f} MiB at most")
    print(f"{FACTOR} times the rows: {time_many / time_few:.1f} times the time, {per_row:.0f} bytes a row")
    if not arguments.no_time and time_many > LIMIT_TIME * time_few:
        sys.exit(f"more than {LIMIT_TIME} times the time: not linear")
    if per_row > LIMIT_ROW:
        sys.exit(f"more than {LIMIT_ROW} bytes a row")


if __name__ == "__main__":
    main()
