"""The page in a real browser, from file://: it sorts, filters, tells of dots, and fits."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from pytest_simbench.measure.gate import run_gate
from pytest_simbench.records.notes import Notes
from pytest_simbench.records.record import Record
from pytest_simbench.report.model.report import Report
from pytest_simbench.report.model.summary import summarise
from pytest_simbench.report.page import PAGE_NAME, context
from pytest_simbench.report.page.render import render
from tests.hostile import HOSTILE
from tests.report.browser import Opened, browser, opened
from tests.report.page.test_hostile_page import MORE
from tests.report.samples import METRICS, REFERENCES, record, stacking_run, throwing_run
from tests.report.test_hostile import declared, records

if TYPE_CHECKING:
    from playwright.sync_api import Page

STRANGE = "".join(text for text in (*HOSTILE, *MORE) if len(text) < 1000)
SIZES = [(400, 800), (1400, 900)]

__all__ = ["browser", "opened"]  # fixtures


def write(folder: Path, found: list[Record], baseline: list[Record] | None = None) -> Path:
    metrics = METRICS | declared(STRANGE)
    compared = ("runs/before", run_gate(baseline, found, (), metrics)) if baseline else None
    report = Report(summarise(found, metrics, REFERENCES), found, comparison=compared)
    path = folder / PAGE_NAME
    path.write_text(render(context.page(folder, report)), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two simulators at two tasks, one of them in both modes, with a baseline."""
    found = [*stacking_run(), *stacking_run("gui"), *throwing_run()]
    log = Notes(log="logs/test_stacking-1.log")
    found += [record("drake", k, metrics={"placed": 0.5}, notes=log) for k in range(1, 7)]
    return write(tmp_path_factory.mktemp("run"), found, stacking_run())


def column(page: Page, table: int, place: int) -> list[str]:
    """First lines of the cells of a column that are shown, top down."""
    lines = page.locator("table.data").nth(table).locator("tbody tr:visible")
    texts = lines.locator(f"> :nth-child({place + 1})").all_inner_texts()
    return [text.strip().split("\n")[0].strip() for text in texts]


def rows(page: Page, table: int = 0) -> list[str]:
    """The names of the rows that are shown, top down."""
    lines = page.locator("table.data").nth(table).locator("tbody tr:visible th")
    return [" ".join(text.split()) for text in lines.all_inner_texts()]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_it_opens_and_fits(
    report: Path, opened: Opened, width: int, height: int, scheme: str
) -> None:
    page = opened(report, width, height, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert "3 simulators did stacking and throwing" in page.locator(".answer").first.inner_text()
    compared = page.locator("#baseline").inner_text()
    assert "Compared with runs/before" in compared
    assert "is not in the baseline and is not compared" in compared
    light = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert light == (scheme == "light")
    for part in page.locator("details").all():
        part.locator("summary").click()
    assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_tables_sort_by_number_and_by_name(
    report: Path, opened: Opened, width: int, height: int
) -> None:
    page = opened(report, width, height)
    placed = page.get_by_role("button", name="placed %").first
    before = rows(page)
    assert len(before) == 5
    placed.click()
    up = column(page, 0, 2)
    values = [float(re.search(r"\d+", text)[0]) for text in up]
    assert values == sorted(values)
    assert rows(page) != before
    placed.focus()
    page.keyboard.press("Enter")  # by keyboard too
    assert column(page, 0, 2)[0] == up[-1]
    heading = page.locator("table.data").first.locator("th[aria-sort]")
    assert heading.count() == 1
    assert heading.get_attribute("aria-sort") == "descending"
    page.get_by_role("button", name="simulator").first.click()
    assert rows(page) == sorted(before)
    button = page.get_by_role("button", name="at the end %").first
    for _ in range(2):  # rows without a value come last either way
        button.click()
        assert rows(page)[-1] == "drake headless tuned"


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_filters_hide_rows_lanes_and_failures(
    report: Path, opened: Opened, width: int, height: int
) -> None:
    page = opened(report, width, height)
    assert page.locator("details.cause:visible").count() == 4
    page.get_by_label("gui", exact=True).uncheck()
    assert rows(page) == [f"{name} headless tuned" for name in ("drake", "mujoco", "pybullet")]
    assert page.locator("details.cause:visible").count() == 2
    page.get_by_label("pybullet", exact=True).uncheck()
    assert rows(page) == ["drake headless tuned", "mujoco headless tuned"]
    lanes = page.locator("figure.strip").first.locator(".lane:visible .name").all_inner_texts()
    assert [name for name in lanes if name] == ["drake (headless)", "mujoco (headless)"]
    assert re.fullmatch(
        r"\d+ of \d+ lines of all tables are shown", page.locator("#shown").inner_text()
    )
    page.get_by_label("pybullet", exact=True).check()
    page.get_by_label("gui", exact=True).check()
    assert len(rows(page)) == 5
    assert page.locator("#shown").inner_text() == ""


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_a_dot_tells_its_repetition(report: Path, opened: Opened, width: int, height: int) -> None:
    page = opened(report, width, height)
    lane = page.locator("figure.strip").first.locator(".lane").first
    lane.locator(".dot").nth(2).click()
    detail = page.locator("#detail")
    text = detail.inner_text()
    assert "drake headless (tuned), stacking" in text
    assert "placed %: 50 %" in text
    assert "repetition 3, seed 1003, ok" in text
    assert "logs/test_stacking-1.log" in text
    assert detail.locator("a").get_attribute("href") == "logs/test_stacking-1.log"
    page.keyboard.press("Escape")
    assert not detail.is_visible()
    page.locator("figure.strip").first.locator("svg.dot").first.focus()  # a cross: it failed
    text = detail.inner_text()
    assert "WorkerDied in pick: the worker was killed by SIGSEGV" in text
    assert "placed %: no value" in text


def test_dots_are_reached_by_keyboard(report: Path, opened: Opened) -> None:
    """One stop of the tabulator a line, arrow keys within and between lines."""
    page = opened(report)
    plot = page.locator("figure.strip").first
    assert plot.locator('.dot[tabindex="0"]').count() == 5
    plot.locator('.dot[tabindex="0"]').first.focus()
    seen = []
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft", "ArrowDown", "End", "Home"):
        page.keyboard.press(key)
        seen.append(page.locator("#detail").inner_text())
    assert "repetition 2," in seen[0]
    assert "repetition 3," in seen[1]
    assert "repetition 2," in seen[2]
    assert "mujoco headless" in seen[3]
    assert seen[4] != seen[5]
    assert plot.locator('.dot[tabindex="0"]').count() == 5


def test_on_paper_all_is_open_and_nothing_is_a_control(report: Path, opened: Opened) -> None:
    page = opened(report)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print", color_scheme="dark")
    assert page.locator("details:not([open])").count() == 0
    assert not page.locator("#filters").is_visible()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"


def test_a_hostile_run_opens_like_any_other(tmp_path: Path, opened: Opened) -> None:
    page = opened(write(tmp_path, records(STRANGE)), 400)
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    for part in page.locator("details").all():
        part.locator("summary").click()
    page.locator(".dot").first.click()
    page.keyboard.press("Escape")
    for button in page.locator("table.data thead button").all():
        button.click()
    links = page.eval_on_selector_all("a[href]", "all => all.map(a => a.getAttribute('href'))")
    assert all(link.startswith("#") for link in links)
    assert page.title().startswith("Simulator comparison: ")
