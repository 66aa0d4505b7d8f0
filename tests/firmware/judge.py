#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the firmware images under QEMU, judges results and budgets, compares or writes the table.

judge.py BUILD TABLE [--write]: BUILD holds a folder per board and host/track.txt.
"""

import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from deepest import Graph, Unbounded, sections

BOARDS = {
    "m4f": "Cortex-M4F", "m7": "Cortex-M7", "m33": "Cortex-M33", "m3": "Cortex-M3", "m0": "Cortex-M0",
}  # fmt: skip

# On the M4F: what a function may take. (1.6 KB of 1,024 bytes.)
BUDGETS = {
    "toa_refine_3d_8": {"flash": 1638, "stack": 300, "instructions": 2500},
    "toa_least_squares_3d_8": {"instructions": 2500},
    "ds_twr_range_asymmetric": {"instructions": 150},
    "kalman_update_6_3": {"instructions": 700},
    "two_tag_pose_": {"instructions": 400},
}
# Functions that call themselves, and how deep in a case: once for each receiver.
NESTED = {"fsri_3": {"FsriSearchIfLi2EE4join": 3}, "fsri_4": {"FsriSearchIfLi2EE4join": 4}}
UNITS = {"flash": "bytes of flash", "stack": "bytes of stack", "instructions": "instructions"}

# How far the checked-in table may be from what is measured: compilers differ by a little.
SLACK = 0.10
SLACK_AT_LEAST = 32

FORBIDDEN = {
    "the heap": re.compile(r"_*(malloc|free|realloc|calloc)(_r)?|_sbrk|_Zn[wa]\w+|_Zd[la]\w+"),
    "exceptions": re.compile(r"__cxa_(throw|rethrow|begin_catch|allocate_exception)|_Unwind_\w+|_ZSt9terminatev"),
    "streams": re.compile(r"_ZSt4c(out|err|in|log)|_ZNSt8ios_base\w+|_ZNSo\w+|\w*printf\w*|puts|_Zls\w+"),
    "double": re.compile(r"__aeabi_d\w+|__aeabi_\w+2d|__(add|sub|mul|div|extendsf|trunc)df\w+"),
}
# Double in hardware, which the M7 has.
DOUBLE_CODE = re.compile(r"\tv(?!ldr|str|mov|push|pop)\w+\.f64")


@dataclass
class Row:
    """What a function takes on a board."""

    flash: int
    painted: int
    deepest: int
    most: int
    mean: int

    def taken(self, what):
        return {"flash": self.flash, "stack": max(self.painted, self.deepest), "instructions": self.most}[what]


faults = []


def fault(text):
    faults.append(text)
    print(f"!! {text}", flush=True)


def tool(*command):
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout


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


def sizes_of(folder):
    """{symbol: text and data of the image of it alone}."""
    images = sorted(folder.glob("size_*[!a-z.]")) + sorted(folder.glob("size_*[a-z]"))
    images = [path for path in images if path.is_file() and os.access(path, os.X_OK)]
    sizes = {}
    for line in tool("arm-none-eabi-size", *images).splitlines()[1:]:
        text, data, *_, path = line.split()
        sizes[Path(path).name.removeprefix("size_")] = int(text) + int(data)
    return sizes


def check_symbols(board, name, symbols):
    """`symbols`: what nm prints."""
    for line in symbols.splitlines():
        symbol = line.split()[-1] if line.split() else ""
        for what, pattern in FORBIDDEN.items():
            if pattern.fullmatch(symbol):
                fault(f"{board}: {name} holds {symbol}, which belongs to {what}")


def check_code(board, name, code):
    """`code`: what objdump prints."""
    found = DOUBLE_CODE.search(code)
    if found:
        fault(f"{board}: {name} calculates in double:{found.group()}")


def check_image(board, folder, name):
    """Returns its symbols and its machine code."""
    symbols = tool("arm-none-eabi-nm", folder / name)
    check_symbols(board, name, symbols)
    code = tool("arm-none-eabi-objdump", "-d", folder / name)
    check_code(board, name, code)
    return symbols, code


def read_cases(board, output):
    """[(name, most, mean, painted)] of what firmware_target prints, and how many words were right."""
    cases, words = [], 0
    for line in output.splitlines():
        found = re.match(r"case (\w+) (\d+) (\d+) (\d+) (\d+) (\d+)$", line)
        if not found:
            continue
        total, different, most, mean, painted = (int(x) for x in found.groups()[1:])
        words += total - different
        if different:
            fault(f"{board}: {found.group(1)}: {different} of {total} words differ from the host's")
        cases.append((found.group(1), most, mean, painted))
    return cases, words


def compiled(board, folder, image):
    """The linker's map of an image, and {object in it: what the compiler says of its calls}."""
    map_text = (folder / f"{image}.map").read_text()
    graphs = {}
    for name in {name for _, name in sections(map_text) if name.startswith("CMakeFiles/")}:
        path = (folder / name).with_suffix(".ci")
        if path.is_file():
            graphs[name] = path.read_text()
        else:
            fault(f"{board}: no call graph of {name}")
    if not graphs:
        fault(f"{board}: no call graph of {image}")
    return map_text, graphs


