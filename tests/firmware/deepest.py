# SPDX-License-Identifier: MIT
"""Bounds on stack: the deepest path of a function's calls in a linked image. Which functions are in
it and whom they call, its machine code says; a frame is the larger of what the machine code pushes
and what the compiler tells (-fcallgraph-info=su, which holds what -fstack-usage tells) of that
function in the object it was linked from. Two objects may hold different functions of one name, or
one inlined differently: the linker's map tells them apart."""

import re
from bisect import bisect_right
from functools import lru_cache


class Unbounded(Exception):
    """A frame or a call whose depth nothing tells."""


def call_graph(text):
    """{function: (bytes of its frame, that is fixed, it calls through a pointer)} of a .ci file."""
    plain = lambda title: title.rsplit(":", 1)[-1]
    indirect = {
        plain(source)
        for source, target in re.findall(r'^edge: \{ sourcename: "([^"]*)" targetname: "([^"]*)"', text, re.MULTILINE)
        if target == "__indirect_call"
    }
    functions = {}
    for title, label in re.findall(r'^node: \{ title: "([^"]*)" label: "([^"]*)"', text, re.MULTILINE):
        if size := re.search(r"\\n(\d+) bytes \(([^)]*)\)", label):
            fixed = size.group(2) == "static" or "bounded" in size.group(2)
            functions[plain(title)] = (int(size.group(1)), fixed, plain(title) in indirect)
    return functions


def sections(text):
    """[(first address, object)] of the code of a linker's map, in order."""
    placed = text[text.find("Linker script and memory map") :]  # Before it, what was left out.
    found = re.findall(r"^ \.text\S*\s+0x([0-9a-f]+)\s+0x([0-9a-f]+) (.+)$", placed, re.MULTILINE)
    return sorted((int(first, 16), name) for first, size, name in found if int(size, 16))


class Graph:
    """{address of a function: bytes of its frame} and {address: addresses that it calls}."""

    def __init__(self, code, symbols, map_text="", call_graphs=None):
        """What `objdump -d` and `nm` say, the linker's map, and {object: its .ci file}."""
        # Sizes of memory that the linker knows are no functions, though objdump takes them for such.
        heads = re.findall(r"^([0-9a-f]+) <(?!ROM|RAM)([^>]+)>:$", code, re.MULTILINE)
        self.names = {int(address, 16): name for address, name in heads}
        self.starts = sorted(self.names)
        self.frames = dict.fromkeys(self.starts, 0)
        self.calls = {start: set() for start in self.starts}
        self.unfixed = {}
        # Other names of the same code, too.
        self.address = {name: int(address, 16) & ~1
                        for address, name in re.findall(r"^([0-9a-f]+) [TtWw] (\S+)$", symbols, re.MULTILINE)}  # fmt: skip
        self.read_machine_code(code)
        self.read_call_graphs(map_text, call_graphs or {})

    def read_machine_code(self, text):
        words = dict(re.findall(r"^\s*([0-9a-f]+):\t[0-9a-f ]+\t\.word\t0x([0-9a-f]+)", text, re.MULTILINE))
        literals = {}
        last = None
        for at, mnemonic, operands in re.findall(
            r"^\s*([0-9a-f]+):\t[0-9a-f ]+\t(\S+)[ \t]*(.*)", text, re.MULTILINE
        ):
            place = bisect_right(self.starts, int(at, 16)) - 1
            if place < 0:
                continue
            start = self.starts[place]
            if start != last:
                literals.clear()
                last = start
            self.frames[start] += pushed(mnemonic, operands)
            register = operands.split(",")[0]
            if mnemonic == "add" and register == "sp" and (by := operands.split(", ")[1]) in literals:
                taken = int(literals[by], 16)
                self.frames[start] += 2**32 - taken if taken >= 2**31 else 0
            literal = re.match(r"(r\d+), \[pc, #\d+\]\s+@ \(([0-9a-f]+)", operands)
            literals.pop(register, None)
            if mnemonic.startswith("ldr") and literal and literal.group(2) in words:
                literals[register] = words[literal.group(2)]
            to = re.match(r"(?:r\d+, )?([0-9a-f]+) <", operands)
            if mnemonic.startswith(("b", "cb")) and to:
                target = int(to.group(1), 16)
                callee = self.starts[max(bisect_right(self.starts, target) - 1, 0)]
                if callee != start or (mnemonic == "bl" and target == start):
                    self.calls[start].add(callee)
            elif mnemonic == "blx":
                self.unfixed[start] = "calls through a pointer"

    def read_call_graphs(self, map_text, call_graphs):
        """The compiler's sizes lack what some prologues push: the larger counts."""
        linked = sections(map_text)
        firsts = [first for first, _ in linked]
        graphs = {name: call_graph(text) for name, text in call_graphs.items()}
        for start, name in self.names.items():
            place = bisect_right(firsts, start) - 1
            known = graphs.get(linked[place][1], {}).get(name) if place >= 0 else None
            if not known:
                continue
            size, fixed, indirect = known
            self.frames[start] = max(self.frames[start], size)
            if not fixed:
                self.unfixed[start] = "has a frame of no fixed size"
            elif indirect:
                self.unfixed[start] = "calls through a pointer"

    def deepest(self, function, nested=None):
        """Bytes of stack from the call of `function` on. `nested`: {part of a name: how often such a
        function is in its own path}, where it calls itself."""
        path = []
        nested = nested or {}

        @lru_cache(maxsize=None)
        def below(start):
            name = self.names[start]
            if start in path:
                raise Unbounded(f"{name} calls itself")
            if start in self.unfixed:
                raise Unbounded(f"{name} {self.unfixed[start]}")
            path.append(start)
            callees = self.calls[start]
            times = next((times for part, times in nested.items() if part in name), 1)
            if times > 1:
                callees = callees - {start}
            depth = max((below(callee) for callee in callees), default=0)
            path.pop()
            return times * self.frames[start] + depth

        start = self.address.get(function)
        if start not in self.names:
            raise Unbounded(f"nothing is known of {function}")
        return below(start)


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
