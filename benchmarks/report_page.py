"""Size of `report.html`, and how long it takes to write and to open in Chromium.

    python benchmarks/report_page.py [RUN...] [--times 5]

Bounds: 8 MB, and 2 s from the address to the load event. The records of the run folders (without
them: recorded ones of stacking) are resampled for 8 simulators, 20 repetitions of each task.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from pathlib import Path

from common import arguments, spread, write_run

from pytest_simbench.records.folder import RunFolder
from pytest_simbench.report.files import in_order, summaries_of
from pytest_simbench.report.page import PAGE_NAME, page_of

LARGEST, LONGEST = 8.0, 2.0
"""Of the page [MB], and of the time to open it [s]."""


def opening(path: Path, number: int) -> list[float]:
    """Seconds from the address to the load event, each in a fresh context of the browser."""
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium")
    if program is None:
        raise SystemExit("no chromium here: apt-get install chromium")
    times = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        for _ in range(number):
            page = browser.new_context(viewport={"width": 1400, "height": 900}).new_page()
            start = time.perf_counter()
            page.goto(path.as_uri(), wait_until="load")
            page.evaluate("new Promise(done => requestAnimationFrame(() => setTimeout(done)))")
            times.append(time.perf_counter() - start)
        browser.close()
    return times


def main() -> None:
    given = arguments(__doc__, {"run": []}, times=5)
    source = [record for run in given.run for record in RunFolder(Path(run)).read().records]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_run(folder, 160, source=source)
        reading = RunFolder(folder).read()
        summaries = summaries_of(reading)
        start = time.perf_counter()
        page = page_of(folder, summaries, in_order(reading.records))
        written = time.perf_counter() - start
        path = folder / PAGE_NAME
        path.write_text(page, encoding="utf-8")
        size = path.stat().st_size / 1e6
        times = opening(path, given.times)
    rows, dots = sum(len(s.rows) for s in summaries), page.count('class="dot"')
    print(f"{len(reading.records)} repetitions in {rows} rows; {dots} dots")
    print(f"page: {size:.2f} MB (at most {LARGEST:g}), written in {written:.1f} s")
    print(f"opened, s: {spread(times, '.2f')} (at most {LONGEST:g})")
    if size > LARGEST or max(times) > LONGEST:
        raise SystemExit("larger or slower than it may be")


if __name__ == "__main__":
    main()