def check_stack(board, name, graph, painted):
    """The deepest path, which holds what was painted."""
    try:
        deepest = graph.deepest(name, NESTED.get(name))
    except Unbounded as reason:
        fault(f"{board}: {title(name)}: no bound of its stack: {reason}")
        return 0
    if painted > deepest:
        fault(f"{board}: {title(name)}: {painted} bytes of stack painted, {deepest} on the deepest path")
    return deepest


def measure(board, folder):
    """{function: Row}."""
    sizes = sizes_of(folder)
    rows, words = {}, 0
    for group in ("fixes", "tracks"):
        image = f"firmware_target_{group}"
        cases, right = read_cases(board, run(board, folder, image))
        words += right
        if not cases:
            fault(f"{board}: no case of {image} ran")
        symbols, code = check_image(board, folder, image)
        graph = Graph(code, symbols, *compiled(board, folder, image))
        for name, most, mean, painted in cases:
            deepest = check_stack(board, name, graph, painted)
            rows[name] = Row(sizes[name] - sizes["no_function"], painted, deepest, most, mean)
    print(f"== {BOARDS[board]}: {len(rows)} functions, {words} words as on the host", flush=True)
    return rows


def check_track(board, folder, expected):
    if not (folder / "firmware_tag").is_file():
        return
    check_image(board, folder, "firmware_tag")
    track = run(board, folder, "firmware_tag")
    if track.replace("\r", "") != expected or not expected:
        fault(f"{board}: the tag's track is not the host's")
    else:
        print(f"== {BOARDS[board]}: the tag's track, {len(expected.splitlines())} lines, as on the host")


def check_guard(board, folder):
    """The linker script refuses each of what it is there for, by name, and nothing else."""
    for what in ("nothing", "heap", "exceptions", "streams"):
        done = subprocess.run(["cmake", "--build", str(folder), "--target", f"guard_{what}"],
                              capture_output=True, text=True)  # fmt: skip
        said = re.search(rf"\b{what} (was|were) linked in", done.stdout + done.stderr)
        if what == "nothing" and done.returncode != 0:
            fault(f"{board}: an empty program does not link: {(done.stdout + done.stderr)[-300:]}")
        elif what != "nothing" and (done.returncode == 0 or not said):
            fault(f"{board}: the linker script lets {what} in")


def title(symbol):
    return symbol.rstrip("_")


def budget_rows(rows):
    """[(function, what, budget, taken)]."""
    return [
        (name, what, most, rows[name].taken(what))
        for name, budget in BUDGETS.items()
        for what, most in budget.items()
        if name in rows
    ]


