# SPDX-License-Identifier: MIT
"""Bounds on stack: the deepest path of a function's calls. Frames and calls are the compiler's
(-fcallgraph-info=su, which holds what -fstack-usage tells) and those of the machine code, which a
library's functions have alone."""

import re
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
        name = None
        sizes = {}
        for line in text.splitlines():
            if head := re.match(r"[0-9a-f]+ <([^>]+)>:$", line):
                name = head.group(1)
                sizes[name] = 0
                continue
            code = re.match(r"\s*[0-9a-f]+:\t[0-9a-f ]+\t(\S+)\s*(.*)", line)
            if not code or not name:
                continue
            mnemonic, operands = code.groups()
            sizes[name] += pushed(mnemonic, operands)
            if mnemonic.startswith("b") and (to := re.search(r"<([^>+]+)(\+0x[0-9a-f]+)?>", operands)):
                if to.group(1) != name:
                    self.calls.setdefault(name, set()).add(to.group(1))
            elif mnemonic == "blx":
                self.calls.setdefault(name, set()).add("__indirect_call")
        for name, size in sizes.items():
            self.frames[name] = max(self.frames.get(name, 0), size)

    def deepest(self, function):
        """Bytes of stack from the call of `function` on."""
        path = []

        @lru_cache(maxsize=None)
        def below(name):
            if name in path:
                raise Unbounded(f"{name} calls itself")
            if name in self.dynamic:
                raise Unbounded(f"the frame of {name} has no fixed size")
            if name not in self.frames:
                raise Unbounded(f"nothing is known of {name}")
            path.append(name)
            depth = max((below(callee) for callee in self.calls.get(name, ())), default=0)
            path.pop()
            return self.frames[name] + depth

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
