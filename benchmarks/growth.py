"""What a run of many records costs: reading, tables, gate and page, from 10 to 100,000 records.

    python benchmarks/growth.py [--most 100000] [--figure docs/pictures/growth.png]

Recorded repetitions are resampled into a folder: 8 simulators, each record a real one under another
repetition and seed. Each size is measured in a process of its own.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

REAL = ROOT / "tests" / "measure" / "stacking_records.jsonl"
SIMULATORS = 8
PARTS = ("reading", "tables", "page", "gate")


def resampled(folder: Path, number: int) -> None:
    """Write so many records into a run folder."""
    from pytest_simbench.records.folder import RunFolder
    from pytest_simbench.tasks import Stacking

    draw = random.Random(0)
    real = [json.loads(line) for line in REAL.read_text().splitlines()]
    real = [record for record in real if record["status"] == "ok"]
    names = sorted({record["simulator"] for record in real})
    with (folder / "records.jsonl").open("w") as file:
        for k in range(number):
            simulator = k % SIMULATORS
            name = names[simulator % len(names)]
            pool = [record for record in real if record["simulator"] == name]
            new = f"{name}_{simulator}"
            record = dict(draw.choice(pool))
            record |= {
                "simulator": new,
                "test": record["test"].replace(f"[{name}-", f"[{new}-"),
                "repetition": k // SIMULATORS + 1,
                "seed": 1000 + k // SIMULATORS,
                "settings": pool[0]["settings"],
                "versions": pool[0]["versions"],
            }
            file.write(json.dumps(record) + "\n")
    run = RunFolder(folder)
    run.lock()
    run.describe(Stacking())
    run.close()


def measure(folder: Path) -> dict[str, float]:
    """Seconds of each part, and the largest memory of this process [MB]."""
    from pytest_simbench.measure.gate import run_gate
    from pytest_simbench.measure.limits import parse_limits
    from pytest_simbench.records.folder import RunFolder
    from pytest_simbench.report.model.report import Report
    from pytest_simbench.report.page.context import page
    from pytest_simbench.report.page.render import render
    from pytest_simbench.report.terminal.run import render_run

    found = {}
    clock = time.process_time()

    def part(name: str) -> None:
        nonlocal clock
        now = time.process_time()
        found[name], clock = now - clock, now

    reading = RunFolder(folder).read()
    part("reading")
    report = Report.of(reading)
    render_run(report.summaries, 120)
    part("tables")
    (folder / "report.html").write_text(render(page(folder, report)))
    part("page")
    metrics = [metric for task in reading.metrics.values() for metric in task]
    limits = parse_limits("placed:5%,ram:10%,rtf:20%", metrics)
    run_gate(reading.records, reading.records, limits, reading.metrics)
    part("gate")
    status = Path("/proc/self/status").read_text()
    found["memory"] = float(status.split("VmHWM:")[1].split()[0]) / 1e3
    found["page MB"] = (folder / "report.html").stat().st_size / 1e6
    return found


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--most", type=int, default=100_000)
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--measure", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--profile", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.measure:
        if given.profile:
            import cProfile

            cProfile.run(f"measure(Path({str(given.measure)!r}))", sort="tottime")
        print(json.dumps(measure(given.measure)))
        return
    results: dict[int, dict[str, Any]] = {}
    size = 10
    while size <= given.most:
        with tempfile.TemporaryDirectory() as name:
            resampled(Path(name), size)
            command = [sys.executable, __file__, "--measure", name]
            out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        results[size] = json.loads(out.splitlines()[-1])
        told = "  ".join(f"{part} {value:.2f}" for part, value in results[size].items())
        print(f"{size:7} records:  {told}", flush=True)
        size *= 10
    if given.figure:
        draw(results, given.figure)


def draw(results: dict[int, dict[str, Any]], path: Path) -> None:
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
    for part in PARTS:
        left.loglog(list(results), [r[part] for r in results.values()], "o-", label=part)
    left.set(xlabel="records", ylabel="CPU seconds")
    left.legend()
    right.loglog(list(results), [r["memory"] for r in results.values()], "o-")
    right.set(xlabel="records", ylabel="memory at its peak [MB]")
    for axes in (left, right):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
