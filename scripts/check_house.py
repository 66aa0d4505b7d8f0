#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The rules of the house that no compiler knows. One line per fault: file, line, what is wrong."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
INCLUDE = ROOT / "include"

# A header includes headers of its own folder and of lower layers.
LAYERS = {
    "core": 0,
    "time": 1, "geometry": 1,
    "model": 2, "ranging": 2, "frames": 2,
    "solve": 3, "accuracy": 3, "pose": 3,
    "filter": 4,
    "sim": 5,
}  # fmt: skip
MAX_HEADER_LINES = 220
EIGEN_GUARD = "uwbpos/core/eigen.hpp"
# What every header begins with and ends with, so that a sketch's macros do not reach into it.
MACRO_GUARDS = ["uwbpos/core/macros_off.hpp", "uwbpos/core/macros_back.hpp"]
WITHOUT_MACRO_GUARD = [*MACRO_GUARDS, "uwbpos/core/language.hpp", "uwbpos/uwbpos.hpp"]

WITHOUT_LICENCE_LINE = {".md", ".json", ".csv", ".tum", ".txt", ".svg", ".png", ""}
MACHINE_PATH = re.compile(r"(?<![\w.}])/(?:home|root|work|Users)/\w+")

# Files that other ecosystems read the version from, and how each states it.
MANIFESTS = {
    "library.json": r'"version": "(.*?)"',
    "packaging/arduino/library.properties": r"^version=(.*)",
    "idf_component.yml": r'^version: "(.*)"',
    "zephyr/module.yml": r"^# Release: uwbpos (.*)",
}

# Where releases are, as CMakeLists.txt has it and the manifests repeat it.
HOMEPAGE = r'HOMEPAGE_URL "(.*?)"'
HOMEPAGES = {
    "library.json": r'"homepage": "(.*?)"',
    "library.json, repository": r'"url": "(.*?)\.git"',
    "packaging/arduino/library.properties": r"^url=(.*)",
    "idf_component.yml": r'^url: "(.*)"',
}

# What firmware cannot have: heap, exceptions, virtual calls, printing, clocks, macros.
BANNED_HEADERS = set(
    "chrono condition_variable cstdio cstdlib deque filesystem format forward_list fstream "
    "functional future iomanip ios iostream istream list map memory mutex ostream print queue "
    "random regex set shared_mutex sstream stack stdexcept string thread unordered_map "
    "unordered_set vector".split()
)
BANNED_WORDS = re.compile(
    r"\b(?:new|delete(?!;)|throw|try|catch|virtual|dynamic_cast|typeid|thread_local|goto|mutable|"
    r"printf|malloc|free)\b(?!\w)"
)

faults = []


def fault(path, line, message):
    faults.append(f"{path.relative_to(ROOT)}:{line}: {message}")


