#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What judge.py fails on, tried without a compiler or an emulator."""

import contextlib
import io
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import judge
from deepest import Graph, Unbounded

CALL_GRAPH = """graph: { title: "a.cpp"
node: { title: "top" label: "void top()\\na.cpp:1:1\\n24 bytes (static)" }
node: { title: "a.cpp:_Z5innerv" label: "void inner()\\na.cpp:2:1\\n16 bytes (static)" }
node: { title: "__aeabi_fadd" label: "__aeabi_fadd\\n<built-in>" shape : ellipse }
edge: { sourcename: "top" targetname: "a.cpp:_Z5innerv" label: "a.cpp:1:9" }
edge: { sourcename: "a.cpp:_Z5innerv" targetname: "__aeabi_fadd" }
}
"""
MACHINE_CODE = """
00000100 <top>:
     100:\tb500      \tpush\t{lr}
     102:\tf000 f800 \tbl\t180 <_Z5innerv>

00000180 <_Z5innerv>:
     180:\tb510      \tpush\t{r4, lr}
     182:\tf000 f800 \tb.w\t200 <__aeabi_fadd>

000001c0 <second>:
     1c0:\tb500      \tpush\t{lr}
     1c2:\tf000 f800 \tbl\t1e0 <_Z5innerv>

000001e0 <_Z5innerv>:
     1e0:\tb530      \tpush\t{r4, r5, lr}

00000200 <__aeabi_fadd>:
     200:\tb5f8      \tpush\t{r3, r4, r5-r7, lr}
     202:\tb082      \tsub\tsp, #8
     204:\tf7ff ffff \tbl\t300 <helper>

00000300 <helper>:
     300:\ted2d 8b02 \tvpush\t{d8-d9}
     304:\tf84d cd04 \tstr.w\tip, [sp, #-4]!

00000400 <large>:
     400:\tb510      \tpush\t{r4, lr}
     402:\t4c01      \tldr\tr4, [pc, #4]\t@ (40a <large+0xa>)
     404:\t44a5      \tadd\tsp, r4

00000406 <RAM_SIZE>:
     406:\t2385      \tmovs\tr3, #133\t@ 0x85
     408:\t449d      \tadd\tsp, r3
     40a:\tfffffd70 \t.word\t0xfffffd70
"""
SYMBOLS = """00000100 T top
00000180 t _Z5innerv
000001c0 T second
000001e0 t _Z5innerv
00000201 T __aeabi_fadd
00000201 T __aeabi_alias
00000301 t helper
00000401 T large
"""
MAP = """Discarded input sections
 .text._Z5innerv
                0x00000100      0x400 b.obj
Linker script and memory map
 .text          0x00000100        0x0 b.obj
 .text.top      0x00000100       0x80 a.obj
 .text._Z5innerv
                0x00000180       0x40 a.obj
 .text          0x000001c0       0x40 b.obj
 .text          0x00000200      0x300 /lib/libgcc.a(some.o)
"""


def row(**more):
    return judge.Row(**{"flash": 1000, "painted": 80, "deepest": 100, "most": 100, "mean": 90, **more})