def check_budgets(rows):
    for name in BUDGETS:
        if name not in rows:
            fault(f"{title(name)}, which has a budget, did not run")
    for name, what, most, taken in budget_rows(rows):
        if taken > most:
            fault(f"{title(name)}: {taken:,} {UNITS[what]}; the budget is {most:,}")


def check_load(rows):
    """A range and the network on it, 200 times a second, beside 168 MHz."""
    network = rows["bias_network_21_50_50"].mean
    for name, row in rows.items():
        if not name.startswith("tracker"):
            continue
        share = 200 * (row.mean + network) / 168e6
        print(f"== {title(name)}: {row.mean} instructions a measurement, {row.mean + network} with the network; "
              f"200 Hz take {100 * share:.1f} % of a 168 MHz M4F")
        if share > 0.25:
            fault(f"{title(name)}: more than a quarter of the processor")


def table(results):
    def cell(row):
        return f"{row.flash:,} / {row.painted:,} / {row.deepest:,} / {row.most:,}" if row else "—"

    def head():
        return ["| function | " + " | ".join(BOARDS[board] for board in results) + " |",
                "| --- |" + " ---: |" * len(results)]  # fmt: skip

    lines = [
        "<!-- SPDX-License-Identifier: MIT -->",
        "# Flash, stack and instructions",
        "",
        "Written by `./dev firmware --write`, compared by `./dev firmware`. Each cell: bytes of flash of",
        "the function and all that it needs / bytes of stack as painted over the recorded inputs / the",
        "same along the deepest path of calls by `-fstack-usage` / most instructions of a call over the",
        "recorded inputs. `float`, `-O2` (`-Os` on the M0), arm-none-eabi-gcc of Debian 12. A tracker's",
        "most expensive call is its first fix or a late range that replays its window; means stand below.",
        "",
        *head(),
    ]
    names = list(dict.fromkeys(name for rows in results.values() for name in rows))
    for name in names:
        cells = " | ".join(cell(rows.get(name)) for rows in results.values())
        lines.append(f"| `{title(name)}` | {cells} |")
    lines += ["", "Mean instructions of a call:", "", *head()]
    for name in names:
        if not name.startswith(("tracker", "bias", "fsri", "toa_least", "toa_refine")):
            continue
        cells = " | ".join(f"{rows[name].mean:,}" if name in rows else "—" for rows in results.values())
        lines.append(f"| `{title(name)}` | {cells} |")
    lines += [
        "",
        "Budgets on the Cortex-M4F; one that is exceeded fails the build.",
        "",
        "| function | budget | taken |",
        "| --- | ---: | ---: |",
    ]
    for name, what, most, taken in budget_rows(results.get("m4f", {})):
        lines.append(f"| `{title(name)}` | {most:,} {UNITS[what]} | {taken:,} |")
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
        if not before.startswith("| `"):
            continue
        a, b = numbers(before), numbers(after)
        if before.split("|")[1] != after.split("|")[1] or len(a) != len(b):
            fault(f"{path.name}: another row: {after}")
        elif any(abs(x - y) > max(SLACK * x, SLACK_AT_LEAST) for x, y in zip(a, b)):
            fault(f"{path.name} is out of date:\n   was {before}\n   is  {after}")


def main():
    build, path = Path(sys.argv[1]), Path(sys.argv[2])
    track = build / "host" / "track.txt"
    expected = track.read_text() if track.is_file() else ""

    def judge(board):
        if not (build / board / "emulator").is_file():
            fault(f"{board}: not built")
            return {}
        rows = measure(board, build / board)
        check_track(board, build / board, expected)
        check_guard(board, build / board)
        return rows

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        results = dict(zip(BOARDS, pool.map(judge, BOARDS)))
    if results["m4f"]:
        check_budgets(results["m4f"])
        check_load(results["m4f"])
    text = table(results)
    if "--write" in sys.argv:
        path.write_text(text)
    else:
        compare(text, path)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
