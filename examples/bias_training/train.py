#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Trains a network of the bias of ranges, or of differences, from recordings with truth.

    train.py --anchors A.csv --ranges R.csv… --truth T.tum… [--tags TAGS.csv] --out DIR
    train.py --anchors A.csv --tdoa D.csv… --truth T.tum… [--tags TAGS.csv] --out DIR

writes DIR/bias_network.json, which `uwbpos replay --bias-network` reads, and DIR/bias_network.hpp,
a constexpr uwbpos::BiasNetwork. Needs python3-scipy (Debian). Files are those of `uwbpos replay`.
With --unseen and --unseen-truth it tells the errors of recordings that it did not learn from.

The inputs are those of uwbpos/filter/link_features.hpp. Of a difference the network learns the
biases of both links, as one network's output at b less its output at a, so that a network serves
ranges and differences alike. Readings of one link within --cell seconds, while the link lies still,
are one example, their median error. The weight of the squared weights is the one that predicts
best what was held out, in blocks of time.
"""

import argparse
import csv
import json
import pathlib
import sys

import numpy as np
from scipy.optimize import minimize

GEOMETRY = 10
NONE = -1


def points(path, key):
    with open(path, encoding="utf-8-sig", newline="") as file:
        rows = csv.DictReader(line for line in file if line.strip() and not line.startswith("#"))
        return {int(r[key]): np.array([float(r[c]) for c in ("x_m", "y_m", "z_m")]) for r in rows}


def readings(path, tdoa):
    """Time, tag, anchor a or NONE, anchor b, value, and the true bias where a simulation tells it."""
    with open(path, encoding="utf-8-sig", newline="") as file:
        rows = csv.DictReader(line for line in file if line.strip() and not line.startswith("#"))
        if tdoa:
            return [(float(r["t_s"]), int(r.get("tag_id") or 0), int(r["anchor_id_a"]),
                     int(r["anchor_id_b"]), float(r["difference_m"]),
                     float(r.get("true_bias_m") or "nan")) for r in rows if r["difference_m"]]
        return [(float(r["t_s"]), int(r.get("tag_id") or 0), NONE, int(r["anchor_id"]),
                 float(r["range_m"]), float(r.get("true_bias_m") or "nan"))
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


class Readings:
    """What is known of each reading: inputs of link b and, of differences, of link a; errors."""

    def __init__(self, args, logs, truths, ids=None):
        anchors = points(args.anchors, "anchor_id")
        levers = points(args.tags, "tag_id") if args.tags else {}
        parts = []
        start = 0.0  # of a log among all, so that no cell or block holds two
        rows_of = []
        for log, truth in zip(logs, truths, strict=True):
            rows = [r for r in readings(log, args.differences)
                    if r[3] in anchors and (r[2] in anchors or r[2] == NONE)
                    and (not levers or r[1] in levers)
                    and (ids is None or (r[3] in ids[0] and r[1] in ids[1]
                                         and (r[2] in ids[0] or r[2] == NONE)))]
            inside, position, rotation = Truth(truth).at(np.array([r[0] for r in rows]))
            if not inside.any():
                sys.exit(f"{log}: no reading of a known anchor and tag within the span of {truth}")
            rows = [r for r, keep in zip(rows, inside) if keep]
            t = np.array([r[0] for r in rows])
            parts.append((t - t.min() + start, position[inside], rotation[inside]))
            start += np.ptp(t) + 10 * args.cell
            rows_of += rows
        self.t, position, rotation = (np.concatenate(c) for c in zip(*parts))
        _, tag, a, b, value, self.bias = (np.array(c) for c in zip(*rows_of))
        self.anchors, self.tags = ids or (sorted((set(a.tolist()) | set(b.tolist())) - {NONE}),
                                          sorted(set(tag.tolist())))
        lever = np.array([levers.get(i, np.zeros(3)) for i in tag])
        at = position + np.einsum("nij,nj->ni", rotation, lever)

        def link(anchor):
            offset = np.array([anchors[i] for i in anchor]) - at
            return offset, features(offset, rotation, np.searchsorted(self.anchors, anchor),
                                    np.searchsorted(self.tags, tag), self.anchors, self.tags)

        offset, self.b = link(b)
        self.error = value - np.linalg.norm(offset, axis=1)
        self.a = None
        if args.differences:
            offset, self.a = link(a)
            self.error += np.linalg.norm(offset, axis=1)
        self.link = (a + 1) * 10**12 + b * 10**6 + tag

    def kept(self, which):
        for name in ("t", "a", "b", "error", "bias", "link"):
            value = getattr(self, name)
            setattr(self, name, value if value is None else value[which])
        return self


def still_groups(r, group, spread=0.05):
    """A group of readings of one link, in halves until no direction in one spreads farther."""
    if len(group) == 1 or np.ptp(r.b[group][:, 4:GEOMETRY], axis=0).max() < spread:
        return [group]
    half = len(group) // 2
    return still_groups(r, group[:half], spread) + still_groups(r, group[half:], spread)


def as_examples(r, args):
    """Readings that lie alike as one; then thinned evenly to --examples."""
    keep = np.abs(r.error - np.median(r.error)) < args.gross
    order = np.lexsort((r.t, np.floor(r.t / args.cell), r.link))
    order = order[keep[order]]
    cell = np.floor(r.t[order] / args.cell)
    cuts = np.flatnonzero((np.diff(r.link[order]) != 0) | (np.diff(cell) != 0)) + 1
    groups = [g for whole in np.split(order, cuts) for g in still_groups(r, whole)]
    error = np.array([np.median(r.error[g]) for g in groups])
    for name in ("a", "b"):
        if getattr(r, name) is not None:
            setattr(r, name, np.array([getattr(r, name)[g].mean(0) for g in groups]))
    r.t, r.link, r.bias = (np.array([v[g].mean() for g in groups]) for v in (r.t, r.link, r.bias))
    r.error = error
    if len(groups) > args.examples:
        r.kept(np.random.default_rng(args.seed).permutation(len(groups))[:args.examples])
    return r


def normalisation(x):
    """Of geometry alone: codes of anchors and tags stay 0 and 1."""
    mean, deviation = x.mean(0), x.std(0)
    deviation[deviation < 1e-6] = 1
    mean[GEOMETRY:], deviation[GEOMETRY:] = 0, 1
    return mean, deviation


class Network:
    """x → hidden → hidden → 1 with ReLU; fitted by L-BFGS to mean squares plus squared weights."""

    def __init__(self, xb, xa, y, alpha, args):
        both = xb if xa is None else np.vstack([xb, xa])
        self.lowest, self.highest = both.min(0), both.max(0)
        self.mean, self.deviation = normalisation(both)
        sizes = [xb.shape[1], args.hidden, args.hidden, 1]
        self.shapes = list(zip(sizes[:-1], sizes[1:]))
        random = np.random.default_rng(args.seed)
        start = np.concatenate([np.concatenate([
            random.uniform(-1, 1, (i, o)).ravel() * np.sqrt(6 / (i + o)), np.zeros(o)])
            for i, o in self.shapes])
        z = (both - self.mean) / self.deviation
        n = len(y)
        scale = max(np.std(y), 1e-6)
        sign = np.ones(n) if xa is None else np.concatenate([np.ones(n), -np.ones(n)])
        is_weight = np.concatenate([np.concatenate([np.ones(i * o), np.zeros(o)])
                                    for i, o in self.shapes])

        def cost(theta):
            (w1, c1), (w2, c2), (w3, c3) = self.layers_of(theta)
            h1 = np.maximum(z @ w1 + c1, 0)
            h2 = np.maximum(h1 @ w2 + c2, 0)
            f = (h2 @ w3 + c3).ravel() * sign
            left = (f if xa is None else f[:n] + f[n:]) - y / scale
            d3 = (np.tile(left, len(sign) // n) * sign / n)[:, None]
            d2 = (d3 @ w3.T) * (h2 > 0)
            d1 = (d2 @ w2.T) * (h1 > 0)
            gradient = np.concatenate([part.ravel() for part in (
                z.T @ d1, d1.sum(0), h1.T @ d2, d2.sum(0), h2.T @ d3, d3.sum(0))])
            kept = is_weight * theta
            return (0.5 * np.mean(left**2) + 0.5 * alpha / n * kept @ kept,
                    gradient + alpha / n * kept)

        theta = minimize(cost, start, jac=True, method="L-BFGS-B",
                         options={"maxiter": args.iterations, "maxfun": 2 * args.iterations}).x
        self.layers = [[w.copy(), c.copy()] for w, c in self.layers_of(theta)]
        self.layers[2][0] *= scale
        self.layers[2][1] *= scale

    def layers_of(self, theta):
        place, layers = 0, []
        for i, o in self.shapes:
            layers.append((theta[place:place + i * o].reshape(i, o),
                           theta[place + i * o:place + i * o + o]))
            place += i * o + o
        return layers

    def __call__(self, x):
        h = (np.clip(x, self.lowest, self.highest) - self.mean) / self.deviation
        for w, c in self.layers[:-1]:
            h = np.maximum(h @ w + c, 0)
        return (h @ self.layers[-1][0] + self.layers[-1][1]).ravel()

    def predict(self, r, which=slice(None)):
        return self(r.b[which]) - (0 if r.a is None else self(r.a[which]))


def fit(r, which, alpha, args):
    return Network(r.b[which], None if r.a is None else r.a[which], r.error[which], alpha, args)


def rms(v):
    return float(np.sqrt(np.mean(np.square(v))))


class Medians:
    """A constant for each link."""

    def __init__(self, r, which=slice(None)):
        link, error = r.link[which], r.error[which]
        self.default = np.median(error)
        self.of = {k: np.median(error[link == k]) for k in np.unique(link)}

    def predict(self, r, which=slice(None)):
        return np.array([self.of.get(k, self.default) for k in r.link[which]])


def held_out(r, predictor, blocks=5):
    """Rms error of examples whose block of time training did not see."""
    block = np.minimum(((r.t - r.t.min()) / max(np.ptp(r.t), 1e-9) * blocks).astype(int), blocks - 1)
    left = []
    for b in range(blocks):
        test = block == b
        if test.any() and not test.all():
            left.append(r.error[test] - predictor(~test).predict(r, test))
    return rms(np.concatenate(left)) if left else float("nan")


def choose_alpha(r, args):
    """The weight of the squared weights that is best for what was held out, and that error."""
    tried = {alpha: held_out(r, lambda seen, a=alpha: fit(r, seen, a, args)) for alpha in args.alphas}
    for alpha, error in tried.items():
        print(f"  squared weights times {alpha:g}: {error:.4f} m of times held out")
    alpha = min(tried, key=lambda a: (np.isnan(tried[a]), tried[a]))
    return alpha, tried[alpha]


def tell_unseen(model, medians, ids, args):
    r = Readings(args, args.unseen, args.unseen_truth, ids)
    r.kept(np.abs(r.error - np.median(r.error)) < args.gross)
    result = {}
    for what, truth in (("error", r.error), ("bias alone", r.bias)):
        if np.isnan(truth).any():
            continue
        left = [rms(truth), rms(truth - medians.predict(r)), rms(truth - model.predict(r))]
        less = [100 * (1 - v / left[0]) for v in left]
        print(f"unseen, rms {what}: raw {left[0]:.4f} m; a median per link {left[1]:.4f} m, down by "
              f"{less[1]:.0f} %; the network {left[2]:.4f} m, down by {less[2]:.1f} %")
        result[what] = less[2]
    if args.expect is not None and min(result.values()) < args.expect:
        sys.exit(f"expected the network to take {args.expect:g} % off")


def as_json(model, r):
    x = r.b
    sample = x[:: max(1, len(x) // 20)][:20]
    document = {
        "anchors": r.anchors, "tags": r.tags,
        "lowest": model.lowest.tolist(), "highest": model.highest.tolist(),
        "mean": model.mean.tolist(),
        "inverse_deviation": (1 / model.deviation).tolist(),
        "layers": [{"weights": w.tolist(), "biases": b.tolist()}
                   for w, b in model.layers],
        # What the trainer itself predicts, to hold other implementations to.
        "checks": [{"inputs": row.tolist(), "bias_m": float(bias)}
                   for row, bias in zip(sample, model(sample))],
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
    parser.add_argument("--anchors", required=True, help="anchors.csv")
    logs = parser.add_mutually_exclusive_group(required=True)
    logs.add_argument("--ranges", nargs="+", help="ranges.csv, one or several")
    logs.add_argument("--tdoa", nargs="+", help="tdoa.csv, one or several")
    parser.add_argument("--truth", required=True, nargs="+", help="poses of the body (TUM), of each log")
    parser.add_argument("--unseen", nargs="+", default=[], help="logs to be scored on, of the same kind")
    parser.add_argument("--unseen-truth", nargs="+", default=[], help="poses, of each of these")
    parser.add_argument("--expect", type=float, help="fail if less than this is taken off those [%%]")
    parser.add_argument("--tags", help="tags.csv, lever arms")
    parser.add_argument("--out", required=True, type=pathlib.Path, help="directory for the network")
    parser.add_argument("--name", default="bias_network", help="namespace in the header")
    parser.add_argument("--hidden", type=int, default=50, help="neurons in each hidden layer")
    parser.add_argument("--alpha", type=float, help="weight of the squared weights (default: the best of --alphas)")
    parser.add_argument("--alphas", type=float, nargs="+", default=[0.1, 0.3, 1, 3, 10, 30, 100],
                        help="weights to choose from, by errors of times held out")
    parser.add_argument("--cell", type=float, default=2.0, help="seconds that make one example, at most")
    parser.add_argument("--examples", type=int, default=20000, help="at most as many")
    parser.add_argument("--gross", type=float, default=2.0,
                        help="readings this far from the median error are left out [m]")
    parser.add_argument("--iterations", type=int, default=600)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    args.differences = bool(args.tdoa)
    if len(args.truth) != len(args.tdoa or args.ranges) or len(args.unseen) != len(args.unseen_truth):
        parser.error("expected one truth for each log")

    r = as_examples(Readings(args, args.tdoa or args.ranges, args.truth), args)
    print(f"{len(r.error)} examples of {len(r.anchors)} anchors and {len(r.tags)} tags")
    alpha = args.alpha
    if alpha is None:
        alpha, ours = choose_alpha(r, args)
        medians = held_out(r, lambda seen: Medians(r, seen))
        print(f"rms error of times held out: a median per link {medians:.4f} m, the network {ours:.4f} m")
    model = fit(r, np.ones(len(r.error), bool), alpha, args)
    print(f"rms error of what it was trained on: raw {rms(r.error):.4f} m, "
          f"less the network's biases {rms(r.error - model.predict(r)):.4f} m")
    args.out.mkdir(parents=True, exist_ok=True)
    document = as_json(model, r)
    text = json.dumps(document, separators=(",", ":"))
    (args.out / "bias_network.json").write_text(text + "\n", encoding="utf-8")
    (args.out / "bias_network.hpp").write_text(as_header(document, args.name), encoding="utf-8")
    print(f"wrote {args.out / 'bias_network.json'} and bias_network.hpp")
    if args.unseen:
        tell_unseen(model, Medians(r), (r.anchors, r.tags), args)


if __name__ == "__main__":
    main()
