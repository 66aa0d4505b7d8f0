#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What embedded ecosystems take in, each tried as far as a host without their tools can.
  check.py amalgamated | all_tests | too_old | platformio | arduino | esp_idf | zephyr
Environment: SOURCE, WORK (a folder), CXX, EIGEN (the folder that holds Eigen/Core)."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

SOURCE, WORK = Path(os.environ["SOURCE"]), Path(os.environ["WORK"])
CXX, EIGEN = os.environ["CXX"], os.environ["EIGEN"]
HERE = SOURCE / "tests" / "packaging"
SKIPPED = 77
# Of most folders the file that is quick to compile. Everything: all_tests.
AMALGAMATED_TESTS = [
    "accuracy/test_dop", "core/test_angle", "core/test_result", "filter/test_gate",
    "geometry/test_height", "model/test_range", "ranging/test_ds_twr", "sim/test_device_clock",
    "solve/test_toa_closed_form", "time/test_rate_tracker",
]  # fmt: skip


def expect(condition, message):
    if not condition:
        sys.exit(f"{sys.argv[1]}: {message}")


def run(*command, **more):
    print("+", *command, flush=True)
    return subprocess.run([str(word) for word in command], check=True, text=True, **more)


def output(*command):
    return run(*command, capture_output=True).stdout


def version():
    header = (SOURCE / "include/uwbpos/core/version.hpp").read_text()
    return re.search(r'kVersion = "([^"]+)"', header).group(1)


def module(name, package):
    """A Python module that Debian has in `package`."""
    try:
        return __import__(name)
    except ImportError:
        print(f"SKIPPED: no Python module {name} ({package})")
        sys.exit(SKIPPED)


def amalgamate():
    out = WORK / "amalgamated"
    run(sys.executable, SOURCE / "scripts/amalgamate.py", out)
    return out


def compiler(*words):
    return [CXX, "-std=c++23", "-O0", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off",
            "-isystem", EIGEN, *words]  # fmt: skip


def check_too_old():
    """C++20 ends in one plain sentence, said first."""
    unit = WORK / "too_old.cpp"
    unit.write_text("#include <uwbpos/solve/locate.hpp>\n")
    failed = subprocess.run([CXX, "-std=c++20", "-fsyntax-only", "-isystem", EIGEN, "-I",
                             str(SOURCE / "include"), str(unit)],
                            capture_output=True, text=True, check=False)  # fmt: skip
    errors = [line for line in failed.stderr.splitlines() if "error:" in line]
    expect(errors and "uwbpos needs C++23" in errors[0], f"it says {errors[:1]}")


def check_amalgamated():
    """Some tests, compiled against the one header; and a program among Arduino's macros."""
    out = amalgamate()
    one = (out / "uwbpos.hpp").read_text()
    expect(f"uwbpos {version()}" in one.splitlines()[1], "no version in the second line")
    expect(not re.search(r'^#include "|^#pragma once', one, re.MULTILINE), "not in one piece")
    includes = re.findall(r"^#include .*", one, re.MULTILINE)
    expect(len(includes) == len(set(includes)), "something is included twice")

    files = ["main.cpp", *(f"{name}.cpp" for name in AMALGAMATED_TESTS)]
    unit = WORK / "amalgamated_tests.cpp"
    unit.write_text("".join(f'#include "{name}"\n' for name in files))
    flags = ["-DEIGEN_RUNTIME_NO_MALLOC", "-I", out / "include", "-I", SOURCE / "tests"]
    run(*compiler(*flags, unit, "-o", WORK / "amalgamated_tests"))
    run(WORK / "amalgamated_tests", "--no-intro", cwd=SOURCE)

    program = WORK / "amalgamated_program.cpp"
    macros = '#include "embedded/arduino_macros.hpp"\n'
    program.write_text(
        f'{macros}#include "uwbpos.hpp"\n{macros}'
        "int main() {\n"
        "  const uwbpos::RangeTo<float, 2> ranges[]{{{0, 0}, 5, 1}, {{6, 0}, 5, 1}, {{0, 8}, 5, 1}};\n"
        "  const auto fix = uwbpos::locate(ranges);\n"
        "  return fix && abs(fix->position.x() - 3) < 1e-5f && B1 == 1 ? 0 : 1;\n"
        "}\n"
    )
    run(*compiler("-I", out, "-I", SOURCE / "tests", program, "-o", WORK / "amalgamated_program"))
    run(WORK / "amalgamated_program")


