#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""SciPy's least_squares as scripts use it: defaults, no Jacobian, residuals in NumPy.

Reads a line a case (toa or tdoa; sigma; start; eight times anchor and range), prints a line a case:
the position, and the nanoseconds that it took.
"""
import sys
import time

import numpy as np
from scipy.optimize import least_squares


def toa(p, anchors, ranges, sigma):
    return (np.linalg.norm(p - anchors, axis=1) - ranges) / sigma


def tdoa(p, anchors, ranges, sigma):
    off = np.linalg.norm(p - anchors, axis=1) - ranges
    e = (off[1:] - off[0]) / sigma
    n = len(e)
    return e - e.sum() * (1 - 1 / np.sqrt(n + 1)) / n


for line in sys.stdin:
    kind, *numbers = line.split()
    values = np.array(numbers, dtype=float)
    sigma, start, rest = values[0], values[1:4], values[4:].reshape(-1, 4)
    arguments = (rest[:, :3], rest[:, 3], sigma)
    begin = time.perf_counter_ns()
    found = least_squares(toa if kind == "toa" else tdoa, start, args=arguments)
    spent = time.perf_counter_ns() - begin
    print(*(repr(float(x)) for x in found.x), spent)
