"""Whether the cores stay busy: one repetition at once, two in each test, two in the whole run.

    python benchmarks/jobs.py [--sim mujoco,pybullet,drake,sapien] [--reps 5] [--rounds 1]

Each simulator lets the towers lean and throws, in a test each. Repetitions are real ones. `span` is
from the beginning of the first test to the end of the last; `busy` is what the repetitions took
together, as a share of the span of all jobs; `times` is the span with one job over this one.

On a machine that others use, run it where they cannot take the cores away, for a short time and as
root: `chrt -r 1 python benchmarks/jobs.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

TEST = """
import os
import time

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
WAYS = {
    "--sim-jobs 1": ["--sim-jobs=1"],
    "--sim-jobs 2": ["--sim-jobs=2"],
    "--sim-jobs 2 -n 2": ["--sim-jobs=2", "-n2"],
    "--sim-jobs 2 -n 4": ["--sim-jobs=2", "-n4"],
}


def measure(sims: str, reps: int, arguments: list[str]) -> tuple[float, float]:
    """Seconds of the span, and of all repetitions together."""
    with tempfile.TemporaryDirectory(prefix="simbench-jobs-") as name:
        folder = Path(name)
        (folder / "test_it.py").write_text(TEST)
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
        command += [f"--sim={sims}", f"--reps={reps}", "--sim-output=out", *arguments]
        subprocess.run(
            command,
            cwd=folder,
            check=True,
            env={**os.environ, "SPANS": str(folder / "spans")},
            stdout=subprocess.DEVNULL,
        )
        spans = [tuple(map(float, s.split())) for s in (folder / "spans").read_text().splitlines()]
        records = map(json.loads, (folder / "out" / "records.jsonl").read_text().splitlines())
        busy = sum(record["seconds"]["total"] for record in records)
    return max(end for _, end in spans) - min(begin for begin, _ in spans), busy


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--sim", default="mujoco,pybullet,drake,sapien")
    parser.add_argument("--reps", type=int, default=5)
    parser.add_argument("--rounds", type=int, default=1)
    given = parser.parse_args()
    spans: dict[str, list[float]] = {way: [] for way in WAYS}
    busy: dict[str, list[float]] = {way: [] for way in WAYS}
    for _ in range(given.rounds):
        for way, arguments in WAYS.items():
            span, seconds = measure(given.sim, given.reps, arguments)
            jobs = int(arguments[0][-1])
            spans[way].append(span)
            busy[way].append(seconds / jobs / span)
            alone = statistics.median(spans["--sim-jobs 1"])
            print(
                f"{way:20} span {span:6.1f} s  repetitions {seconds:6.1f} s  "
                f"busy {100 * busy[way][-1]:3.0f} %  {alone / span:.2f} times",
                flush=True,
            )
    alone = statistics.median(spans["--sim-jobs 1"])
    for way in WAYS:
        span, share = statistics.median(spans[way]), statistics.median(busy[way])
        print(f"| `{way}` | {span:.1f} s | {100 * share:.0f} % | {alone / span:.2f} |")


if __name__ == "__main__":
    main()
