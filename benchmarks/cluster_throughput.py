"""How throughput grows with the nodes of a cluster, and where it stops: a simulation.

    python benchmarks/cluster_throughput.py RUN... [--figure docs/pictures/cluster_throughput.png]

RUN is a file of records. Repetitions take the seconds that recorded ones took, start costs
included. The speeds of the nodes are drawn: a normal distribution about 1, as wide as `--spread`. A
run is 8 simulators x 2 tasks x 20 repetitions, in pytest's order: a test begins when the one before
it has ended, or, with `-n 8`, when one of eight has. Each repetition costs its client a moment
(`cluster_dispatch.py`).
"""

from __future__ import annotations

import argparse
import heapq
import json
import random
from collections.abc import Sequence
from pathlib import Path

DISPATCH = 0.01
"""Wall time of a client for one repetition [s], on a busy machine (`cluster_dispatch.py`)."""

SUBMIT = 0.02
"""From the end of a repetition on a node to the start of the next one there [s]."""

NODES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
SIMULATORS, TASKS, REPETITIONS = 8, 2, 20


def run(tests: Sequence[Sequence[float]], speeds: Sequence[float], clients: int) -> float:
    """Seconds until all tests have ended."""
    free = [(0.0, node) for node in range(len(speeds))]
    heapq.heapify(free)
    ready = [0.0] * clients
    heapq.heapify(ready)
    for test in tests:
        begin = heapq.heappop(ready)
        sent, end = begin, begin
        for seconds in test:
            at, node = heapq.heappop(free)
            sent = max(sent, at, begin) + DISPATCH
            done = sent + SUBMIT + seconds / speeds[node]
            heapq.heappush(free, (done, node))
            end = max(end, done)
        heapq.heappush(ready, end)
    return max(ready)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("run", type=Path, nargs="+")
    parser.add_argument("--spread", type=float, default=0.2, help="of the nodes' speeds")
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    seconds: dict[str, list[float]] = {}
    for path in given.run:
        for line in path.read_text().splitlines():
            record = json.loads(line)
            if record["status"] == "ok":
                seconds.setdefault(record["simulator"], []).append(record["seconds"]["total"])
    draw = random.Random(0)
    names = sorted(seconds)
    print({name: round(sum(v) / len(v), 1) for name, v in seconds.items()}, "s a repetition")
    tests = [
        [draw.choice(seconds[names[k % len(names)]]) for _ in range(REPETITIONS)]
        for k in range(SIMULATORS * TASKS)
    ]
    curves: dict[str, list[float]] = {"one test after the other": [], "-n 8": []}
    speeds = [1.0, *(max(0.3, draw.gauss(1.0, given.spread)) for _ in range(NODES[-1] - 1))]
    alone = sum(map(sum, tests))
    for nodes in NODES:
        for curve, clients in zip(curves.values(), (1, 8), strict=True):
            curve.append(alone / run(tests, speeds[:nodes], clients))
        told = "  ".join(f"{name}: {curve[-1]:6.1f} x" for name, curve in curves.items())
        print(f"{nodes:4} nodes  {told}")
    if given.figure:
        import matplotlib

        matplotlib.use("agg")
        from matplotlib import pyplot as plt

        figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
        for name, curve in curves.items():
            axes.plot(NODES, curve, "o-", label=name)
        axes.plot(NODES, NODES, ":", color="grey", label="as many times as nodes")
        axes.set(xscale="log", yscale="log", xlabel="nodes", ylabel="times as fast as one machine")
        axes.legend()
        axes.grid(alpha=0.3)
        figure.savefig(given.figure, dpi=110)


if __name__ == "__main__":
    main()
