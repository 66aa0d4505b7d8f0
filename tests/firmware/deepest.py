# SPDX-License-Identifier: MIT
"""Bounds on stack: the deepest path of a function's calls. Frames and calls are the compiler's
(-fcallgraph-info=su, which holds what -fstack-usage tells) and those of the machine code, which a
library's functions have alone."""

import re
from bisect import bisect_right
from functools import lru_cache


class Unbounded(Exception):
    """A frame or a call whose depth nothing tells."""


class Graph:
    """{function: bytes of its frame} and {function: functions that it calls}."""

    def __init__(self):
        self.frames = {}
        self.calls = {}
        self.dynamic = set()

    def add_call_graph(self, text):
        """A .ci file. Of a function that several objects hold, the larger frame and all calls."""
        plain = lambda title: title.rsplit(":", 1)[-1]
        for title, label in re.findall(r'^node: \{ title: "([^"]*)" label: "([^"]*)"', text, re.MULTILINE):
            size = re.search(r"\\n(\d+) bytes \(([^)]*)\)", label)
            if size:
                name = plain(title)
                self.frames[name] = max(self.frames.get(name, 0), int(size.group(1)))
                if size.group(2) != "static" and "bounded" not in size.group(2):
                    self.dynamic.add(name)
        for source, target in re.findall(
            r'^edge: \{ sourcename: "([^"]*)" targetname: "([^"]*)"', text, re.MULTILINE
        ):
            self.calls.setdefault(plain(source), set()).add(plain(target))

    def add_machine_code(self, text):
        """What `objdump -d` says. The compiler's sizes lack what some prologues push: the larger counts."""
        # Sizes of memory that the linker knows are no functions, though objdump takes them for such.
        heads = re.findall(r"^([0-9a-f]+) <(?!ROM|RAM)([^>]+)>:$", text, re.MULTILINE)
        starts = [int(address, 16) for address, _ in heads]
        names = [name for _, name in heads]
        words = dict(re.findall(r"^\s*([0-9a-f]+):\t[0-9a-f ]+\t\.word\t0x([0-9a-f]+)", text, re.MULTILINE))
        sizes = dict.fromkeys(names, 0)
        literals = {}
        for at, mnemonic, operands in re.findall(
            r"^\s*([0-9a-f]+):\t[0-9a-f ]+\t(\S+)[ \t]*(.*)", text, re.MULTILINE
        ):
            place = bisect_right(starts, int(at, 16)) - 1
            if place < 0:
                continue
            name = names[place]
            sizes[name] += pushed(mnemonic, operands)
            register = operands.split(",")[0]
            if mnemonic == "add" and register == "sp" and (by := operands.split(", ")[1]) in literals:
                taken = int(literals[by], 16)
                sizes[name] += 2**32 - taken if taken >= 2**31 else 0
            literal = re.match(r"(r\d+), \[pc, #\d+\]\s+@ \(([0-9a-f]+)", operands)
            literals.pop(register, None)
            if mnemonic.startswith("ldr") and literal and literal.group(2) in words:
                literals[register] = words[literal.group(2)]
            to = re.match(r"(?:r\d+, )?([0-9a-f]+) <", operands)
            if mnemonic.startswith(("b", "cb")) and to:
                target = int(to.group(1), 16)
                callee = bisect_right(starts, target) - 1
                if callee != place or (mnemonic == "bl" and target == starts[place]):
                    self.calls.setdefault(name, set()).add(names[callee])
            elif mnemonic == "blx":
                self.calls.setdefault(name, set()).add("__indirect_call")
        for name, size in sizes.items():
            self.frames[name] = max(self.frames.get(name, 0), size)

    def add_symbols(self, text):
        """What `nm` says: other names of the same code, and calls that became instructions."""
        places = {}
        for address, name in re.findall(r"^([0-9a-f]+) [TtWw] (\S+)$", text, re.MULTILINE):
            places.setdefault(int(address, 16) & ~1, []).append(name)
        for names in places.values():
            known = [name for name in names if name in self.frames]
            for name in names if known else []:
                if name not in self.frames:
                    self.calls[name] = {known[0]}
                    self.frames[name] = 0
        linked = {name for names in places.values() for name in names} | {"__indirect_call"}
        for callees in self.calls.values():
            callees &= linked | set(self.frames)

    def deepest(self, function, nested=None):
        """Bytes of stack from the call of `function` on. `nested`: {part of a name: how often such a
        function is in its own path}, where it calls itself."""
        path = []
        nested = nested or {}

        @lru_cache(maxsize=None)
        def below(name):
            if name in path:
                raise Unbounded(f"{name} calls itself")
            if name in self.dynamic:
                raise Unbounded(f"the frame of {name} has no fixed size")
            if name not in self.frames:
                raise Unbounded(f"nothing is known of {name}")
            path.append(name)
            callees = self.calls.get(name, set())
            times = next((times for part, times in nested.items() if part in name), 1)
            if times > 1:
                callees = callees - {name}
            depth = max((below(callee) for callee in callees), default=0)
            path.pop()
            return times * self.frames[name] + depth

        return below(function)


def pushed(mnemonic, operands):
    """Bytes that an instruction takes from the stack; a path that pushes twice counts both."""
    registers = re.search(r"\{([^}]*)\}", operands)
    if mnemonic.startswith(("push", "vpush")) or (
        mnemonic.startswith("stmdb") and operands.startswith("sp!")
    ):
        count = 0
        for part in registers.group(1).replace(" ", "").split(","):
            ends = re.findall(r"\d+", part)
            count += int(ends[1]) - int(ends[0]) + 1 if "-" in part else 1
        return count * (8 if "d" in registers.group(1) else 4)
    if mnemonic.startswith("sub") and (size := re.match(r"sp, (?:sp, )?#(\d+)", operands)):
        return int(size.group(1))
    if mnemonic.startswith("str") and (size := re.search(r"\[sp, #-(\d+)\]!", operands)):
        return int(size.group(1))
    return 0