def files():
    """What git tracks, or would if asked to."""
    listing = subprocess.run(
        ["git", "-c", "safe.directory=*", "ls-files", "-co", "--exclude-standard", "-z"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip
    return sorted(ROOT / name for name in set(listing.split("\0")) if name and (ROOT / name).is_file())


def text_of(path):
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return None


def without_comments(text):
    """The same lines, with comments and strings blanked."""
    blank = lambda match: re.sub(r"[^\n]", " ", match.group())
    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', blank, text, flags=re.DOTALL)


def check_layers(headers):
    for path in headers:
        folder = path.relative_to(INCLUDE / "uwbpos").parts[0]
        if path.parent == INCLUDE / "uwbpos":
            continue  # The umbrella; see check_umbrella.
        if folder not in LAYERS:
            fault(path, 1, f"folder {folder}/ has no layer in scripts/check_house.py")
            continue
        for number, line in enumerate(text_of(path).splitlines(), 1):
            include = re.match(r'\s*#\s*include\s*[<"](uwbpos/[^>"]+)[>"]', line)
            if not include:
                continue
            target = include.group(1)
            if not (INCLUDE / target).is_file():
                fault(path, number, f"includes {target}, which does not exist")
                continue
            other = target.split("/")[1]
            if other == folder:
                continue
            if LAYERS.get(other, 99) >= LAYERS[folder]:
                way = "sideways" if LAYERS.get(other) == LAYERS[folder] else "upwards"
                fault(path, number, f"{folder}/ (layer {LAYERS[folder]}) includes {way}: {target}")


def check_headers(headers):
    for path in headers:
        text = text_of(path)
        lines = text.splitlines()
        name = str(path.relative_to(INCLUDE))
        own = len(lines)
        if name not in WITHOUT_MACRO_GUARD:
            own -= 3  # The guards, and the empty line before the second.
            first, last = (f'#include "{guard}"' for guard in MACRO_GUARDS)
            if lines[2:3] != [first] or lines[-1:] != [last]:
                fault(path, 3, f"line 3 is not {first}, or the last one not {last}")
        if own > MAX_HEADER_LINES:
            fault(path, len(lines), f"{own} lines; more than {MAX_HEADER_LINES} are two headers")
        if "#pragma once" not in lines and name not in MACRO_GUARDS:
            fault(path, 1, "no #pragma once")
        if "/// @file" not in lines:
            fault(path, 1, "no '/// @file' comment")
        code = without_comments(text).splitlines()
        for number, line in enumerate(code, 1):
            include = re.match(r"\s*#\s*include\s*<([^>]+)>", line)
            if include and include.group(1) in BANNED_HEADERS:
                fault(path, number, f"<{include.group(1)}> is not for firmware")
            if include and include.group(1).startswith("Eigen/") and name != EIGEN_GUARD:
                fault(path, number, f"Eigen comes through {EIGEN_GUARD} only")
            if re.match(r"\s*#\s*define\b", line):
                fault(path, number, "a macro")
            for word in BANNED_WORDS.findall(line):
                fault(path, number, f"'{word}' does not belong into include/")


def check_macro_guards():
    """What is set aside is given back."""
    off, back = (text_of(INCLUDE / guard) for guard in MACRO_GUARDS)
    pushed = re.findall(r'#pragma push_macro\("(\w+)"\)\n#undef (\w+)', off)
    popped = re.findall(r'#pragma pop_macro\("(\w+)"\)', back)
    if [name for name, _ in pushed] != popped or [name for _, name in pushed] != popped:
        fault(INCLUDE / MACRO_GUARDS[0], 1, f"not the names that {MACRO_GUARDS[1]} gives back")


def check_umbrella(headers):
    umbrella = INCLUDE / "uwbpos" / "uwbpos.hpp"
    included = set(re.findall(r'#include "(uwbpos/[^"]+)"', text_of(umbrella)))
    public = {str(p.relative_to(INCLUDE)) for p in headers if p != umbrella}
    wanted = {name for name in public if not name.startswith("uwbpos/sim/")} - set(MACRO_GUARDS)
    for name in sorted(wanted - included):
        fault(umbrella, 1, f"does not include {name}")
    for name in sorted(included - wanted):
        fault(umbrella, 1, f"includes {name}, which is not a public header outside sim/")


def check_version(paths):
    header = INCLUDE / "uwbpos" / "core" / "version.hpp"
    version = re.search(r'kVersion = "(\d+\.\d+\.\d+)"', text_of(header)).group(1)
    changelog = ROOT / "CHANGELOG.md"
    entry = re.search(r"^## \[(\d+\.\d+\.\d+)\]", text_of(changelog), re.MULTILINE)
    if not entry or entry.group(1) != version:
        found = entry.group(1) if entry else "none"
        fault(changelog, 1, f"newest version is {found}, but core/version.hpp says {version}")
    for name, pattern in MANIFESTS.items():
        stated = re.search(pattern, text_of(ROOT / name), re.MULTILINE)
        found = stated.group(1) if stated else "none"
        if found != version:
            fault(ROOT / name, 1, f"version {found}, but core/version.hpp says {version}")
    # Elsewhere a version is read from the header, or is one of these and is held to it.
    stated = re.compile(
        r"GIT_TAG v(\d+\.\d+\.\d+)|project\(uwbpos[^)]*VERSION (\d[\d.]*)|PROJECT_NUMBER *= *(\d[\d.]*)"
        r"|^Version: *(\d[\d.]*)|uwbpos (\d+\.\d+\.\d+)",
        re.MULTILINE,
    )
    for path in paths:
        text = text_of(path)
        for match in stated.finditer(text or ""):
            found = next(group for group in match.groups() if group)
            if found != version:
                line = text.count("\n", 0, match.start()) + 1
                fault(path, line, f"version {found}, but core/version.hpp says {version}")


def check_homepage():
    homepage = re.search(HOMEPAGE, text_of(ROOT / "CMakeLists.txt")).group(1)
    for name, pattern in HOMEPAGES.items():
        path = ROOT / name.split(",")[0]
        stated = re.search(pattern, text_of(path), re.MULTILINE)
        found = stated.group(1) if stated else "none"
        if found != homepage:
            fault(path, 1, f"homepage {found}, but CMakeLists.txt says {homepage}")


def check_texts(paths):
    for path in paths:
        text = text_of(path)
        if text is None or "corpus" in path.parts:
            continue
        lines = text.splitlines()
        can_hold = path.suffix not in WITHOUT_LICENCE_LINE or (lines and lines[0].startswith("#!"))
        if can_hold and not any("SPDX-License-Identifier: MIT" in line for line in lines[:3]):
            fault(path, 1, "no 'SPDX-License-Identifier: MIT' in the first three lines")
        for number, line in enumerate(lines, 1):
            if MACHINE_PATH.search(line):
                fault(path, number, f"a machine's path: {MACHINE_PATH.search(line).group()}")
            if line != line.rstrip() and path.suffix != ".md":
                fault(path, number, "trailing spaces")
        if text and not text.endswith("\n"):
            fault(path, len(lines), "no newline at the end")
        if path.suffix == ".md":
            check_links(path, text)


def check_links(path, text):
    for match in re.finditer(r"\]\((?!https?:|mailto:|#)([^)#\s]+)", text):
        if not (path.parent / match.group(1)).exists():
            fault(path, text.count("\n", 0, match.start()) + 1, f"dead link: {match.group(1)}")


def check_features():
    """The feature table names files that exist."""
    table = ROOT / "docs" / "features.md"
    folders = (None, None, INCLUDE / "uwbpos", ROOT / "tests", ROOT / "bench", ROOT / "examples")
    for number, line in enumerate(text_of(table).splitlines(), 1):
        for folder, cell in zip(folders, line.split("|")):
            for name in re.findall(r"`([^`]+)`", cell) if folder else []:
                if not (folder / name).exists():
                    fault(table, number, f"no such file: {(folder / name).relative_to(ROOT)}")
        check_benches(table, number, line)


def check_benches(table, number, line):
    """A bench that a row names includes one of the row's headers, itself or through a header that it
    includes."""
    cells = line.split("|")
    if len(cells) < 5:
        return
    headers = {f"uwbpos/{name}" for name in re.findall(r"`([^`]+\.hpp)`", cells[2])}
    for name in re.findall(r"`(bench_\w+\.cpp)`", cells[4]):
        seen = set()
        left = [ROOT / "bench" / name]
        while left:
            path = left.pop()
            if not path.is_file():
                continue
            for include in re.findall(r'#include [<"]([^>"]+)[>"]', text_of(path)):
                if include in seen:
                    continue
                seen.add(include)
                left += [INCLUDE / include, path.parent / include]
        if not headers & seen:
            fault(table, number, f"bench/{name} includes none of this row's headers")


def check_hard_use():
    """The cases that docs/hard_use.md names exist in that file, and run in float and in double
    unless it says otherwise."""
    table = ROOT / "docs" / "hard_use.md"
    case = r"`([\w/]+\.cpp)`: “([^”]*)”( \(\*[a-z ]+\*\))?"
    cases = {}
    named = 0
    for number, line in enumerate(text_of(table).splitlines(), 1):
        for name, sentence, mark in re.findall(case, line):
            path = ROOT / "tests" / name
            if path not in cases:
                cases[path] = cases_of(text_of(path)) if path.is_file() else {}
            named += 1
            if sentence not in cases[path]:
                fault(table, number, f"tests/{name} has no case “{sentence}”")
            elif cases[path][sentence] == bool(mark) and not name.startswith("host/"):
                fault(table, number, f"marked as no template, or not marked as none: “{sentence}”")
        if not line.startswith("| ") or re.match(r"\| (?:hazard|---) ", line):
            continue
        proof = line.split(" | ")[-1]
        cited = len(re.findall(r"`[\w/]+\.cpp`", proof))
        if cited != len(re.findall(case, proof)):
            fault(table, number, "a case is written `folder/test_file.cpp`: “its name”")
        scripts = re.findall(r"`(scripts/\w+\.py)`", proof)
        if cited == 0 and not scripts:
            fault(table, number, "a row without a proof")
        for script in scripts:
            if not (ROOT / script).is_file():
                fault(table, number, f"no such file: {script}")
    if named == 0:
        fault(table, 1, "names no case")


def cases_of(text):
    """Names of doctest cases, neighbouring literals joined; whether each is one of float and double."""
    pattern = r'\bTEST_CASE(?:_TEMPLATE)?\(\s*((?:"(?:\\.|[^"\\\n])*"\s*)+)([,)][^{]*)'
    return {
        "".join(re.findall(r'"((?:\\.|[^"\\])*)"', literals)): "float, double)" in " ".join(rest.split())
        for literals, rest in re.findall(pattern, text)
    }


def main():
    paths = files()
    headers = sorted((INCLUDE / "uwbpos").rglob("*.hpp"))
    check_layers(headers)
    check_headers(headers)
    check_macro_guards()
    check_umbrella(headers)
    check_version(paths)
    check_homepage()
    check_features()
    check_hard_use()
    check_texts(paths)
    print("\n".join(faults) if faults else f"house rules: {len(paths)} files, no fault")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
