#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes what a release hands out besides the sources, into a folder (build/amalgamated):

uwbpos.hpp    all that include/uwbpos/uwbpos.hpp includes, in one file: not sim/
include/      a tree in which each header of the library includes that file, for its tests
arduino/      an Arduino library: the headers in src/, library.properties, examples
"""

import re
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
INCLUDE = ROOT / "include"
OFF, BACK = "uwbpos/core/macros_off.hpp", "uwbpos/core/macros_back.hpp"
LANGUAGE, EIGEN = "uwbpos/core/language.hpp", "uwbpos/core/eigen.hpp"
OWN = re.compile(r'^#include "(uwbpos/[^"]+)"\n', re.MULTILINE)
FOREIGN = re.compile(r"^#include <([^>]+)>\n", re.MULTILINE)


def text_of(name):
    return (INCLUDE / name).read_text(encoding="utf-8")


def version():
    return re.search(r'kVersion = "([^"]+)"', text_of("uwbpos/core/version.hpp")).group(1)


def in_order(name, done):
    """The headers that `name` includes and then itself, each after those that it includes."""
    if name in (OFF, BACK) or name in done:
        return
    done[name] = None  # Before its includes, so that a cycle would end; see the sort below.
    for other in OWN.findall(text_of(name)):
        in_order(other, done)
    done[name] = done.pop(name)


def body_of(name):
    text = text_of(name)
    for pattern in (OWN, FOREIGN):
        text = pattern.sub("", text)
    text = text.replace("// SPDX-License-Identifier: MIT\n", "").replace("#pragma once\n", "")
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n") + "\n"


def amalgamated():
    headers = {}
    in_order("uwbpos/uwbpos.hpp", headers)
    del headers["uwbpos/uwbpos.hpp"]
    headers = [name for name in headers if name not in (LANGUAGE, EIGEN)]
    standard = sorted({found for name in headers for found in FOREIGN.findall(text_of(name))})
    strangers = [name for name in standard if not re.fullmatch(r"[a-z_]+", name)]
    if strangers:
        sys.exit(f"not of the standard library: {strangers}")
    eigen = text_of(EIGEN)
    eigen = eigen[eigen.index("#pragma GCC diagnostic push") :]
    eigen = OWN.sub("", eigen)

    licence = "".join(f"// {line}".rstrip() + "\n" for line in (ROOT / "LICENSE").read_text().splitlines())
    parts = [
        "// SPDX-License-Identifier: MIT\n",
        f"// uwbpos {version()}, all of it but the simulator in one header. Made from include/ by\n"
        "// `./dev amalgamate`; change it there. Needs Eigen 3.4 and C++23.\n//\n" + licence + "\n",
        "#ifndef UWBPOS_AMALGAMATED_HPP\n#define UWBPOS_AMALGAMATED_HPP\n\n",
        body_of(LANGUAGE) + "\n" + body_of(OFF) + "\n",
        "".join(f"#include <{name}>\n" for name in standard) + "\n" + eigen,
    ]
    parts += [f"\n// ==== {name}\n\n{body_of(name)}" for name in headers]
    parts += [f"\n// ==== {BACK}\n\n{body_of(BACK)}", "\n#endif  // UWBPOS_AMALGAMATED_HPP\n"]
    return "".join(parts)


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def main():
    out = Path(sys.argv[1]) if len(sys.argv) == 2 else ROOT / "build" / "amalgamated"
    for made in ("include", "arduino"):
        shutil.rmtree(out / made, ignore_errors=True)
    one = amalgamated()
    write(out / "uwbpos.hpp", one)

    write(out / "include" / "uwbpos_amalgamated.hpp", one)
    for path in INCLUDE.rglob("*.hpp"):
        name = str(path.relative_to(INCLUDE))
        if name.startswith("uwbpos/sim/") or name in (OFF, BACK, LANGUAGE):
            write(out / "include" / name, text_of(name))
        else:
            # CMakeLists.txt reads the version in core/version.hpp, and only there.
            said = f'// kVersion = "{version()}"\n' if name == "uwbpos/core/version.hpp" else ""
            write(out / "include" / name, f'#pragma once\n{said}#include "uwbpos_amalgamated.hpp"\n')

    shutil.copytree(ROOT / "packaging" / "arduino", out / "arduino" / "uwbpos")
    shutil.copytree(INCLUDE / "uwbpos", out / "arduino" / "uwbpos" / "src" / "uwbpos")
    shutil.copy(ROOT / "LICENSE", out / "arduino" / "uwbpos" / "LICENSE")
    print(f"{out / 'uwbpos.hpp'}: uwbpos {version()}, {one.count(chr(10))} lines")


if __name__ == "__main__":
    main()
