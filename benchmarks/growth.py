"""What a run of many records costs: reading, report and gate, from 10 to 100,000 records.

    python benchmarks/growth.py [--most 100000]

Bounds: no part grows faster than the records; `report.html` has at most 8 MB, and Chromium opens it
in 2 s, from the address to the load event. CPU seconds, memory at its peak and the page's size;
each number of records in a process of its own, on recorded repetitions that are resampled for 8
simulators. Where Chromium is missing, nothing is opened.
"""

from __future__ import annotations

import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from itertools import chain, pairwise
from pathlib import Path

from common import arguments, write_run

from pytest_simbench.measure.gate import run_gate
from pytest_simbench.measure.limits import parse_limits
from pytest_simbench.records.folder import RunFolder
from pytest_simbench.report.files import write_files
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.page import PAGE_NAME

LARGEST, LONGEST, OPENED = 8.0, 2.0, 5
"""Of the page [MB], of the time to open it [s], and how often it is opened."""


def measure(folder: Path) -> dict[str, float]:
    """Seconds of each part, the largest memory of this process and the page's size [MB]."""
    times = [time.process_time()]
    reading = RunFolder(folder).read()
    times.append(time.process_time())
    write_files(folder, Report.of(reading))
    times.append(time.process_time())
    limits = parse_limits("placed:5%,ram:10%,rtf:20%", chain(*reading.metrics.values()))
    run_gate(reading.records, reading.records, limits, reading.metrics)
    times.append(time.process_time())
    parts = [end - begin for begin, end in pairwise(times)]
    status = Path("/proc/self/status").read_text()
    return {
        **dict(zip(("reading", "report", "gate"), parts, strict=True)),
        "memory": float(status.split("VmHWM:")[1].split()[0]) / 1e3,
        "page": (folder / PAGE_NAME).stat().st_size / 1e6,
    }


def opening(path: Path, program: str) -> float:
    """Median of the seconds to open a page, each time in a fresh context of the browser."""
    from playwright.sync_api import sync_playwright

    times = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        for _ in range(OPENED):
            page = browser.new_context(viewport={"width": 1400, "height": 900}).new_page()
            start = time.perf_counter()
            page.goto(path.as_uri(), wait_until="load")
            page.evaluate("new Promise(done => requestAnimationFrame(() => setTimeout(done)))")
            times.append(time.perf_counter() - start)
        browser.close()
    return statistics.median(times)


def main() -> None:
    given = arguments(__doc__, {}, most=100_000, measure="")
    if given.measure:
        print(json.dumps(measure(Path(given.measure))))
        return
    size, browser = 10, shutil.which("chromium")
    while size <= given.most:
        with tempfile.TemporaryDirectory() as name:
            write_run(Path(name), size)
            command = [sys.executable, __file__, "--measure", name]
            out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            found = json.loads(out.splitlines()[-1])
            found["opened"] = opening(Path(name, PAGE_NAME), browser) if browser else 0.0
        told = "  ".join(f"{part} {value:.2f}" for part, value in found.items())
        print(f"{size:7} records:  {told}", flush=True)
        if found["page"] > LARGEST or found["opened"] > LONGEST:
            raise SystemExit("larger or slower than it may be")
        size *= 10


if __name__ == "__main__":
    main()