class Judge(unittest.TestCase):
    def setUp(self):
        judge.faults.clear()

    def faults_of(self, function, *arguments):
        judge.faults.clear()
        with contextlib.redirect_stdout(io.StringIO()):
            function(*arguments)
        return judge.faults

    def test_symbols(self):
        forbidden = {
            "the heap": ["malloc", "_malloc_r", "_sbrk", "_Znwj", "_ZdlPv"],
            "exceptions": ["__cxa_throw", "_Unwind_RaiseException", "_ZSt9terminatev"],
            "streams": ["_ZSt4cout", "_ZNSt8ios_base4InitC1Ev", "printf", "_printf_float"],
            "double": ["__aeabi_dadd", "__aeabi_dcmplt", "__aeabi_f2d", "__aeabi_ui2d"],
        }
        for what, symbols in forbidden.items():
            for symbol in symbols:
                found = self.faults_of(judge.check_symbols, "m4f", "image", f"00000010 T main\n00000100 T {symbol}\n")
                self.assertEqual(len(found), 1, symbol)
                self.assertIn(what, found[0])
        allowed = "00000010 T main\n         U __aeabi_fadd\n00000100 T __aeabi_ldivmod\n\n"
        self.assertEqual(self.faults_of(judge.check_symbols, "m4f", "image", allowed), [])

    def test_double_in_hardware(self):
        for code, count in (("\tvadd.f64\td0, d1", 1), ("\tvcvt.f64.f32\td0, s0", 1), ("\tvldr\td8, [r0]", 0),
                            ("\tvadd.f32\ts0, s1", 0)):  # fmt: skip
            self.assertEqual(len(self.faults_of(judge.check_code, "m7", "image", f"   0:\t1234\t{code}\n")), count, code)

    def test_words(self):
        good = "case locate 300 0 8000 7000 600\r\nall words as on the host\n"
        self.assertEqual(judge.read_cases("m4f", good), ([("locate", 8000, 7000, 600)], 300))
        found = self.faults_of(judge.read_cases, "m4f", "case locate 300 1 8000 7000 600\n")
        self.assertEqual(found, ["m4f: locate: 1 of 300 words differ from the host's"])

    def test_deepest_path(self):
        graph = lambda **more: Graph(**{"code": MACHINE_CODE, "symbols": SYMBOLS, "map_text": MAP,
                                        "call_graphs": {"a.obj": CALL_GRAPH}, **more})  # fmt: skip
        whole = graph()
        # Of top and inner the compiler's frames, of the others what they push: 24 + 8, 16 + 4.
        self.assertEqual(whole.deepest("top"), 24 + 16 + 32 + 20)
        self.assertEqual(self.faults_of(judge.check_stack, "m4f", "top", whole, 92), [])
        found = self.faults_of(judge.check_stack, "m4f", "top", whole, 93)
        self.assertIn("93 bytes of stack painted, 92 on the deepest path", found[0])
        # Another name of the same code.
        self.assertEqual(whole.deepest("__aeabi_alias"), 32 + 20)
        # A function of the same name in another object, and one that was left out, are others.
        self.assertEqual(whole.deepest("second"), 4 + 12)
        self.assertEqual(graph(call_graphs={"b.obj": CALL_GRAPH}).deepest("top"), 4 + 8 + 32 + 20)
        # A frame that the M0 takes from a literal, in a function with a linker's number amid it.
        self.assertEqual(whole.deepest("large"), 8 + 0x290)
        found = self.faults_of(judge.check_stack, "m4f", "nowhere", whole, 0)
        self.assertIn("nothing is known of nowhere", found[0])
        for old, new, why in (("24 bytes (static)", "24 bytes (dynamic)", "no fixed size"),
                              ('targetname: "__aeabi_fadd"', 'targetname: "__indirect_call"', "a pointer")):  # fmt: skip
            broken = graph(call_graphs={"a.obj": CALL_GRAPH.replace(old, new)})
            self.assertIn(why, self.faults_of(judge.check_stack, "m4f", "top", broken, 0)[0])
        pointer = graph(code=MACHINE_CODE.replace("bl\t300 <helper>", "blx\tr3"))
        self.assertRaises(Unbounded, pointer.deepest, "top")
        ring = graph(code=MACHINE_CODE.replace("bl\t300 <helper>", "bl\t100 <top>"))
        self.assertIn("calls itself", self.faults_of(judge.check_stack, "m4f", "top", ring, 0)[0])
        self.assertRaises(Unbounded, ring.deepest, "top", {"helper": 2})
        nested = graph(code=MACHINE_CODE.replace("str.w\tip, [sp, #-4]!", "bl\t300 <helper>"))
        self.assertRaises(Unbounded, nested.deepest, "top")
        self.assertEqual(nested.deepest("top", {"help": 3}), 24 + 16 + 32 + 3 * 16)

    def test_nothing_left_behind(self):
        """Files of an earlier build, or of what was not linked, are not read."""
        with tempfile.TemporaryDirectory() as folder:
            where = Path(folder)
            (where / "image.map").write_text(MAP.replace("a.obj", "CMakeFiles/x.dir/a.cpp.obj"))
            found = self.faults_of(judge.compiled, "m4f", where, "image")
            self.assertIn("no call graph of CMakeFiles/x.dir/a.cpp.obj", found[0])
            (where / "CMakeFiles/x.dir").mkdir(parents=True)
            for name in ("a", "old"):
                (where / f"CMakeFiles/x.dir/{name}.cpp.ci").write_text(CALL_GRAPH)
            self.assertEqual(self.faults_of(judge.compiled, "m4f", where, "image"), [])
            self.assertEqual(list(judge.compiled("m4f", where, "image")[1]), ["CMakeFiles/x.dir/a.cpp.obj"])

    def test_budgets(self):
        rows = {name: row() for name in judge.BUDGETS}
        self.assertEqual(self.faults_of(judge.check_budgets, rows), [])
        for what, more in (("flash", {"flash": 1639}), ("stack", {"deepest": 301}), ("stack", {"painted": 301}),
                           ("instructions", {"most": 2501})):  # fmt: skip
            over = {**rows, "toa_refine_3d_8": row(**more)}
            found = self.faults_of(judge.check_budgets, over)
            self.assertEqual(len(found), 1, what)
            self.assertIn(judge.UNITS[what], found[0])
        self.assertIn("| 2,500 instructions | 1,", judge.table({"m4f": {**rows, "toa_refine_3d_8": row(most=1500)}}))
        self.assertEqual(len(self.faults_of(judge.check_budgets, {})), len(judge.BUDGETS))

    def test_table(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "table.md"
            path.write_text(judge.table({"m4f": {"locate": row(most=10000)}}))
            compare = lambda rows: self.faults_of(judge.compare, judge.table({"m4f": rows}), path)
            self.assertEqual(compare({"locate": row(most=10999)}), [])
            self.assertEqual(len(compare({"locate": row(most=11001)})), 1)
            self.assertEqual(len(compare({"locate": row(most=10000, deepest=140)})), 1)
            self.assertEqual(len(compare({"other": row(most=10000)})), 1)
            self.assertEqual(len(compare({"locate": row(most=10000), "other": row()})), 1)


if __name__ == "__main__":
    unittest.main()
