"""What a run of many records costs: reading, tables, page and gate, from 10 to 100,000 records.

    python benchmarks/growth.py [--most 100000]

Bound: none of them grows faster than the records. CPU seconds and memory at its peak; each size in
a process of its own, on recorded repetitions that are resampled for 8 simulators.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import arguments, write_run

from pytest_simbench.measure.gate import run_gate
from pytest_simbench.measure.limits import parse_limits
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.report.files import in_order, summaries_of
from pytest_simbench.report.page import page_of
from pytest_simbench.report.tables import render_run


def measure(folder: Path) -> dict[str, float]:
    """Seconds of each part, the largest memory of this process and the page's size [MB]."""
    found, times = {}, [time.process_time()]

    def part(name: str) -> None:
        times.append(time.process_time())
        found[name] = times[-1] - times[-2]

    reading = RunFolder(folder).read()
    part("reading")
    summaries = summaries_of(reading)
    render_run(summaries, 120)
    part("tables")
    page = page_of(folder, summaries, in_order(reading.records))
    part("page")
    metrics = [metric for task in reading.metrics.values() for metric in task]
    limits = parse_limits("placed:5%,ram:10%,rtf:20%", metrics)
    run_gate(reading.records, reading.records, limits, reading.metrics)
    part("gate")
    status = Path("/proc/self/status").read_text()
    found["memory"] = float(status.split("VmHWM:")[1].split()[0]) / 1e3
    found["page MB"] = len(page.encode()) / 1e6
    return found


def main() -> None:
    given = arguments(__doc__, {}, most=100_000, measure="")
    if given.measure:
        print(json.dumps(measure(Path(given.measure))))
        return
    size = 10
    while size <= given.most:
        with tempfile.TemporaryDirectory() as name:
            write_run(Path(name), size)
            command = [sys.executable, __file__, "--measure", name]
            out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        found = json.loads(out.splitlines()[-1])
        told = "  ".join(f"{part} {value:.2f}" for part, value in found.items())
        print(f"{size:7} records:  {told}", flush=True)
        size *= 10


if __name__ == "__main__":
    main()
