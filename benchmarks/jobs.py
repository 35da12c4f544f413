"""Whether the cores stay busy: one repetition at once, two in each test, two in the whole run.

    python benchmarks/jobs.py [--sim mujoco,pybullet,drake,sapien] [--reps 5] [--rounds 1]

Bound: N jobs on N idle cores are at least 0.9 N times as fast.

Each simulator lets the towers lean and throws, in a test each. Repetitions are real ones. `span` is
from the beginning of the first test to the end of the last; `busy` is what the repetitions took
together, as a share of the span of all jobs; `times` is the span with one job over this one.

On a machine that others use, run it where they cannot take the cores away, for a short time and as
root: `chrt -r 1 python benchmarks/jobs.py`.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from common import arguments

TEST = """
import os, time
import pytest
from pytest_simbench.tasks import LeaningTowers, Throwing

@pytest.fixture(autouse=True)
def span():
    began = time.monotonic()
    yield
    with open(os.environ["SPANS"], "a") as file:
        print(began, time.monotonic(), file=file)

def test_towers(repeat):
    repeat(LeaningTowers())

def test_throwing(repeat):
    repeat(Throwing())
"""
WAYS = ("--sim-jobs 1", "--sim-jobs 2", "--sim-jobs 2 -n 2", "--sim-jobs 2 -n 4")


def measure(sims: str, reps: int, options: list[str]) -> tuple[float, float]:
    """Seconds of the span, and of all repetitions together."""
    with tempfile.TemporaryDirectory(prefix="simbench-jobs-") as name:
        folder = Path(name)
        (folder / "test_it.py").write_text(TEST)
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
        command += [f"--sim={sims}", f"--reps={reps}", "--sim-output=out", *options]
        spans = {**os.environ, "SPANS": str(folder / "spans")}
        quiet = subprocess.DEVNULL
        subprocess.run(command, cwd=folder, check=True, env=spans, stdout=quiet)
        found = [tuple(map(float, s.split())) for s in (folder / "spans").read_text().splitlines()]
        records = map(json.loads, (folder / "out" / "records.jsonl").read_text().splitlines())
        busy = sum(record["seconds"]["total"] for record in records)
    return max(end for _, end in found) - min(begin for begin, _ in found), busy


def main() -> None:
    given = arguments(__doc__, {}, sim="mujoco,pybullet,drake,sapien", reps=5, rounds=1)
    found: dict[str, list[tuple[float, float]]] = {way: [] for way in WAYS}
    for _ in range(given.rounds):
        for way, measured in found.items():
            span, seconds = measure(given.sim, given.reps, way.split())
            measured.append((span, seconds / int(way.split()[1]) / span))
            print(f"{way:20} span {span:6.1f} s  repetitions {seconds:6.1f} s", flush=True)
    medians = {way: tuple(map(statistics.median, zip(*found[way], strict=True))) for way in WAYS}
    for way, (span, busy) in medians.items():
        times = medians[WAYS[0]][0] / span
        print(f"| `{way}` | {span:.1f} s | {100 * busy:.0f} % | {times:.2f} |")


if __name__ == "__main__":
    main()