def check_all_tests():
    """Every test of the library against the one header: the tests' own build, where include/ is
    replaced."""
    out, tree = amalgamate(), WORK / "all_tests"
    shutil.rmtree(tree, ignore_errors=True)
    tree.mkdir()
    for name in ("CMakeLists.txt", "cmake", "tests", "examples", "README.md"):
        (tree / name).symlink_to(SOURCE / name)
    shutil.copytree(out / "include", tree / "include")  # CMake looks for headers behind no link.
    run("cmake", "-G", "Ninja", "-S", tree, "-B", tree / "build", "-DCMAKE_BUILD_TYPE=Release",
        "-DCMAKE_CXX_FLAGS_RELEASE=-O1 -DNDEBUG", "-DUWBPOS_UNITY=ON", "-DUWBPOS_EXAMPLES=OFF",
        f"-DCMAKE_CXX_COMPILER={CXX}")  # fmt: skip
    run("cmake", "--build", tree / "build", "--target", "uwbpos_tests")
    run(tree / "build/tests/uwbpos_tests", "--no-intro", cwd=SOURCE)


def check_platformio():
    manifest = json.loads((SOURCE / "library.json").read_text())
    known = {"name", "version", "description", "keywords", "license", "homepage", "repository", "authors", "headers",
             "frameworks", "platforms", "dependencies", "build", "examples", "export"}  # fmt: skip
    expect(set(manifest) <= known, f"unknown fields: {set(manifest) - known}")
    expect(re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", manifest["name"]), "name")
    expect(len(manifest["description"]) <= 255, "the description is longer than 255 characters")
    expect(manifest["version"] == version(), "version")
    build = manifest["build"]
    expect(set(build) <= {"includeDir", "srcFilter"}, "unknown fields of build")
    expect((SOURCE / build["includeDir"] / manifest["headers"]).is_file(), "no such header")
    expect(build["srcFilter"] == ["-<*>"], "PlatformIO would compile the tests")
    for path in manifest["export"]["include"]:
        expect((SOURCE / path).exists(), f"no {path}")
    for example in manifest["examples"]:
        for file in example["files"]:
            path = f"{example['base']}/{file}"
            expect((SOURCE / path).is_file(), f"no {path}")
            expect(any(path.startswith(kept) for kept in manifest["export"]["include"]), file)


def properties(path):
    lines = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
    pairs = [line.partition("=") for line in lines]
    expect(all(equals for _, equals, _ in pairs), "a line that is no key=value")
    return {key: value for key, _, value in pairs}


def check_arduino():
    library = amalgamate() / "arduino" / "uwbpos"
    fields = properties(library / "library.properties")
    needed = "name version author maintainer sentence paragraph category url architectures".split()
    expect(all(fields.get(key) for key in needed), f"one of {needed} is missing")
    expect(set(fields) <= {*needed, "depends", "includes"}, "unknown fields")
    expect(re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9 _.\-]{0,62}", fields["name"]), "name")
    expect(not fields["name"].lower().startswith("arduino"), "a name that Arduino refuses")
    expect(fields["version"] == version(), "version")
    categories = ["Display", "Communication", "Signal Input/Output", "Sensors", "Device Control",
                  "Timing", "Data Storage", "Data Processing", "Other"]  # fmt: skip
    expect(fields["category"] in categories, "category")
    expect((library / "src" / fields["includes"]).is_file(), "no such header in src/")
    expect(not any(path.is_symlink() for path in library.rglob("*")), "symbolic links")
    expect(not (library / "include").exists(), "headers outside of src/")

    flags = ["-std=gnu++23", "-fno-exceptions", "-fno-rtti", "-isystem", EIGEN,
             "-I", HERE / "stubs", "-I", SOURCE / "tests", "-I", library / "src"]  # fmt: skip
    for sketch in sorted(library.glob("examples/*/*.ino")):
        expect(sketch.stem == sketch.parent.name, f"{sketch.name} is not named like its folder")
        # What the IDE makes of a sketch, and what a core does with it.
        unit, program = WORK / "sketch.cpp", WORK / "sketch"
        unit.write_text(
            f'#include <Arduino.h>\nvoid setup();\nvoid loop();\n#include "{sketch}"\n'
            "int main() {\n  setup();\n  loop();\n}\n"
        )
        run(CXX, *flags, "-Wall", "-Wextra", "-Werror", unit, "-o", program)
        expect(output(program) == "x = 3.01 m, y = 4.01 m\n", "the sketch prints something else")
        if cross := shutil.which("arm-none-eabi-g++"):
            run(cross, "-mcpu=cortex-m4", "-mthumb", "-Os", *flags, "-c", unit, "-o", WORK / "sketch.o")
        else:
            print("not compiled for Cortex-M: no arm-none-eabi-g++")


def cmake_consumer(how, *settings):
    build = WORK / how
    shutil.rmtree(build, ignore_errors=True)
    run("cmake", "-G", "Ninja", "-S", HERE / how, "-B", build, f"-DCMAKE_CXX_COMPILER={CXX}",
        f"-DUWBPOS_SOURCE={SOURCE}", *settings)  # fmt: skip
    run("cmake", "--build", build)
    run(build / "consumer")


def check_esp_idf():
    manifest = module("yaml", "python3-yaml").safe_load((SOURCE / "idf_component.yml").read_text())
    known = {"version", "description", "license", "url", "tags", "files", "dependencies"}
    expect(set(manifest) <= known, f"unknown fields: {set(manifest) - known}")
    expect(manifest["version"] == version(), "version")
    expect(manifest["dependencies"]["espressif/eigen"]["require"] == "public", "Eigen is not public")
    for pattern in manifest["files"]["exclude"]:
        expect((SOURCE / pattern.removesuffix("/**/*")).is_dir(), f"nothing to exclude: {pattern}")

    # ESP-IDF reads each component's CMakeLists.txt twice: as a script first, for what it requires.
    script = WORK / "requirements.cmake"
    script.write_text(
        "set(ESP_PLATFORM 1)\n"
        'macro(idf_component_register)\n  message("registered: ${ARGV}")\n  return()\nendmacro()\n'
        f'include("{SOURCE}/CMakeLists.txt")\n'
    )
    said = run("cmake", "-P", script, capture_output=True).stderr
    expect(said == "registered: INCLUDE_DIRS;include\n", f"as a script it says {said}")
    cmake_consumer("esp_idf", f"-DEIGEN={EIGEN}")


def check_kconfig(path):
    kconfiglib = module("kconfiglib", "python3-kconfiglib")
    root = WORK / "Kconfig"
    root.write_text(
        "config CPP\n\tbool\n\tprompt \"C++\"\n\nconfig STD_CPP2B\n\tbool\n\tprompt \"C++23\"\n\n"
        f'config REQUIRES_FULL_LIBCPP\n\tbool\n\nsource "{path}"\n'
    )
    tree = kconfiglib.Kconfig(str(root), warn_to_stderr=False)
    expect(not tree.warnings, f"{tree.warnings}")
    symbols = tree.syms
    for standard, offered in ((0, 0), (2, 2)):
        symbols["CPP"].set_value(2)
        symbols["STD_CPP2B"].set_value(standard)
        symbols["UWBPOS"].set_value(2)
        expect(symbols["UWBPOS"].tri_value == offered, f"UWBPOS with STD_CPP2B = {standard}")
        expect(symbols["REQUIRES_FULL_LIBCPP"].tri_value == offered, "REQUIRES_FULL_LIBCPP")


def check_zephyr():
    manifest = module("yaml", "python3-yaml").safe_load((SOURCE / "zephyr/module.yml").read_text())
    expect(set(manifest) == {"name", "build"}, "unknown fields")
    expect(set(manifest["build"]) == {"cmake", "kconfig"}, "unknown fields of build")
    check_kconfig(SOURCE / manifest["build"]["kconfig"])

    workspace = WORK / "workspace"
    shutil.rmtree(workspace, ignore_errors=True)
    (workspace / "zephyr").mkdir(parents=True)
    settings = [f"-DMODULE={manifest['build']['cmake']}", f"-DZEPHYR_BASE={workspace}/zephyr"]
    configure = ["cmake", "-S", HERE / "zephyr", "-B", WORK / "zephyr", f"-DUWBPOS_SOURCE={SOURCE}",
                 f"-DCMAKE_CXX_COMPILER={CXX}", "-G", "Ninja", *settings]  # fmt: skip
    shutil.rmtree(WORK / "zephyr", ignore_errors=True)
    run(*configure)  # Switched off.
    failed = subprocess.run([str(w) for w in (*configure, "-DCONFIG_UWBPOS=y")],
                            capture_output=True, text=True, check=False)  # fmt: skip
    expect(failed.returncode and "CONFIG_UWBPOS_EIGEN_DIR" in failed.stderr, "Eigen is not missed")
    (workspace / "modules/lib").mkdir(parents=True)
    (workspace / "modules/lib/eigen").symlink_to(EIGEN)
    cmake_consumer("zephyr", "-DCONFIG_UWBPOS=y", *settings)


WORK.mkdir(parents=True, exist_ok=True)
globals()[f"check_{sys.argv[1]}"]()
