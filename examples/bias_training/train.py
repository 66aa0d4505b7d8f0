#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Trains a network of the bias of ranges from a recording with truth.

    train.py --anchors A.csv --ranges R.csv --truth T.tum [--tags TAGS.csv] --out DIR

writes DIR/bias_network.json, which `uwbpos replay --bias-network` reads, and DIR/bias_network.hpp,
a constexpr uwbpos::BiasNetwork. Needs python3-sklearn (Debian). Files are those of `uwbpos replay`.

The inputs are those of uwbpos/filter/link_features.hpp. Readings of one link within --cell seconds
are one example, their median error: what is left to learn is bias, not noise. How well that
generalises is told by examples that were held out, in blocks of time.
"""

import argparse
import csv
import json
import pathlib
import sys

import numpy as np
from sklearn.neural_network import MLPRegressor

GEOMETRY = 10


def points(path, key):
    with open(path, encoding="utf-8-sig", newline="") as file:
        rows = csv.DictReader(line for line in file if line.strip() and not line.startswith("#"))
        return {int(r[key]): np.array([float(r[c]) for c in ("x_m", "y_m", "z_m")]) for r in rows}


def readings(path):
    with open(path, encoding="utf-8-sig", newline="") as file:
        rows = csv.DictReader(line for line in file if line.strip() and not line.startswith("#"))
        return [(float(r["t_s"]), int(r.get("tag_id") or 0), int(r["anchor_id"]), float(r["range_m"]))
                for r in rows if r["range_m"]]


def rotations(q):
    x, y, z, w = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return np.stack([
        np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
        np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
        np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1)], 1)


class Truth:
    """Poses of the body, interpolated between neighbours."""

    def __init__(self, path):
        rows = np.loadtxt(path, comments="#", ndmin=2)
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        for i in range(1, len(rows)):  # q and −q are one attitude: neighbours on one side
            if rows[i, 4:] @ rows[i - 1, 4:] < 0:
                rows[i, 4:] *= -1
        self.rows = rows

    def at(self, t):
        inside = (t >= self.rows[0, 0]) & (t <= self.rows[-1, 0])
        columns = [np.interp(t, self.rows[:, 0], self.rows[:, c]) for c in range(1, 8)]
        return inside, np.stack(columns[:3], 1), rotations(np.stack(columns[3:], 1))


def features(offset, rotation, anchor, tag, anchors, tags):
    """Rows of inputs, as link_features has them. `anchor`, `tag`: places in `anchors`, `tags`."""
    length = np.linalg.norm(offset, axis=1, keepdims=True)
    scale = np.where(length > 0, 1 / np.where(length > 0, length, 1), 0)
    body = np.einsum("nki,nk->ni", rotation, offset)
    return np.hstack([offset, length, offset * scale, body * scale,
                      np.eye(len(anchors))[anchor], np.eye(len(tags))[tag]])


def examples(args):
    anchors = points(args.anchors, "anchor_id")
    levers = points(args.tags, "tag_id") if args.tags else {}
    rows = [r for r in readings(args.ranges) if r[2] in anchors and (not levers or r[1] in levers)]
    if not rows:
        sys.exit(f"{args.ranges}: no range of a known anchor and tag")
    t, tag, anchor, measured = (np.array(c) for c in zip(*rows))
    anchor_ids, tag_ids = sorted(set(anchor.tolist())), sorted(set(tag.tolist()))
    inside, position, rotation = Truth(args.truth).at(t)
    if not inside.any():
        sys.exit(f"{args.truth}: its time span holds no range of {args.ranges}")
    lever = np.array([levers.get(i, np.zeros(3)) for i in tag])
    at = position + np.einsum("nij,nj->ni", rotation, lever)
    offset = np.array([anchors[i] for i in anchor]) - at
    anchor, tag = np.searchsorted(anchor_ids, anchor), np.searchsorted(tag_ids, tag)
    inputs = features(offset, rotation, anchor, tag, anchor_ids, tag_ids)
    error = measured - np.linalg.norm(offset, axis=1)
    keep = inside & (np.abs(error - np.median(error)) < args.gross)
    cell = np.floor((t - t.min()) / args.cell).astype(int)
    link = anchor * len(tag_ids) + tag
    key = cell * (len(anchor_ids) * len(tag_ids)) + link
    groups = [np.flatnonzero(keep & (key == k)) for k in np.unique(key[keep])]
    x = np.array([inputs[g].mean(0) for g in groups])
    y = np.array([np.median(error[g]) for g in groups])
    return (anchor_ids, tag_ids, x, y, np.array([t[g].mean() for g in groups]),
            np.array([link[g[0]] for g in groups]))


def normalisation(x):
    """Of geometry alone: codes of anchors and tags stay 0 and 1."""
    mean, deviation = x.mean(0), x.std(0)
    deviation[deviation < 1e-6] = 1
    mean[GEOMETRY:], deviation[GEOMETRY:] = 0, 1
    return mean, deviation


def fit(x, y, args):
    mean, deviation = normalisation(x)
    network = MLPRegressor((args.hidden, args.hidden), activation="relu", solver="lbfgs",
                           alpha=args.alpha, max_iter=args.iterations, random_state=args.seed)
    network.fit((x - mean) / deviation, y)
    return network, mean, deviation


def predict(model, x):
    network, mean, deviation = model
    return network.predict((x - mean) / deviation)


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


def held_out(x, y, t, link, args, blocks=5):
    """Errors of examples whose block of time training did not see: network, and link medians."""
    block = np.minimum(((t - t.min()) / max(np.ptp(t), 1e-9) * blocks).astype(int), blocks - 1)
    ours, medians = [], []
    for b in range(blocks):
        test = block == b
        if not test.any() or test.all():
            continue
        ours.append(y[test] - predict(fit(x[~test], y[~test], args), x[test]))
        default = np.median(y[~test])
        of_link = {k: np.median(y[~test & (link == k)]) for k in np.unique(link[~test])}
        medians.append(y[test] - np.array([of_link.get(k, default) for k in link[test]]))
    return rms(np.concatenate(ours)), rms(np.concatenate(medians))


def as_json(model, x, anchors, tags):
    network, mean, deviation = model
    sample = x[:: max(1, len(x) // 20)][:20]
    document = {
        "anchors": anchors, "tags": tags,
        "lowest": x.min(0).tolist(), "highest": x.max(0).tolist(),
        "mean": mean.tolist(), "inverse_deviation": (1 / deviation).tolist(),
        "layers": [{"weights": w.tolist(), "biases": b.tolist()}
                   for w, b in zip(network.coefs_, network.intercepts_)],
        # What the trainer itself predicts, to hold other implementations to.
        "checks": [{"inputs": row.tolist(), "bias_m": float(bias)}
                   for row, bias in zip(sample, predict(model, sample))],
    }
    return json.loads(json.dumps(document), parse_float=lambda text: float(f"{float(text):.9g}"))


def as_header(document, name):
    def numbers(values):
        return "{" + ", ".join(f"{v:.9g}f" if "." in f"{v:.9g}" or "e" in f"{v:.9g}"
                               else f"{v:.9g}.0f" for v in values) + "}"

    def layer(of):
        rows = ",\n".join(numbers(row) for row in of["weights"])
        return "{{{" + rows + "}},\n" + numbers(of["biases"]) + "}"

    inputs = len(document["mean"])
    first, second = (len(of["biases"]) for of in document["layers"][:2])
    checks = ",\n".join("{" + numbers(c["inputs"]) + ", " + numbers([c["bias_m"]])[1:-1] + "}"
                         for c in document["checks"])
    fields = ",\n".join([numbers(document[k]) for k in ("lowest", "highest", "mean", "inverse_deviation")]
                        + [layer(of) for of in document["layers"]])
    ids = lambda key: ", ".join(str(i) for i in document[key])
    return f"""// SPDX-License-Identifier: MIT
