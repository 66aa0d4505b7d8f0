#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""What smaller weights would cost: small_weights.py NETWORK.json ANCHORS RANGES TRUTH [TAGS]"""

import argparse
import json
import sys

import numpy as np

import train


def rounded(weights, levels):
    step = np.abs(weights).max() / levels
    return np.round(weights / step) * step


def main():
    network, anchors, ranges, truth, *tags = sys.argv[1:]
    with open(network, encoding="utf-8") as file:
        of = json.load(file)
    args = argparse.Namespace(anchors=anchors, tags=tags[0] if tags else None, differences=False,
                              cell=2.0)
    readings = train.Readings(args, [ranges], [truth], (of["anchors"], of["tags"]))

    def biases(store):
        h = np.clip(readings.b, of["lowest"], of["highest"])
        h = (h - np.array(of["mean"])) * np.array(of["inverse_deviation"])
        for i, layer in enumerate(of["layers"]):
            h = (np.maximum(h, 0) if i else h) @ store(np.array(layer["weights"]))
            h = h + np.array(layer["biases"])
        return h.ravel()

    exact = biases(lambda w: w)
    weights = sum(np.size(layer["weights"]) for layer in of["layers"])
    others = sum(len(layer["biases"]) for layer in of["layers"]) + 4 * len(of["mean"])
    for name, size, store in (("float", 4, lambda w: w),
                              ("float16", 2, lambda w: w.astype(np.float16).astype(float)),
                              ("int8", 1, lambda w: rounded(w, 127))):
        bias = biases(store)
        print(f"{name:8} {size * weights + 4 * others:6} bytes, bias moved by {train.rms(bias - exact):.6f} m "
              f"rms, {np.abs(bias - exact).max():.6f} m at most; "
              f"rms range error {train.rms(readings.error - bias):.5f} m")


if __name__ == "__main__":
    main()
