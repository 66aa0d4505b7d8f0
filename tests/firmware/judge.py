#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the firmware images under QEMU, judges results and budgets, compares or writes the table.

judge.py BUILD TABLE [--write]: BUILD holds a folder per board and host/track.txt.
"""

import re
import subprocess
import sys
from pathlib import Path

BOARDS = {
    "m4f": "Cortex-M4F", "m7": "Cortex-M7", "m33": "Cortex-M33", "m3": "Cortex-M3", "m0": "Cortex-M0",
}  # fmt: skip

# On the M4F: flash, stack [bytes], most instructions of a call. None: no budget.
BUDGETS = {
    # Not yet what is aimed at (1,600 / 300 / 2,500; 150 instructions): held where they are.
    "toa_least_squares_3d_8": (6300, 660, 8200),
    "ds_twr_range_asymmetric": (2000, 272, 350),
    "kalman_update_6_3": (None, None, 700),
    "two_tag_pose_": (None, None, 400),
}

# How far the checked-in table may be from what is measured: compilers differ by a little.
SLACK = 0.10
SLACK_AT_LEAST = 32

FORBIDDEN = re.compile(
    r" (__aeabi_d\w+|__aeabi_f2d|_*malloc\w*|_sbrk|_Zn[wa]\w+|__cxa_throw|_Unwind_\w+|_ZSt4cout|\w*printf\w*)$"
)

# libgcc of ARMv6-M turns 64-bit integers into float by way of double; nothing here asks for it.
OF_INTEGERS_ON_M0 = {"__aeabi_d2f", "__aeabi_dadd", "__aeabi_dmul"}

faults = []


def fault(text):
    faults.append(text)
    print(f"!! {text}")


def run(board, folder, image):
    emulator = (folder / "emulator").read_text().split(";")
    try:
        done = subprocess.run(
            ["timeout", "300", *emulator, str(folder / image)],
            stdin=subprocess.DEVNULL, capture_output=True, text=True,
        )  # fmt: skip
    except OSError as error:
        fault(f"{board}: {error}")
        return ""
    if done.returncode != 0:
        fault(f"{board}: {image} ended with {done.returncode}: {(done.stdout + done.stderr)[-300:]}")
    return done.stdout


def size_of(path):
    line = subprocess.run(
        ["arm-none-eabi-size", str(path)], check=True, capture_output=True, text=True
    ).stdout.splitlines()[1].split()  # fmt: skip
    return int(line[0]) + int(line[1])


def check_symbols(board, path):
    names = subprocess.run(
        ["arm-none-eabi-nm", str(path)], check=True, capture_output=True, text=True
    ).stdout  # fmt: skip
    for line in names.splitlines():
        found = FORBIDDEN.search(line)
        if found and not (board == "m0" and found.group(1) in OF_INTEGERS_ON_M0):
            fault(f"{board}: {path.name} holds {found.group(1)}")


def measure(board, folder):
    """{function: (flash, stack, most instructions, mean instructions)}."""
    rows = {}
    empty = size_of(folder / "size_no_function")
    words = 0
    for line in run(board, folder, "firmware_target").splitlines():
        found = re.match(r"case (\w+) (\d+) (\d+) (\d+) (\d+) (\d+)$", line)
        if not found:
            continue
        name = found.group(1)
        total, different, most, mean, stack = (int(x) for x in found.groups()[1:])
        words += total
        if different:
            fault(f"{board}: {name}: {different} of {total} words differ from the host's")
        flash = size_of(folder / f"size_{name}") - empty
        rows[name] = (flash, stack, most, mean)
    if not rows:
        fault(f"{board}: no case ran")
    check_symbols(board, folder / "firmware_target")
    print(f"== {BOARDS[board]}: {len(rows)} functions, {words} words as on the host")
    return rows


def check_track(board, folder, expected):
    if not (folder / "firmware_tag").is_file():
        return
    check_symbols(board, folder / "firmware_tag")
    track = run(board, folder, "firmware_tag")
    if track.replace("\r", "") != expected:
        fault(f"{board}: the tag's track is not the host's")
    else:
        print(f"== {BOARDS[board]}: the tag's track, {len(expected.splitlines())} lines, as on the host")


def title(symbol):
    return symbol.rstrip("_")


def table(results):
    def cell(row):
        return f"{row[0]:,} / {row[1]:,} / {row[2]:,}" if row else "—"

    lines = [
        "<!-- SPDX-License-Identifier: MIT -->",
        "# Flash, stack and instructions",
        "",
        "Written by `./dev firmware --write`, compared by `./dev firmware`. Each cell: bytes of flash of",
        "the function and all that it needs, bytes of stack (painted), most instructions of a call over",
        "the recorded inputs. `float`, `-O2` (`-Os` on the M0), arm-none-eabi-gcc of Debian 12. A tracker's most expensive",
        "call is its first fix or a late range that replays its window; its mean stands below.",
        "",
        "| function | " + " | ".join(BOARDS[board] for board in results) + " |",
        "| --- |" + " ---: |" * len(results),
    ]
    names = list(dict.fromkeys(name for rows in results.values() for name in rows))
    for name in names:
        cells = " | ".join(cell(rows.get(name)) for rows in results.values())
        lines.append(f"| `{title(name)}` | {cells} |")
    lines += ["", "Mean instructions of a call:", ""]
    lines += ["| function | " + " | ".join(BOARDS[board] for board in results) + " |"]
    lines += ["| --- |" + " ---: |" * len(results)]
    for name in names:
        if not name.startswith(("tracker", "bias", "fsri", "toa_least")):
            continue
        cells = " | ".join(f"{rows[name][3]:,}" if name in rows else "—" for rows in results.values())
        lines.append(f"| `{title(name)}` | {cells} |")
    return "\n".join(lines) + "\n"


def numbers(line):
    return [int(x.replace(",", "")) for x in re.findall(r"(?<= )\d[\d,]*(?= )", line)]


def compare(new, path):
    old = path.read_text() if path.is_file() else ""
    old_lines, new_lines = old.splitlines(), new.splitlines()
    if len(old_lines) != len(new_lines):
        fault(f"{path.name} has other rows; run ./dev firmware --write")
        return
    for before, after in zip(old_lines, new_lines):
        a, b = numbers(before), numbers(after)
        if not before.startswith("| `"):
            continue
        if before.split("|")[1] != after.split("|")[1] or len(a) != len(b):
            fault(f"{path.name}: another row: {after}")
        elif any(abs(x - y) > max(SLACK * x, SLACK_AT_LEAST) for x, y in zip(a, b)):
            fault(f"{path.name} is out of date:\n   was {before}\n   is  {after}")


def check_budgets(rows):
    for name, budget in BUDGETS.items():
        for what, most, is_ in zip(("bytes of flash", "bytes of stack", "instructions"), budget, rows[name]):
            if most is not None and is_ > most:
                fault(f"{title(name)}: {is_} {what}; the budget is {most}")
    # A range and the network on it, 200 times a second, beside 168 MHz.
    for tracker in ("tracker_point_3d", "tracker_planar_robot", "tracker_inertial"):
        update = rows[tracker][3] + rows["bias_network_21_50_50"][3]
        share = 200 * update / 168e6
        print(f"== {tracker}: {rows[tracker][3]} instructions a range, {update} with the network; "
              f"200 Hz take {100 * share:.1f} % of a 168 MHz M4F, {rows[tracker][0]} bytes of flash")
        if share > 0.25:
            fault(f"{tracker}: more than a quarter of the processor")


def main():
    build, path = Path(sys.argv[1]), Path(sys.argv[2])
    expected = (build / "host" / "track.txt").read_text() if (build / "host" / "track.txt").is_file() else ""
    results = {}
    for board in BOARDS:
        if not (build / board / "firmware_target").is_file():
            fault(f"{board}: not built")
            continue
        results[board] = measure(board, build / board)
        check_track(board, build / board, expected)
    if results.get("m4f"):
        check_budgets(results["m4f"])
    text = table(results)
    if "--write" in sys.argv:
        path.write_text(text)
    else:
        # Columns that the table does not have yet are not compared.
        old = path.read_text() if path.is_file() else ""
        compare(table({board: rows for board, rows in results.items() if BOARDS[board] in old}), path)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