// Written by examples/bias_training/train.py; not meant to be edited.
#pragma once

#include <array>
#include <cstdint>

#include <uwbpos/filter/bias_network.hpp>

namespace {name} {{

// Ids by the place of their number among the inputs.
inline constexpr std::array<std::uint32_t, {len(document["anchors"])}> kAnchors{{{ids("anchors")}}};
inline constexpr std::array<std::uint32_t, {len(document["tags"])}> kTags{{{ids("tags")}}};

// clang-format off
inline constexpr uwbpos::BiasNetwork<float, {inputs}, {first}, {second}> kNetwork{{
{fields}}};

// What the trainer itself predicts [m].
struct Check {{
  std::array<float, {inputs}> inputs;
  float bias;
}};
inline constexpr std::array<Check, {len(document["checks"])}> kChecks{{{{
{checks}}}}};
// clang-format on

}}  // namespace {name}
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    for option, text in (("--anchors", "anchors.csv"), ("--ranges", "ranges.csv"),
                         ("--truth", "poses of the body (TUM)")):
        parser.add_argument(option, required=True, help=text)
    parser.add_argument("--tags", help="tags.csv, lever arms")
    parser.add_argument("--out", required=True, type=pathlib.Path, help="directory for the network")
    parser.add_argument("--name", default="bias_network", help="namespace in the header")
    parser.add_argument("--hidden", type=int, default=50, help="neurons in each hidden layer")
    parser.add_argument("--alpha", type=float, default=0.6, help="weight of the squared weights")
    parser.add_argument("--cell", type=float, default=2.0, help="seconds that make one example")
    parser.add_argument("--gross", type=float, default=2.0,
                        help="readings this far from the median error are left out [m]")
    parser.add_argument("--iterations", type=int, default=600)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()

    anchors, tags, x, y, t, link = examples(args)
    ours, medians = held_out(x, y, t, link, args)
    model = fit(x, y, args)
    print(f"{len(y)} examples of {len(anchors)} anchors and {len(tags)} tags")
    print(f"rms error: raw {rms(y):.3f} m; of times held out: a median per link {medians:.3f} m, "
          f"the network {ours:.3f} m; of all it was trained on {rms(y - predict(model, x)):.3f} m")
    args.out.mkdir(parents=True, exist_ok=True)
    document = as_json(model, x, anchors, tags)
    text = json.dumps(document, separators=(",", ":"))
    (args.out / "bias_network.json").write_text(text + "\n", encoding="utf-8")
    (args.out / "bias_network.hpp").write_text(as_header(document, args.name), encoding="utf-8")
    print(f"wrote {args.out / 'bias_network.json'} and bias_network.hpp")


if __name__ == "__main__":
    main()
