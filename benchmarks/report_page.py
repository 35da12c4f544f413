"""Size of `report.html`, and how long it takes to write and to open, for a run of eight simulators.

Real records of few simulators are resampled to eight simulators x 2 tasks x 20 repetitions: each
repetition is a recorded one, drawn with a fixed seed, under another name.

    python benchmarks/report_page.py RUN... [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import random
import shutil
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from pytest_simbench.records.record import Record
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.page import PAGE_NAME
from pytest_simbench.report.page.context import page as page_of
from pytest_simbench.report.page.render import render
from pytest_simbench.tasks import Stacking, Throwing

SIMULATORS, REPETITIONS, OPENED = 8, 20, 5
LARGEST, LONGEST = 8.0, 2.0
"""Of the page [MB], and from its address to its load event in a browser [s]."""


def resampled(records: list[Record]) -> list[Record]:
    """So many repetitions of so many simulators, of each task that the records have."""
    draw = random.Random(0)
    found = []
    for task in sorted({record.task for record in records}):
        names = sorted({r.simulator for r in records if r.task == task and r.ok})
        for number in range(SIMULATORS):
            name = names[number % len(names)]
            new = name if number < len(names) else f"{name}_{number}"
            pool = [r for r in records if (r.task, r.simulator) == (task, name) and r.ok]
            for repetition in range(1, REPETITIONS + 1):
                drawn = draw.choice(pool)
                found.append(
                    replace(
                        drawn,
                        simulator=new,
                        test=drawn.test.replace(f"[{name}-", f"[{new}-"),
                        repetition=repetition,
                        seed=1000 + repetition,
                        settings=pool[0].settings,
                        versions=pool[0].versions,
                    )
                )
    return found


def opening(path: Path) -> list[float]:
    """Seconds from the address to the load event, each in a fresh context of the browser."""
    from playwright.sync_api import sync_playwright

    browser_path = shutil.which("chromium")
    if browser_path is None:
        raise SystemExit("no chromium here: apt-get install chromium")
    times = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=["--no-sandbox"])
        for _ in range(OPENED):
            page = browser.new_context(viewport={"width": 1400, "height": 900}).new_page()
            start = time.perf_counter()
            page.goto(path.as_uri(), wait_until="load")
            page.evaluate("new Promise(done => requestAnimationFrame(() => setTimeout(done)))")
            times.append(time.perf_counter() - start)
        browser.close()
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, nargs="+", help="run folders with records.jsonl")
    parser.add_argument("--keep", type=Path, help="write the page here")
    given = parser.parse_args()
    lines = [line for run in given.run for line in (run / "records.jsonl").open()]
    records = resampled([Record.from_json(line) for line in lines])
    tasks = (Stacking(), Throwing())
    summaries = summarise(
        records,
        {task.name: task.metrics for task in tasks},
        {task.name: task.references for task in tasks},
    )
    folder = given.keep or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    page = render(page_of(folder, Report(summaries, records)))
    written = time.perf_counter() - start
    path = folder / PAGE_NAME
    path.write_text(page, encoding="utf-8")
    size = path.stat().st_size / 1e6
    times = opening(path.resolve())
    rows = sum(len(summary.rows) for summary in summaries)
    dots = page.count('class="dot"')
    print(f"{len(records)} repetitions in {rows} rows; {dots} dots")
    print(f"page: {size:.2f} MB (at most {LARGEST:g}), written in {written:.1f} s")
    print(
        f"opened in {statistics.median(times):.2f} s, slowest {max(times):.2f} s "
        f"(at most {LONGEST:g})"
    )
    if given.keep is None:
        shutil.rmtree(folder)
    if size > LARGEST or max(times) > LONGEST:
        raise SystemExit("larger or slower than it may be")


if __name__ == "__main__":
    main()
