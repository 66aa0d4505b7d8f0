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
     102:\tf000 f800 \tbl\t200 <__aeabi_fadd>

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
        by_way = "00000010 T __aeabi_dmul\n"
        self.assertEqual(self.faults_of(judge.check_symbols, "m0", "image", by_way), [])
        self.assertEqual(len(self.faults_of(judge.check_symbols, "m0", "image", "00000010 T __aeabi_ddiv\n")), 1)

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
        graph = Graph()
        graph.add_call_graph(CALL_GRAPH)
        graph.add_machine_code(MACHINE_CODE)
        # The compiler's frames where there are any: 24 + 16, then 24 + 8, then 16 + 4.
        self.assertEqual(graph.deepest("top"), 24 + 16 + 32 + 20)
        self.assertEqual(self.faults_of(judge.check_stack, "m4f", "top", graph, 92), [])
        found = self.faults_of(judge.check_stack, "m4f", "top", graph, 93)
        self.assertIn("93 bytes of stack painted, 92 on the deepest path", found[0])
        # Another name of the same code, and a call that became an instruction.
        graph.calls["top"] |= {"__aeabi_alias", "sqrtf"}
        graph.add_symbols("00000201 T __aeabi_fadd\n00000201 T __aeabi_alias\n00000101 T top\n")
        self.assertEqual(graph.deepest("top"), 24 + 16 + 32 + 20)
        # A frame that the M0 takes from a literal, in a function with a linker's number amid it.
        self.assertEqual(graph.deepest("large"), 8 + 0x290)
        graph.calls["helper"] = {"top"}
        self.assertRaises(Unbounded, graph.deepest, "top")
        self.assertIn("calls itself", self.faults_of(judge.check_stack, "m4f", "top", graph, 0)[0])
        self.assertRaises(Unbounded, graph.deepest, "top", {"helper": 2})
        graph.calls["helper"] = {"helper"}
        self.assertIn("calls itself", self.faults_of(judge.check_stack, "m4f", "top", graph, 0)[0])
        self.assertEqual(graph.deepest("top", {"help": 3}), 24 + 16 + 32 + 3 * 20)
        graph.calls["helper"] = {"__indirect_call"}
        self.assertIn("nothing is known", self.faults_of(judge.check_stack, "m4f", "top", graph, 0)[0])

    def test_budgets(self):
        rows = {name: row() for name in judge.BUDGETS}
        missed = {name: dict(held) for name, held in judge.MISSED.items()}
        try:
            judge.MISSED.clear()
            self.assertEqual(self.faults_of(judge.check_budgets, rows), [])
            for what, more in (("flash", {"flash": 1601}), ("stack", {"deepest": 301}), ("stack", {"painted": 301}),
                               ("instructions", {"most": 2501})):  # fmt: skip
                over = {**rows, "toa_least_squares_3d_8": row(**more)}
                found = self.faults_of(judge.check_budgets, over)
                self.assertEqual(len(found), 1, what)
                self.assertIn(judge.UNITS[what], found[0])
            # A missed one: held, shown as missed, and struck once met.
            judge.MISSED["toa_least_squares_3d_8"] = {"instructions": 8200}
            held = {**rows, "toa_least_squares_3d_8": row(most=8000)}
            self.assertEqual(self.faults_of(judge.check_budgets, held), [])
            self.assertIn("| 2,500 instructions | 8,000 | **missed**, held to 8,200 |", judge.table({"m4f": held}))
            over = {**rows, "toa_least_squares_3d_8": row(most=8201)}
            self.assertEqual(len(self.faults_of(judge.check_budgets, over)), 1)
            self.assertIn("strike it from MISSED", self.faults_of(judge.check_budgets, rows)[0])
            self.assertEqual(len(self.faults_of(judge.check_budgets, {})), len(judge.BUDGETS))
        finally:
            judge.MISSED.clear()
            judge.MISSED.update(missed)

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
